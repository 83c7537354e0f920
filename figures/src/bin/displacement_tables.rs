//! Tables 3 to 10 and Figure 5 of Dupuy et al. 2013, supplemental, as contact sheets:
//! `cargo run --release --example displacement_tables -- FOLDER`.
//!
//! Spheres of Gaussian noise: diffuse under a light from the front (3 to 5), diffuse in an environment (6,
//! 7), mirrors in an environment (8 to 10, and Figure 5). Each row is a roughness; from left to right its
//! normal map and its displacement by brute force, and LEADR with more and more slopes. Prints the relative
//! L2 error of each picture against the displacement, and against LEADR's own with the most slopes. An
//! optional second argument is the side of a picture (200), a third the size of the maps (2048), a fourth the
//! beginning of the names of the tables that are wanted (all).

use std::path::Path;

use glam::DVec3;
use ndfmap::core::brdf::{AnyLobe, Lambert};
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::light::environment::{SceneEnvironment, builtin};
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::core::observe::Unobserved;
use ndfmap::core::pyramid::Precision;
use ndfmap::maps::picture::write_picture;
use ndfmap::scene;
use ndfmap::scene::metrics::{Picture, relative_l2};
use ndfmap::scene::{Effort, Scene, SceneOptions};
use ndfmap::trace::filtered::{BakedMaps, Filtered};
use ndfmap::trace::truth::Truth;
use ndfmap::trace::{DisplacedMeshes, Geometry};

use ndfmap::core::ndf::AnyMethod;

/// What the spheres are made of, and what lights them.
#[derive(Clone, Copy, PartialEq)]
enum Case {
    /// Diffuse facets, one light from the front.
    Front,
    /// Diffuse facets in an environment.
    Irradiance,
    /// Mirrors in an environment.
    Mirror,
}

/// A table: its name, the scene, what is shown, and by which methods.
struct Table {
    name: &'static str,
    scene: &'static str,
    case: Case,
    methods: &'static [&'static str],
}

const DIFFUSE: &[&str] = &["slopes", "slopes:9", "slopes:32", "slopes:128"];
const FEW: &[&str] = &["slopes", "slopes:9", "slopes:32"];
const DRAWN: &[&str] =
    &["slopes", "slopes:5:drawn", "slopes:9", "slopes:9:drawn", "slopes:32", "slopes:32:drawn", "slopes:128"];
const ISOTROPIC: &str = "noise-sphere";
const LATITUDINAL: &str = "noise-sphere-latitudinal";
const LONGITUDINAL: &str = "noise-sphere-longitudinal";

const TABLES: [Table; 10] = [
    Table { name: "table-3", scene: ISOTROPIC, case: Case::Front, methods: &[] },
    Table { name: "table-4", scene: ISOTROPIC, case: Case::Front, methods: FEW },
    Table { name: "table-5-latitudinal", scene: LATITUDINAL, case: Case::Front, methods: FEW },
    Table { name: "table-5-longitudinal", scene: LONGITUDINAL, case: Case::Front, methods: FEW },
    Table { name: "table-6", scene: ISOTROPIC, case: Case::Irradiance, methods: DIFFUSE },
    Table { name: "table-7-latitudinal", scene: LATITUDINAL, case: Case::Irradiance, methods: DIFFUSE },
    Table { name: "table-7-longitudinal", scene: LONGITUDINAL, case: Case::Irradiance, methods: DIFFUSE },
    Table { name: "table-8-and-10", scene: ISOTROPIC, case: Case::Mirror, methods: DRAWN },
    Table { name: "table-9-latitudinal", scene: LATITUDINAL, case: Case::Mirror, methods: DIFFUSE },
    Table { name: "table-9-longitudinal", scene: LONGITUDINAL, case: Case::Mirror, methods: DIFFUSE },
];

/// Deviations of the slopes, row by row; table 3 has one more.
const DEVIATIONS: [f64; 4] = [0.1, 0.25, 0.5, 1.0];

/// Deviation of the scenes' slopes, displaced at scale 1.
const DEVIATION: f64 = 0.25;

