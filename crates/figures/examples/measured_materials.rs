//! The table of measured materials in `docs/environment.md`: what their factors leave, and how far `sh:7` and
//! `vmf:6` are from the truth.
//!
//! `cargo run --release -p ndfmap-figures --example measured_materials [-- MAP]`; without a map, on built-in
//! foil.

use std::path::PathBuf;

use ndfmap::core::bake::Bake;
use ndfmap::core::brdf::AnyLobe;
use ndfmap::core::measure::TexelTruth;
use ndfmap::core::ndf::{AnyMethod, Evaluator as _};
use ndfmap::core::sphere::DiskLattice;
use ndfmap::maps::source::{SourceOptions, read_source};
use rayon::prelude::*;

/// From matte to shiny.
const MATERIALS: [&str; 10] = [
    "pink-felt",
    "blue-fabric",
    "green-latex",
    "pearl-paint",
    "gold-metallic-paint",
    "black-oxidized-steel",
    "natural-209",
    "white-paint",
    "nickel",
    "specular-red-phenolic",
];

/// Level whose texels are measured: 32 × 32 fine ones each.
const LEVEL: usize = 5;

/// Every third texel of it each way.
const STEP: usize = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let map = std::env::args().nth(1).map_or_else(|| PathBuf::from("builtin:foil"), PathBuf::from);
    let source = read_source(&map, &SourceOptions::default())?;
    let lattice = DiskLattice::new(64, 0.97);
    let methods = ["toksvig", "sh:7", "sh:16", "vmf:4", "vmf:6"]
        .map(|m| m.parse::<AnyMethod>().map_err(|e| e.to_string()));
    let methods = methods.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut pyramids = Vec::new();
    for method in &methods {
        let bake = Bake::new(&*source.surface, &**method);
        pyramids.push(bake.to_pyramid()?.0);
    }
    println!(
        "level {LEVEL} of {}; errors are relative L2 against the material itself, over half-vectors\n\
         at three difference angles; factors: of the normals as they are, by the factors",
        map.display()
    );
    println!(
        "material                 width  kernels  tables       lobe    factors{}",
        methods.iter().map(|m| format!("{:>8}", m.to_string())).collect::<String>()
    );
    for material in MATERIALS {
        let lobe = format!("sgd:{material}").parse::<AnyLobe>()?;
        let factors = lobe.measured().ok_or("a measured lobe")?.factors();
        let degrees = lobe.slope_variance().map_or(0.0, |v| v.get().sqrt().to_degrees());
        let kernels = factors.channels.iter().map(|c| c.kernels.len()).sum::<usize>();
        print!(
            "{material:22} {degrees:6.2}° {kernels:8} {:7.1} % {:6.1} %  ",
            100.0 * factors.residual.factored,
            100.0 * factors.residual.fitted
        );
        let truth = TexelTruth::new(&*source.surface, &*lobe, &lattice);
        let size = pyramids[0].sizes()[LEVEL];
        let of = |i: usize| (i % size.width, i / size.width);
        let places: Vec<(usize, usize)> =
            (0..size.area()).map(of).filter(|(x, y)| x % STEP == 0 && y % STEP == 0).collect();
        let each = |of: &(dyn Fn(usize, usize) -> Vec<f64> + Sync)| -> Vec<Vec<f64>> {
            places.par_iter().map(|(x, y)| of(*x, *y)).collect()
        };
        let truths = each(&|x, y| truth.texel(size, x, y));
        print!("{:8.3}", relative(&each(&|x, y| truth.factored_texel(size, x, y)), &truths));
        for (method, pyramid) in methods.iter().zip(&pyramids) {
            let evaluator = truth.shown_by(&**method);
            let shown = each(&|x, y| {
                let mut values = vec![0.0; truth.values()];
                evaluator.evaluate(&pyramid.texel(LEVEL, x, y), &mut values);
                values
            });
            print!("{:8.3}", relative(&shown, &truths));
        }
        println!();
    }
    Ok(())
}

/// Relative L2 error of lobes.
fn relative(shown: &[Vec<f64>], truths: &[Vec<f64>]) -> f64 {
    let squares = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        let both = shown.iter().flatten().zip(truths.iter().flatten());
        both.map(|(a, b)| of(*a, *b).powi(2)).sum()
    };
    (squares(&|a, b| a - b) / squares(&|_, b| b)).sqrt()
}
