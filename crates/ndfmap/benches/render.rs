//! Pictures: what a filtered one costs against a truth of 256 rays a pixel at equal settings, in one thread,
//! and its error.
//!
//! Truth and methods take turns in one run, and ratios are between medians. `NDFMAP_BENCH_SIZE` sets the
//! picture's side (default 250; the truth is timed at a quarter of the rays and scaled, as every ray costs
//! the same), `NDFMAP_BENCH_RUNS` the turns (default 3). The second table shows what time depends on: pixels,
//! and hardly the size of the map.

use std::time::Instant;

use ndfmap_core::grid::Size;
use ndfmap_core::lookup::{Filtering, Lookups};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Unobserved;
use ndfmap_core::pyramid::Precision;
use ndfmap_scene as scene;
use ndfmap_scene::metrics::{color_error, relative_l2};
use ndfmap_scene::{Effort, Scene, SceneOptions};
use ndfmap_trace::Geometry;
use ndfmap_trace::filtered::{BakedMaps, Filtered};
use ndfmap_trace::truth::Truth;

const METHODS: &[&str] = &["naive", "toksvig", "slopes", "sh:4", "gmm:4", "vmf:4", "vmf:6", "phong:4"];

const FILTERS: &[(&str, Filtering)] = &[
    ("trilinear", Filtering::TRILINEAR),
    ("anisotropic:16", Filtering::anisotropic(16)),
    ("fine:16", Filtering::fine(16)),
];

/// Rays of the truth that is timed, and of the one that costs are stated against.
const TIMED: usize = 64;
const STATED: usize = 256;

fn setting(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

fn square(side: usize) -> Size {
    Size { width: side, height: side }
}

fn scene(name: &str, time: f64, map: usize) -> Result<Scene, Box<dyn std::error::Error>> {
    let row = scene::find(name).ok_or("no such scene")?;
    Ok((row.build)(&SceneOptions { time, map_size: square(map), map: None }))
}

/// Median seconds of some work.
fn median(runs: usize, mut work: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn costs(name: &str, time: f64, side: usize, runs: usize) -> Result<(), Box<dyn std::error::Error>> {
    let scene = scene(name, time, 512)?;
    let (geometry, size) = (Geometry::new(&scene), square(side));
    let truth = Truth::new(&scene, &geometry);
    let brute =
        |rays, seed| truth.render(&scene.camera, size, &Effort { rays, noise: 0.0, seed }, &Unobserved);
    let seconds = median(runs, || drop(brute(TIMED, 0))) * (STATED / TIMED) as f64;
    let best = brute(STATED, 1)?;
    println!(
        "\n{name} at time {time}, {side} x {side}: truth of {STATED} rays {seconds:.2} s, noise {:.3}",
        best.noise
    );
    println!(
        "{:8} {:14} {:>9} {:>12} {:>12} {:>12}",
        "method", "filter", "ms", "truth / this", "color_error", "relative_l2"
    );
    for spelling in METHODS {
        let method = spelling.parse::<AnyMethod>()?;
        let maps = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ())?;
        let filtered = Filtered { scene: &scene, geometry: &geometry, maps: &maps };
        for (filter, filtering) in FILTERS {
            let lookups = Lookups::taps(*filtering);
            let render = || filtered.render(&scene.camera, size, lookups, &Unobserved);
            let own = median(runs, || drop(render()));
            let picture = render()?;
            println!(
                "{spelling:8} {filter:14} {:>9.1} {:>12.0} {:>12.4} {:>12.3}",
                own * 1e3,
                seconds / own,
                color_error(&picture, &best.picture, scene.exposure),
                relative_l2(&picture, &best.picture)
            );
        }
    }
    Ok(())
}

fn scaling(side: usize, runs: usize) -> Result<(), Box<dyn std::error::Error>> {
    println!("\nplane by vmf:4, fine:16: milliseconds, and nanoseconds a pixel");
    let method = "vmf:4".parse::<AnyMethod>()?;
    for map in [256, 512, 1024] {
        let scene = scene("plane", 0.0, map)?;
        let geometry = Geometry::new(&scene);
        let maps = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ())?;
        let filtered = Filtered { scene: &scene, geometry: &geometry, maps: &maps };
        for side in [side / 2, side, 2 * side] {
            let lookups = Lookups::taps(Filtering::fine(16));
            let render = || filtered.render(&scene.camera, square(side), lookups, &Unobserved);
            let own = median(runs, || drop(render()));
            println!(
                "map {map:>5}, picture {side:>5}: {:>8.1} ms {:>8.0} ns",
                own * 1e3,
                own * 1e9 / (side * side) as f64
            );
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (side, runs) = (setting("NDFMAP_BENCH_SIZE", 250), setting("NDFMAP_BENCH_RUNS", 3));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let all = || {
        for (name, time) in [("disk", 0.15), ("disk-oblique", 0.0), ("armour", 0.5), ("plane", 0.0)] {
            costs(name, time, side, runs).map_err(|e| e.to_string())?;
        }
        scaling(side, runs).map_err(|e| e.to_string())
    };
    pool.install(all)?;
    Ok(())
}
