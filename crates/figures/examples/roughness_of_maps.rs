//! Errors of roughness mips over a folder of normal maps: the table of `docs/roughness.md`.
//!
//! `cargo run --release -p ndfmap-figures --example roughness_of_maps -- FOLDER [ROUGHNESS [LARGEST]]`; maps
//! larger than LARGEST texels on a side are left out.

mod maps;

use std::path::Path;

use ndfmap::core::grid::Grid;
use ndfmap::core::observe::Unobserved;
use ndfmap::core::roughness::{EngineMaterial, RoughSurface};
use ndfmap::roughness::{Errors, RoughnessJob, RoughnessReport};

use maps::{median, normal_map, pictures};

/// Roughness and largest side unless told otherwise.
const ROUGHNESS: f32 = 0.3;
const LARGEST: usize = 1024;

/// Measurement of a map; `None` for a picture that is no normal map, or too large.
fn measured(
    path: &Path,
    roughness: f32,
    largest: usize,
) -> Result<Option<RoughnessReport>, Box<dyn std::error::Error>> {
    let Some(map) = normal_map(path)? else { return Ok(None) };
    let size = map.surface.size();
    if size.width.max(size.height) > largest {
        return Ok(None);
    }
    let flat = Grid::from_fn(size, |_, _| roughness);
    let surface = RoughSurface::new(&*map.surface, &flat)?;
    let job = RoughnessJob { surface: &surface, material: EngineMaterial::METAL, by: None };
    Ok(Some(job.run(&Unobserved)?.report))
}

/// Row of the table: mean, median, worst, and how often worse than plain mips by a measure.
fn row(name: &str, all: &[Errors]) -> String {
    let of = |pick: fn(&Errors) -> f64| {
        let values: Vec<f64> = all.iter().map(pick).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        [mean, median(values.clone()), values.into_iter().fold(0.0, f64::max)]
    };
    let (l2, flip) = (of(|e| e.relative_l2), of(|e| e.flip));
    let cells: Vec<String> = l2.iter().zip(flip).map(|(l2, flip)| format!("{l2:.2}, {flip:.2}")).collect();
    let worse = all.iter().filter(|e| e.relative_l2 > 1.0 || e.flip > 1.0).count();
    format!("| {name} | {} | {worse} of {} |", cells.join(" | "), all.len())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name a folder of normal maps")?;
    let roughness = arguments.next().map_or(Ok(ROUGHNESS), |text| text.parse())?;
    let largest = arguments.next().map_or(Ok(LARGEST), |text| text.parse())?;
    let mut all: Vec<RoughnessReport> = Vec::new();
    for file in pictures(&folder)? {
        if let Some(report) = measured(&file, roughness, largest)? {
            let Errors { relative_l2, flip } = report.of_stock;
            eprintln!("{}: {relative_l2:.2}, {flip:.2}", file.display());
            all.push(report);
        }
    }
    let first = all.first().ok_or("no normal map is in this folder")?;
    println!("| mips | mean over maps | median | worst | worse than plain on |\n|---|---|---|---|---|");
    let written: Vec<Errors> = all.iter().map(|report| report.of_stock).collect();
    println!("{}", row("as written", &written));
    for (i, tried) in first.tried.iter().enumerate() {
        let errors: Vec<Errors> = all.iter().map(|report| report.tried[i].of_stock).collect();
        println!("{}", row(&format!("`{}`", tried.by), &errors));
    }
    let mut by = std::collections::BTreeMap::<String, usize>::new();
    for level in all.iter().flat_map(|report| &report.levels) {
        *by.entry(level.by.to_string()).or_default() += 1;
    }
    println!("levels: {by:?}");
    Ok(())
}
