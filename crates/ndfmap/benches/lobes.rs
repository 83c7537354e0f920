//! Cost and gain of fitted lobes: seconds and nanoseconds a texel by map size, and errors against
//! Toksvig's, at texels and between them, over several maps; medians in one table.
//!
//! `NDFMAP_BENCH_SIZE` is the largest side timed (default 4096), `NDFMAP_BENCH_RUNS` the turns (default 3).
//! With `NDFMAP_BENCH_MAPS` naming a folder, normal maps in it are measured beside the built-in ones.

use std::path::{Path, PathBuf};
use std::time::Instant;

use ndfmap_core::bake::{Bake, BakeError, MemorySink};
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::measure::{BakedMap, FilteringError, TexelTruth, filtering_errors, lattice_for};
use ndfmap_core::ndf::{AnyMethod, Shows};
use ndfmap_core::observe::Cancelled;
use ndfmap_core::surface::{NormalGrid, Surface, SurfaceRow};
use ndfmap_maps::source::{SourceOptions, read_source};

/// Measured against the first.
const METHODS: [&str; 12] = [
    "toksvig",
    "vmf:1",
    "vmf:2",
    "vmf:4",
    "vmf:6",
    "gmm:4",
    "vmf:4:parent",
    "vmf:4:prior",
    "vmf:4:matched",
    "vmf:4:unaligned",
    "vmf:6:unaligned",
    "gmm:4:prior",
];

/// Timed, at every size.
const TIMED: [&str; 4] = ["toksvig", "vmf:4", "gmm:4", "vmf:4:unaligned"];

/// The maps measured where a folder is named; the built-in ones always are.
const FILES: [&str; 8] = [
    "ambientcg_Bricks075B_1K_NormalGL.jpg",
    "godot_wool_normal.png",
    "godot_scifi_2_normal.png",
    "bevy_ScratchedGold-Normal.png",
    "bevy_water_normals.png",
    "sponza_lion_ddn.tga",
    "ambientcg_Leather034C_1K_NormalGL.jpg",
    "ambientcg_Rock058_normal.jpg",
];
const BUILTIN: [&str; 2] = ["builtin:carved-disk", "builtin:armour"];

const LEVELS: [usize; 4] = [3, 4, 5, 6];
const LOBES: [&str; 2] = ["blinn-phong:50", "blinn-phong:400"];

/// Of larger maps the upper left part is taken.
const MOST: usize = 1024;

fn setting(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { f64::midpoint(values[middle - 1], values[middle]) }
}

/// A map in memory, so that reading it is not timed.
fn load(map: &Path, size: usize) -> Result<NormalGrid, Box<dyn std::error::Error>> {
    let options = SourceOptions { builtin_size: Size::new(size, size)?, ..SourceOptions::default() };
    let source = read_source(map, &options)?;
    let whole = source.surface.size();
    let part = Size::new(whole.width.min(size), whole.height.min(size))?;
    let mut row = SurfaceRow::flat(whole.width);
    let mut normals = Vec::with_capacity(part.area());
    for y in 0..part.height {
        source.surface.read_row(y, &mut row);
        normals.extend((0..part.width).map(|x| row.normal(x)));
    }
    let normals = Grid::from_vec(part, normals).ok_or("as many normals as texels")?;
    Ok(NormalGrid { normals, wraps: source.surface.wraps() })
}

fn time(largest: usize, turns: usize) -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "bakes of builtin:foil to half floats in memory, {} threads, {turns} turns",
        rayon::current_num_threads()
    );
    println!("{:16} {:>6} {:>9} {:>9} {:>13}", "method", "side", "s", "ns/texel", "ratio to the first");
    for side in [512, 1024, 4096].into_iter().filter(|s| *s <= largest) {
        let surface = load("builtin:foil".as_ref(), side)?;
        let mut first = None;
        for spelling in TIMED {
            // The reference is there for its error; minutes of it would tell nothing new.
            if side > 1024 && spelling.ends_with("unaligned") {
                continue;
            }
            let method = spelling.parse::<AnyMethod>()?;
            let bake = Bake::new(&surface, &*method);
            let mut sink = MemorySink::new(bake.layout());
            bake.run(&mut sink)?;
            let mut turn = || -> Result<f64, BakeError<std::convert::Infallible>> {
                let start = Instant::now();
                bake.run(&mut sink)?;
                Ok(start.elapsed().as_secs_f64())
            };
            let times = (0..turns).map(|_| turn()).collect::<Result<Vec<f64>, _>>()?;
            let seconds = median(times);
            let ratio = seconds / *first.get_or_insert(seconds);
            let each = seconds * 1e9 / (side * side) as f64;
            println!("{spelling:16} {side:>6} {seconds:>9.3} {each:>9.1} {ratio:>13.1}");
        }
    }
    Ok(())
}

