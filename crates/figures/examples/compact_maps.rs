//! Error of maps in integers over that of half floats, at texels and between them: the table of
//! `docs/compact.md`.
//!
//! `cargo run --release -p ndfmap-figures --example compact_maps -- FOLDER [LOBE,LOBE [METHOD,METHOD]]`.
//! Of each map its middle is taken, 256 × 256 texels; level 0 is left out, as `--from-level 1` leaves it out.

mod maps;

use ndfmap::core::bake::Bake;
use ndfmap::core::brdf::AnyLobe;
use ndfmap::core::compact::{Bits, Storage};
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::measure::{BakedMap, TexelTruth, filtering_errors, lattice_for, level_errors};
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::observe::Unobserved;
use ndfmap::core::pyramid::{Precision, Pyramid};
use ndfmap::core::surface::{NormalGrid, Surface, SurfaceRow, Wrap, Wraps};

use maps::{median, normal_map, pictures};

const METHODS: &str = "toksvig,slopes,sh:4,vmf:2,vmf:4";
const LOBES: &str = "blinn-phong:50,blinn-phong:400,blinn-phong:1000";

/// Texels a side of the part that is measured.
const SIDE: usize = 256;

/// Finest level that is stored, and the levels that errors are means over.
const FROM: usize = 1;
const LEVELS: std::ops::RangeInclusive<usize> = 1..=5;

const STORAGES: [Storage; 4] = [
    Storage::Float(Precision::Half),
    Storage::Compact(Bits::Eight),
    Storage::Compact(Bits::Ten),
    Storage::Compact(Bits::Sixteen),
];

/// Errors of a storage on one map: at texels and between them.
type Errors = [f64; 2];

/// Middle of a map; edges are clamped, since it no longer repeats.
fn middle(surface: &dyn Surface) -> NormalGrid {
    let size = surface.size();
    let side = Size { width: SIDE.min(size.width), height: SIDE.min(size.height) };
    let (left, top) = ((size.width - side.width) / 2, (size.height - side.height) / 2);
    let mut row = SurfaceRow::flat(size.width);
    let mut normals = Vec::with_capacity(side.area());
    for y in top..top + side.height {
        surface.read_row(y, &mut row);
        normals.extend((left..left + side.width).map(|x| row.normal(x)));
    }
    let normals = Grid::from_vec(side, normals).unwrap_or_else(|| unreachable!("row by row"));
    NormalGrid { normals, wraps: Wraps { x: Wrap::Clamp, y: Wrap::Clamp } }
}

/// Errors of every storage of a method's map.
fn measured(
    surface: &NormalGrid,
    method: &AnyMethod,
    lobe: &AnyLobe,
) -> Result<Vec<Errors>, Box<dyn std::error::Error>> {
    let single = Bake::new(surface, &**method).precision(Precision::Single).to_pyramid()?.0.from_level(FROM);
    let half = Bake::new(surface, &**method).to_pyramid()?.0.from_level(FROM);
    let stored = |storage: Storage| match storage {
        Storage::Float(_) => half.clone(),
        Storage::Compact(_) => storage.stored(single.clone(), method.encoding()),
    };
    let pyramids: Vec<Pyramid> = STORAGES.into_iter().map(stored).collect();
    let map = |pyramid| BakedMap { pyramid, from_level: FROM, method: &**method };
    let maps: Vec<BakedMap<'_>> = pyramids.iter().map(map).collect();
    let lattice = lattice_for(&**lobe)?;
    let truth = TexelTruth::new(surface, &**lobe, &lattice);
    let at = level_errors(&truth, &maps, &Unobserved)?.maps;
    let levels: Vec<usize> = LEVELS.collect();
    let between = filtering_errors(&truth, surface.wraps(), &levels, &maps, &Unobserved)?;
    let mean = |errors: Vec<f64>| errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    let both = at.iter().zip(&between).map(|(at, between)| {
        let at = at.iter().take(LEVELS.end() + 1 - FROM).map(|e| e.error).collect();
        [mean(at), mean(between.iter().map(|e| e.filtered.error).collect())]
    });
    Ok(both.collect())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name a folder of normal maps")?;
    let lobes = arguments.next().unwrap_or_else(|| LOBES.to_owned());
    let methods = arguments.next().unwrap_or_else(|| METHODS.to_owned());
    let mut surfaces = Vec::new();
    for file in pictures(&folder)? {
        if let Some(map) = normal_map(&file)? {
            surfaces.push(middle(&*map.surface));
        }
    }
    println!(
        "{} maps, levels {} to {}; errors over those of half floats",
        surfaces.len(),
        LEVELS.start(),
        LEVELS.end()
    );
    println!(
        "| method | exponent | storage | bytes | at texels: mean, median, worst | between: mean, median, worst |"
    );
    println!("|---|---|---|---|---|---|");
    for method in methods.split(',') {
        let method = method.parse::<AnyMethod>()?;
        for lobe in lobes.split(',') {
            let lobe = lobe.parse::<AnyLobe>()?;
            let mut all = Vec::new();
            for surface in &surfaces {
                all.push(measured(surface, &method, &lobe)?);
            }
            for (i, storage) in STORAGES.iter().enumerate() {
                // Of texels of the source, a quarter is kept, and a third of that besides.
                let bytes = storage.texel_bytes(method.layers()) as f64 / 3.0;
                let said = [0, 1].map(|place: usize| {
                    let ratios: Vec<f64> =
                        all.iter().map(|map| map[i][place] / map[0][place].max(1e-4)).collect();
                    let mean = ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
                    let worst = ratios.iter().copied().fold(0.0, f64::max);
                    format!("{mean:.2}, {:.2}, {worst:.2}", median(ratios))
                });
                println!("| `{method}` | `{lobe}` | `{storage}` | {bytes:.1} | {} | {} |", said[0], said[1]);
            }
        }
    }
    Ok(())
}