/// Rays a pixel under a light; four times as many in an environment, whose directions are drawn, and more in
/// small pictures.
const RAYS: usize = 64;

/// What lights the spheres from everywhere.
const ENVIRONMENT: &str = "studio";

/// The lobe of the mirrors: three degrees, next to the roughness nothing.
const MIRROR: &str = "beckmann:0.07";

struct Plan {
    size: Size,
    staging: SceneOptions,
}

fn scene_of(plan: &Plan, table: &Table, deviation: f64) -> Result<Scene, Box<dyn std::error::Error>> {
    let row = scene::find(table.scene).ok_or("no such scene")?;
    let mut scene = (row.build)(&plan.staging);
    if table.case == Case::Mirror {
        scene.set_brdf(&*MIRROR.parse::<AnyLobe>()?);
        scene.materials[0].params.diffuse = DVec3::ZERO;
        scene.materials[0].params.specular = DVec3::ONE;
    } else {
        scene.set_brdf(&Lambert::SHARP);
    }
    if table.case != Case::Front {
        scene.lights.clear();
        let built = builtin::find(ENVIRONMENT).ok_or("no such environment")?.build();
        scene.environment = Some(SceneEnvironment::new(built));
    }
    scene.displace(deviation / DEVIATION, false)?;
    Ok(scene)
}

/// The normal map, the displacement, and LEADR by each method.
fn pictures(
    plan: &Plan,
    scene: &Scene,
    methods: &[&str],
) -> Result<Vec<Picture>, Box<dyn std::error::Error>> {
    let small = (100 * 100 / plan.size.area()).max(1);
    let rays = if scene.environment.is_some() { 4 * RAYS * small } else { RAYS };
    let effort = Effort { rays, noise: 0.0, seed: 0 };
    let flat = Geometry::new(scene);
    let normal_map = Truth::new(scene, &flat).render(&scene.camera, plan.size, &effort, &|_| ())?.picture;
    let (plain, displacement) = (Geometry::without_displacement(scene), DisplacedMeshes::new(scene));
    let truth =
        Truth::displaced(scene, &plain, &displacement).render(&scene.camera, plan.size, &effort, &|_| ())?;
    println!("truth: {rays} rays a pixel, noise {:.4}", truth.noise);
    let mut all = vec![normal_map, truth.picture];
    let geometry = Geometry::displaced(scene, &scene.camera, plan.size);
    for spelling in methods {
        let method = spelling.parse::<AnyMethod>()?;
        let maps = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ())?;
        let filtered = Filtered { scene, geometry: &geometry, maps: &maps };
        let lookups = Lookups::taps(Filtering::fine(16));
        all.push(filtered.render(&scene.camera, plan.size, lookups, &Unobserved)?);
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
    let staging = SceneOptions { map_size: Size::new(map, map)?, ..SceneOptions::default() };
    let plan = Plan { size: Size::new(side, side)?, staging };
    let wanted = arguments.get(3).map_or("", |name| name);
    for table in TABLES.iter().filter(|table| table.name.starts_with(wanted)) {
        let mut rows = Vec::new();
        for deviation in &DEVIATIONS[..if table.name == "table-3" { 4 } else { 3 }] {
            let all = pictures(&plan, &scene_of(&plan, table, *deviation)?, table.methods)?;
            let names =
                || ["normal map"].iter().chain(table.methods).zip(all.iter().take(1).chain(&all[2..]));
            let errors = |from: &Picture| {
                let of =
                    |(name, picture): (&&str, &Picture)| format!("{name} {:.4}", relative_l2(picture, from));
                names().map(of).collect::<Vec<_>>().join(", ")
            };
            println!("{}, deviation {deviation}: {}", table.name, errors(&all[1]));
            if let Some(most) = all[2..].last() {
                println!("    against the most slopes: {}", errors(most));
            }
            rows.push(all);
        }
        write_picture(&folder.join(format!("{}.png", table.name)), &sheet(&rows), 1.0)?;
    }
    Ok(())
}