/// Errors of every method on a map: for each BRDF and level.
fn measure(map: &Path) -> Result<Vec<Vec<Vec<FilteringError>>>, Box<dyn std::error::Error>> {
    let surface = load(map, MOST.min(setting("NDFMAP_BENCH_SIZE", MOST)))?;
    let methods = METHODS.map(str::parse::<AnyMethod>).into_iter().collect::<Result<Vec<_>, _>>()?;
    let baked = |method: &AnyMethod| Ok::<_, Cancelled>(Bake::new(&surface, &**method).to_pyramid()?.0);
    let pyramids = methods.iter().map(baked).collect::<Result<Vec<_>, _>>()?;
    let shown = methods.iter().map(|method| -> &dyn Shows { &**method });
    let map = |(pyramid, method)| BakedMap { pyramid, from_level: 0, method };
    let maps: Vec<BakedMap<'_>> = pyramids.iter().zip(shown).map(map).collect();
    let mut all = vec![Vec::new(); METHODS.len()];
    for lobe in LOBES {
        let lobe = lobe.parse::<AnyLobe>()?;
        let lattice = lattice_for(&*lobe)?;
        let truth = TexelTruth::new(&surface, &*lobe, &lattice);
        let errors = filtering_errors(&truth, surface.wraps(), &LEVELS, &maps, &|_| ())?;
        all.iter_mut().zip(errors).for_each(|(all, errors)| all.push(errors));
    }
    Ok(all)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    time(setting("NDFMAP_BENCH_SIZE", 4096), setting("NDFMAP_BENCH_RUNS", 3).max(1))?;
    let folder = std::env::var_os("NDFMAP_BENCH_MAPS").map(PathBuf::from);
    let files = folder.iter().flat_map(|folder| FILES.iter().map(|f| folder.join(f)));
    let maps: Vec<PathBuf> = files.chain(BUILTIN.iter().map(PathBuf::from)).collect();
    // [map][method][brdf][level]
    let mut errors = Vec::new();
    for map in &maps {
        errors.push(measure(map)?);
        println!("\n{}", map.display());
        for (spelling, of_method) in METHODS.iter().zip(errors.last().into_iter().flatten()) {
            let line = of_method
                .iter()
                .flatten()
                .map(|e| format!("{:.3}/{:.3}/{:.3}", e.texels.error, e.filtered.error, e.reference.error));
            println!("{spelling:16} {}", line.collect::<Vec<_>>().join(" "));
        }
    }
    println!(
        "\nmedian over {} maps and levels 3 to 6 of the error divided by toksvig's at the same place",
        maps.len()
    );
    println!("{:16} {:>31} {:>31}", "", LOBES[0], LOBES[1]);
    println!("{:16} {:>31} {:>31}", "method", "texels  between  reference", "texels  between  reference");
    for (m, spelling) in METHODS.iter().enumerate() {
        print!("{spelling:16}");
        for b in 0..LOBES.len() {
            let ratio = |own: fn(&FilteringError) -> f64, base: fn(&FilteringError) -> f64| {
                let of_map = |map: &Vec<Vec<Vec<FilteringError>>>| {
                    let pairs = map[m][b].iter().zip(&map[0][b]);
                    pairs.map(|(e, toksvig)| own(e) / base(toksvig)).collect::<Vec<_>>()
                };
                median(errors.iter().flat_map(of_map).collect())
            };
            let texels = ratio(|e| e.texels.error, |e| e.texels.error);
            let between = ratio(|e| e.filtered.error, |e| e.filtered.error);
            let reference = ratio(|e| e.reference.error, |e| e.filtered.error);
            print!(" {texels:>12.3} {between:>8.3} {reference:>9.3}");
        }
        println!();
    }
    Ok(())
}
