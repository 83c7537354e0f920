//! Tables 3, 4 and 5 of Dupuy et al. 2013, supplemental, as contact sheets: `cargo run --release --example displacement_tables -- FOLDER`.
//!
//! Spheres of Gaussian noise, diffuse, lit from the front. Each row is a roughness; from left to right its normal map and its displacement by
//! brute force, LEADR with 5 × 5, 9 × 9 and 32 × 32 slopes. Prints the relative L2 error of each picture against the displacement. An optional
//! second argument is the side of a picture (200), a third the size of the maps (2048).

use std::path::Path;

use ndfmap::core::brdf::Lambert;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::metrics::{Picture, relative_l2};
use ndfmap::core::ndf;
use ndfmap::core::pyramid::Precision;
use ndfmap::core::scene::{self, Scene, Staging};
use ndfmap::maps::picture::write_picture;
use ndfmap::trace::filtered::{BakedMaps, Filtered, Lookups};
use ndfmap::trace::truth::{Effort, Truth};
use ndfmap::trace::{Geometry, Relief};

use ndfmap::core::lookup::Filtering;

/// Name, scene, and deviations of its slopes.
const TABLES: [(&str, &str, &[f64]); 4] = [
    ("table-3", "noise-sphere", &[0.1, 0.25, 0.5, 1.0]),
    ("table-4", "noise-sphere", &[0.1, 0.25, 0.5]),
    ("table-5-latitudinal", "noise-sphere-latitudinal", &[0.1, 0.25, 0.5]),
    ("table-5-longitudinal", "noise-sphere-longitudinal", &[0.1, 0.25, 0.5]),
];

/// Deviation of the scenes' slopes, displaced at scale 1.
const DEVIATION: f64 = 0.25;

/// Rays a pixel.
const RAYS: usize = 64;

struct Plan {
    size: Size,
    staging: Staging,
}

fn scene_of(plan: &Plan, name: &str, deviation: f64) -> Result<Scene, Box<dyn std::error::Error>> {
    let row = scene::find(name).ok_or("no such scene")?;
    let mut scene = (row.build)(&plan.staging);
    scene.set_brdf(&Lambert::SHARP);
    scene.displace(deviation / DEVIATION, false)?;
    Ok(scene)
}

/// The normal map, the displacement, and LEADR by each method.
fn pictures(
    plan: &Plan,
    scene: &Scene,
    methods: &[&str],
) -> Result<Vec<Picture>, Box<dyn std::error::Error>> {
    let effort = Effort { rays: RAYS, noise: 0.0, seed: 0 };
    let flat = Geometry::new(scene);
    let normal_map = Truth::new(scene, &flat).render(&scene.camera, plan.size, &effort, &|_| ()).picture;
    let (plain, relief) = (Geometry::without_relief(scene), Relief::new(scene));
    let truth = Truth::displaced(scene, &plain, &relief).render(&scene.camera, plan.size, &effort, &|_| ());
    let mut all = vec![normal_map, truth.picture];
    let geometry = Geometry::displaced(scene, &scene.camera, plan.size);
    for spelling in methods {
        let method = ndf::parse(spelling)?;
        let maps = BakedMaps::new(&scene.materials, &*method, Precision::Half, &|_| ());
        let filtered = Filtered { scene, geometry: &geometry, maps: &maps, progress: &|_| () };
        let lookups = Lookups { filtering: Filtering::fine(16), ..Lookups::TRILINEAR };
        all.push(filtered.render(&scene.camera, plan.size, lookups));
    }
    Ok(all)
}

/// Pictures of one size, a row after another.
fn sheet(rows: &[Vec<Picture>]) -> Picture {
    let one = rows[0][0].size();
    let size = Size { width: one.width * rows[0].len(), height: one.height * rows.len() };
    Grid::from_fn(size, |x, y| rows[y / one.height][x / one.width].row(y % one.height)[x % one.width])
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, usual: usize| arguments.get(i).map_or(Ok(usual), |text| text.parse());
    let folder = Path::new(arguments.first().ok_or("name a folder for the sheets")?);
    std::fs::create_dir_all(folder)?;
    let (side, map) = (number(1, 200)?, number(2, 2048)?);
    let staging = Staging { map_size: Size::new(map, map)?, ..Staging::default() };
    let plan = Plan { size: Size::new(side, side)?, staging };
    for (table, name, deviations) in TABLES {
        let methods: &[&str] = if table == "table-3" { &[] } else { &["slopes", "slopes:9", "slopes:32"] };
        let mut rows = Vec::new();
        for deviation in deviations {
            let all = pictures(&plan, &scene_of(&plan, name, *deviation)?, methods)?;
            let errors: Vec<String> = ["normal map"]
                .iter()
                .chain(methods)
                .zip(all.iter().take(1).chain(&all[2..]))
                .map(|(name, picture)| format!("{name} {:.4}", relative_l2(picture, &all[1])))
                .collect();
            println!("{table}, deviation {deviation}: {}", errors.join(", "));
            rows.push(all);
        }
        write_picture(&folder.join(format!("{table}.png")), &sheet(&rows), 1.0)?;
    }
    Ok(())
}
