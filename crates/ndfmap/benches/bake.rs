//! Time of a bake, without files, against a plain copy of its input and output; and its error.
//!
//! Machines are noisy, so the copy and the bakes take turns and ratios are between medians of one run.
//! `NDFMAP_BENCH_SIZE` sets the map's side (default 4096), `NDFMAP_BENCH_RUNS` the turns (default 5).

use std::time::Instant;

use ndfmap_core::bake::{Bake, MemorySink};
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::Size;
use ndfmap_core::measure::{BakedMap, TexelTruth, lattice_for, level_errors};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::procedural;
use ndfmap_core::pyramid::{Layout, Precision, level_sizes};
use ndfmap_core::surface::{Surface, SurfaceRow, Wraps};
use ndfmap_maps::source::{SourceOptions, source_of_image};
use ndfmap_maps::{Image, Samples};

const METHODS: &[&str] = &["fixed", "naive", "toksvig", "slopes", "ndm", "sh:2", "sh:4", "sh:7"];

fn setting(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// An 8-bit normal map of crumpled foil, as a file would give it.
fn encoded(size: Size) -> Result<Image, Box<dyn std::error::Error>> {
    let surface = (procedural::find("foil").ok_or("no foil")?.build)(size);
    let mut row = SurfaceRow::flat(size.width);
    let mut bytes = Vec::with_capacity(size.area() * 3);
    for y in 0..size.height {
        surface.read_row(y, &mut row);
        for x in 0..size.width {
            bytes.extend(row.normal(x).to_array().map(|c| ((c + 1.0) * 127.5).round() as u8));
        }
    }
    Ok(Image::new("foil".as_ref(), size, 3, Samples::U8(bytes))?)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn timed(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

/// Error at level 4 of the same surface at 512², blinn-phong:50.
fn error(spelling: &str) -> Result<f64, Box<dyn std::error::Error>> {
    let surface = (procedural::find("foil").ok_or("no foil")?.build)(Size::new(512, 512)?);
    let lobe = "blinn-phong:50".parse::<AnyLobe>()?;
    let lattice = lattice_for(&*lobe)?;
    let truth = TexelTruth::new(&*surface, &*lobe, &lattice);
    let method = spelling.parse::<AnyMethod>()?;
    let pyramid = Bake::new(&*surface, &*method).to_pyramid()?.0;
    let map = BakedMap { pyramid: &pyramid, from_level: 0, method: &*method };
    Ok(level_errors(&truth, &[map], &|_| ())?.maps[0][4].error)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let side = setting("NDFMAP_BENCH_SIZE", 4096);
    let runs = setting("NDFMAP_BENCH_RUNS", 5).max(1);
    let size = Size::new(side, side)?;
    let image = encoded(size)?;
    let input = match &image.samples {
        Samples::U8(v) => v.clone(),
        _ => Vec::new(),
    };
    let map = source_of_image("foil".as_ref(), image, String::new(), &SourceOptions::default())?;
    println!(
        "{side} × {side} 8-bit normals to half floats, {} threads, {runs} turns",
        rayon::current_num_threads()
    );
    println!(
        "{:8} {:>10} {:>10} {:>8} {:>12} {:>8}",
        "method", "copy ms", "bake ms", "ratio", "ns/texel", "error"
    );
    for spelling in METHODS {
        let method = spelling.parse::<AnyMethod>()?;
        let surface: &dyn Surface = &*map.surface;
        let bake = Bake::new(surface, &*method);
        let layout =
            Layout { size, layers: method.layers(), precision: Precision::Half, wraps: Wraps::default() };
        if layout.layers * size.area() > 1 << 28 {
            println!("{spelling:8} skipped: its output would not fit the memory of a small machine");
            continue;
        }
        let bytes: usize = level_sizes(size).iter().map(|s| layout.layer_bytes(*s) * layout.layers).sum();
        // Both write into memory that has been written before: neither pays for the first touch.
        let mut copies = (vec![1_u8; input.len()], vec![1_u8; bytes]);
        let output = vec![2_u8; bytes];
        let mut sink = MemorySink::new(layout);
        bake.run(&mut sink)?;
        let (mut copy_times, mut bake_times) = (Vec::new(), Vec::new());
        for _ in 0..runs {
            copy_times.push(timed(|| {
                copies.0.copy_from_slice(&input);
                copies.1.copy_from_slice(&output);
                std::hint::black_box(&copies);
            }));
            bake_times.push(timed(|| {
                let report = bake.run(&mut sink);
                std::hint::black_box(&report);
            }));
        }
        let (copy, bake) = (median(copy_times), median(bake_times));
        println!(
            "{spelling:8} {:>10.1} {:>10.1} {:>8.2} {:>12.2} {:>8.3}",
            copy * 1e3,
            bake * 1e3,
            bake / copy,
            bake * 1e9 / size.area() as f64,
            error(spelling)?
        );
    }
    Ok(())
}
