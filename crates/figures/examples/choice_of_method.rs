//! Error of a few methods over a folder of normal maps, at texels and between them: the table of
//! `docs/choose.md`.
//!
//! `cargo run --release -p ndfmap-figures --example choice_of_method -- FOLDER [LOBE [METHOD,METHOD]]`; the
//! first method is the one that others are divided by.

mod maps;

use std::path::Path;

use ndfmap::compare::{Comparison, Row, Subject, compare};
use ndfmap::core::brdf::AnyLobe;
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::observe::Unobserved;
use ndfmap::core::pyramid::Precision;

use maps::{median, normal_map, pictures};

/// Methods unless told otherwise.
const METHODS: &str = "toksvig,naive,slopes,vmf:1,vmf:2,vmf:3,vmf:4";

/// Levels over which errors are averaged: those of distances at which maps are seen.
const LEVELS: std::ops::RangeInclusive<usize> = 2..=7;

/// Lobe unless told otherwise: GGX of roughness 0.45.
const LOBE: &str = "roughness:0.45";

/// Measures of a method on one map.
struct Measures {
    at: f64,
    between: f64,
    /// Error of level 0, the map itself.
    finest: f64,
    bake_seconds: f64,
}

impl Measures {
    fn of(row: &Row) -> Self {
        let mean = |errors: Vec<f64>| errors.iter().sum::<f64>() / errors.len().max(1) as f64;
        let at = row.levels.iter().filter(|e| LEVELS.contains(&e.level)).map(|e| e.error);
        let between = row.filtering.iter().filter(|e| LEVELS.contains(&e.level)).map(|e| e.filtered.error);
        Self {
            at: mean(at.collect()),
            between: mean(between.collect()),
            finest: row.levels[0].error,
            bake_seconds: row.bake_seconds,
        }
    }
}

/// Compares the methods on a map; `None` for a picture that is no normal map.
fn measured(
    path: &Path,
    methods: &[AnyMethod],
    lobe: &AnyLobe,
) -> Result<Option<Comparison>, Box<dyn std::error::Error>> {
    let Some(map) = normal_map(path)? else { return Ok(None) };
    let subject = Subject {
        name: "map",
        surface: &*map.surface,
        lobe: &**lobe,
        methods,
        baked: &[],
        engines: &[],
        storage: Precision::Half.into(),
        filtering: true,
    };
    Ok(Some(compare(&subject, &Unobserved)?))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name a folder of normal maps")?;
    let lobe = arguments.next().unwrap_or_else(|| LOBE.to_owned()).parse::<AnyLobe>()?;
    let methods = arguments.next().unwrap_or_else(|| METHODS.to_owned());
    let methods = methods.split(',').map(str::parse::<AnyMethod>).collect::<Result<Vec<_>, _>>()?;
    let mut all: Vec<Comparison> = Vec::new();
    for file in pictures(&folder)? {
        if let Some(comparison) = measured(&file, &methods, &lobe)? {
            eprintln!("{}", file.display());
            all.push(comparison);
        }
    }
    println!("{} maps, {lobe}, levels {} to {}", all.len(), LEVELS.start(), LEVELS.end());
    println!(
        "method        bytes   texels  between   of the first's: texels  between  worst  better on  level 0  bake s"
    );
    for (at, method) in methods.iter().enumerate() {
        let measures: Vec<Measures> = all.iter().map(|c| Measures::of(&c.rows[at])).collect();
        let base: Vec<Measures> = all.iter().map(|c| Measures::of(&c.rows[0])).collect();
        let ratios = |of: fn(&Measures) -> f64| -> Vec<f64> {
            measures.iter().zip(&base).map(|(m, b)| of(m) / of(b)).collect()
        };
        let between = ratios(|m| m.between);
        println!(
            "{:13} {:>5}  {:>7.4}  {:>7.4}  {:>23.3}  {:>7.3}  {:>5.2}  {:>3} of {}  {:>8.4}  {:>6.2}",
            method.to_string(),
            all.first().map_or(0, |c| c.rows[at].bytes_per_texel),
            median(measures.iter().map(|m| m.at).collect()),
            median(measures.iter().map(|m| m.between).collect()),
            median(ratios(|m| m.at)),
            median(between.clone()),
            between.iter().copied().fold(0.0, f64::max),
            between.iter().filter(|ratio| **ratio < 1.0).count(),
            between.len(),
            median(measures.iter().map(|m| m.finest).collect()),
            median(measures.iter().map(|m| m.bake_seconds).collect())
        );
    }
    Ok(())
}
