//! The table of measured materials in `docs/environment.md`: what their factors leave, and how far `sh:7` and
//! `vmf:6` are from the truth.
//!
//! `cargo run --release --example measured_materials [-- MAP]`; without a map, on built-in foil.

use std::path::PathBuf;

use ndfmap::core::bake::Bake;
use ndfmap::core::brdf::AnyLobe;
use ndfmap::core::measure::TexelTruth;
use ndfmap::core::ndf::AnyMethod;
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
    println!("level {LEVEL} of {}; errors are relative L2 over half-vectors, of f alone", map.display());
    println!(
        "material                 width  kernels  factors     lobe  {}",
        methods.iter().map(|m| format!("{:>8}", m.to_string())).collect::<String>()
    );
    for material in MATERIALS {
        let lobe = format!("sgd:{material}").parse::<AnyLobe>()?;
        let factors = lobe.measured().ok_or("a measured lobe")?;
        let degrees = lobe.slope_variance().map_or(0.0, |v| v.get().sqrt().to_degrees());
        print!(
            "{material:22} {degrees:6.2}° {:8} {:7.1} % {:6.1} %  ",
            factors.kernels.len(),
            100.0 * factors.residual.factored,
            100.0 * factors.residual.fitted
        );
        let truth = TexelTruth::new(&*source.surface, &*lobe, &lattice);
        let size = pyramids[0].sizes()[LEVEL];
        let of = |i: usize| (i % size.width, i / size.width);
        let places: Vec<(usize, usize)> =
            (0..size.area()).map(of).filter(|(x, y)| x % STEP == 0 && y % STEP == 0).collect();
        let truths: Vec<Vec<f64>> = places.par_iter().map(|(x, y)| truth.texel(size, *x, *y)).collect();
        for (method, pyramid) in methods.iter().zip(&pyramids) {
            let evaluator = method.evaluator(&*lobe, &lattice.directions);
            let (mut off, mut all) = (0.0, 0.0);
            let mut lobe_of = vec![0.0; lattice.len()];
            for ((x, y), truth) in places.iter().zip(&truths) {
                evaluator.evaluate(&pyramid.texel(LEVEL, *x, *y), &mut lobe_of);
                for (a, b) in lobe_of.iter().zip(truth) {
                    off += (a - b) * (a - b);
                    all += b * b;
                }
            }
            print!("{:8.3}", (off / all).sqrt());
        }
        println!();
    }
    Ok(())
}
