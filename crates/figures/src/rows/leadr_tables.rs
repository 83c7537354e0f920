//! Dupuy et al., supplemental, tables 3 to 10: spheres of Gaussian noise.
//!
//! Diffuse under a light from the front (3 to 5), diffuse in an environment (6 and 7), mirrors in an
//! environment (8 to 10). Rows are roughnesses; from left to right the normal map and the displacement by
//! brute force, and LEADR with more and more slopes.

use glam::DVec3;
use ndfmap::Error;
use ndfmap::core::brdf::Lambert;
use ndfmap::core::grid::Size;
use ndfmap::core::light::environment::{SceneEnvironment, builtin};
use ndfmap::core::lookup::Lookups;
use ndfmap::draw::{Panel, Sheet, SheetRow};
use ndfmap::scene::metrics::{Picture, relative_l2};
use ndfmap::scene::{MaterialMap, Scene, SceneOptions};
use ndfmap::trace::Geometry;
use ndfmap::trace::truth::Truth;

use super::texels::lobe;
use crate::shot::{Maps, Shot, shown};
use crate::{Claim, Drawing, Figure, Paper, Plan};

/// Light and facets of a table.
#[derive(Clone, Copy, PartialEq)]
enum Case {
    /// Diffuse facets, one light from the front.
    Front,
    /// Diffuse facets in an environment.
    Irradiance,
    /// Mirrors in an environment.
    Mirror,
}

/// Table of the paper.
struct Table {
    scenes: &'static [&'static str],
    case: Case,
    methods: &'static [&'static str],
    deviations: &'static [f64],
    why: &'static str,
}

const ISOTROPIC: &[&str] = &["noise-sphere"];
const SCRATCHED: &[&str] = &["noise-sphere-latitudinal", "noise-sphere-longitudinal"];
const FEW: &[&str] = &["slopes", "slopes:9", "slopes:32"];
const MANY: &[&str] = &["slopes", "slopes:9", "slopes:32", "slopes:128"];
const THREE: &[f64] = &[0.1, 0.25, 0.5];

const DIFFUSE: &str = "The paper prints pictures alone, and says which numbers of slopes are enough; the bounds \
                       are ours.";
const IRRADIANCE: &str = "The paper prints pictures alone, and says which numbers of slopes are enough; the bounds \
                          are ours. Irradiance is nine coefficients here as there.";
const MIRRORS: &str = "The paper prints pictures alone, and says that rough mirrors ask for many slopes. Few slopes \
                       take wider parts of the cube map than their share, by the paper's own offsets.";

const fn row(
    name: &'static str,
    place: &'static str,
    summary: &'static str,
    draw: fn(&Plan<'_>) -> Result<Drawing, Error>,
) -> Figure {
    Figure { name, paper: Paper::Leadr, place, summary, draw }
}

pub(crate) const TABLE_3: Figure = row(
    "leadr-3",
    "Table 3",
    "diffuse spheres lit from the front, as a normal map and displaced",
    |plan| {
        draw(
            plan,
            &Table {
                scenes: ISOTROPIC,
                case: Case::Front,
                methods: &[],
                deviations: &[0.1, 0.25, 0.5, 1.0],
                why: "The paper prints pictures alone, and says that the two part as roughness grows beyond 0.25.",
            },
        )
    },
);

pub(crate) const TABLE_4: Figure =
    row("leadr-4", "Table 4", "diffuse spheres lit from the front, by LEADR", |plan| {
        draw(
            plan,
            &Table { scenes: ISOTROPIC, case: Case::Front, methods: FEW, deviations: THREE, why: DIFFUSE },
        )
    });

pub(crate) const TABLE_5: Figure =
    row("leadr-5", "Table 5", "scratched diffuse spheres lit from the front, by LEADR", |plan| {
        draw(
            plan,
            &Table { scenes: SCRATCHED, case: Case::Front, methods: FEW, deviations: THREE, why: DIFFUSE },
        )
    });

pub(crate) const TABLE_6: Figure =
    row("leadr-6", "Table 6", "diffuse spheres in an environment, by LEADR", |plan| {
        draw(
            plan,
            &Table {
                scenes: ISOTROPIC,
                case: Case::Irradiance,
                methods: MANY,
                deviations: THREE,
                why: IRRADIANCE,
            },
        )
    });

pub(crate) const TABLE_7: Figure =
    row("leadr-7", "Table 7", "scratched diffuse spheres in an environment, by LEADR", |plan| {
        draw(
            plan,
            &Table {
                scenes: SCRATCHED,
                case: Case::Irradiance,
                methods: MANY,
                deviations: THREE,
                why: IRRADIANCE,
            },
        )
    });

pub(crate) const TABLE_8: Figure = row("leadr-8", "Table 8", "mirrors in an environment, by LEADR", |plan| {
    draw(
        plan,
        &Table { scenes: ISOTROPIC, case: Case::Mirror, methods: MANY, deviations: THREE, why: MIRRORS },
    )
});

pub(crate) const TABLE_9: Figure =
    row("leadr-9", "Table 9", "scratched mirrors in an environment, by LEADR", |plan| {
        draw(
            plan,
            &Table { scenes: SCRATCHED, case: Case::Mirror, methods: MANY, deviations: THREE, why: MIRRORS },
        )
    });

pub(crate) const TABLE_10: Figure =
    row("leadr-10", "Table 10", "mirrors by more and more slopes, in a grid and drawn at random", |plan| {
        let methods = &[
            "slopes",
            "slopes:5:drawn",
            "slopes:9",
            "slopes:9:drawn",
            "slopes:32",
            "slopes:32:drawn",
            "slopes:128",
        ];
        draw(plan, &Table { scenes: ISOTROPIC, case: Case::Mirror, methods, deviations: THREE, why: MIRRORS })
    });

/// Numbers of one sphere that statements about several are made of.
struct Sphere {
    /// Deviation and grain, in words.
    place: String,
    /// Relative L2 of the normal map against the displacement.
    normal_map: f64,
    /// Relative L2 of 9 × 9 slopes against the most, where both are there.
    unconverged: Option<f64>,
}

/// Deviation of the scenes' slopes, displaced at scale 1.
const DEVIATION: f64 = 0.25;

/// Light from everywhere.
const ENVIRONMENT: &str = "studio";

/// Lobe of the mirrors: three degrees, next to the roughness nothing.
const MIRROR: &str = "beckmann:0.07";

impl Table {
    /// Sphere of a roughness; `noise` is its map, made at the first one.
    fn scene(
        &self,
        name: &str,
        size: Size,
        deviation: f64,
        noise: &mut Option<MaterialMap>,
    ) -> Result<Scene, Error> {
        let staging = SceneOptions { map_size: size, map: noise.clone(), ..SceneOptions::default() };
        let row = ndfmap::scene::find(name).ok_or_else(|| Error::Request(format!("{name} is no scene")))?;
        let mut scene = (row.build)(&staging);
        *noise = Some(scene.materials[0].map.clone());
        if self.case == Case::Mirror {
            scene.set_brdf(&*lobe(MIRROR));
            scene.materials[0].params.diffuse = DVec3::ZERO;
            scene.materials[0].params.specular = DVec3::ONE;
        } else {
            scene.set_brdf(&Lambert::SHARP);
        }
        if self.case != Case::Front {
            scene.lights.clear();
            let row = builtin::find(ENVIRONMENT);
            let built = row.ok_or_else(|| Error::Request(format!("{ENVIRONMENT} is not built in")))?.build();
            scene.environment = Some(SceneEnvironment::new(built));
        }
        scene.displace(deviation / DEVIATION, false).map_err(|e| Error::Failed(e.to_string()))?;
        Ok(scene)
    }
}

fn draw(plan: &Plan<'_>, table: &Table) -> Result<Drawing, Error> {
    // A wave of the noise is half a pixel, and a fifth where mirrors are seen.
    let (side, texels, rays) = match table.case {
        Case::Front => (64, 2048, 64),
        Case::Irradiance => (48, 2048, 256),
        Case::Mirror => (24, 2048, 2048),
    };
    let side = if plan.quick { side / 2 } else { side };
    let (size, map) = (Size { width: side, height: side }, plan.map(texels));
    // The most slopes take minutes.
    let methods: Vec<&str> =
        table.methods.iter().copied().filter(|name| !plan.quick || *name != "slopes:128").collect();
    let (mut rows, mut claims) = (Vec::new(), Vec::new());
    for name in table.scenes {
        let mut spheres = Vec::new();
        let grain = name.trim_start_matches("noise-sphere").trim_start_matches('-');
        let mut noise = None;
        for deviation in table.deviations {
            plan.observer.begin("noise");
            let scene = table.scene(name, map, *deviation, &mut noise)?;
            let effort = plan.effort(rays);
            let shot = Shot { lookups: Lookups::TRILINEAR, ..Shot::new(plan, &scene, size) };
            plan.observer.begin("normal map by brute force");
            let flat = Geometry::new(&scene);
            let normal_map =
                Truth::new(&scene, &flat).render(&scene.camera, size, &effort, plan.observer)?.picture;
            let truth = shot.truth(&effort)?;
            let maps = Maps::bake(plan, &scene, &methods)?;
            let pictures = shot.filtered(&maps)?;
            let error = |p: &Picture| relative_l2(p, &truth.picture);
            let panel = |p: &Picture| Panel::of(shown(p, scene.exposure));
            let said = |p: &Picture| [format!("L2 {:.3}", error(p))];
            let noise = [format!("noise {:.3}", truth.noise)];
            let mut panels = vec![
                Some(panel(&normal_map).said(said(&normal_map))),
                Some(panel(&truth.picture).said(noise)),
            ];
            panels.extend(pictures.iter().map(|p| Some(panel(p).said(said(p)))));
            let head = [format!("deviation {deviation}"), grain.to_owned()];
            rows.push(SheetRow { head: head.into_iter().filter(|h| !h.is_empty()).collect(), panels });
            let place =
                if grain.is_empty() { format!("{deviation}") } else { format!("{deviation}, {grain}") };
            claims.push(Claim::number(
                format!("{place}: L2 of the normal map against the displacement"),
                error(&normal_map),
            ));
            claims.push(Claim::number(format!("{place}: noise of the displacement's picture"), truth.noise));
            claims.extend(table.judged(&place, (&maps, &pictures, &truth.picture)));
            let nine = maps.names().position(|n| n == "slopes:9");
            spheres.push(Sphere {
                place,
                normal_map: error(&normal_map),
                unconverged: nine.zip(pictures.last()).map(|(at, most)| relative_l2(&pictures[at], most)),
            });
        }
        claims.extend(table.overall(&spheres));
    }
    let columns = ["normal map", "displacement"].into_iter().chain(methods.iter().copied());
    let columns = columns.map(str::to_owned).collect();
    let title = "Spheres of Gaussian roughness".to_owned();
    Ok(Drawing { sheets: vec![Sheet { title, columns, rows, scale: None }], claims, why: table.why })
}

impl Table {
    /// Statement about the spheres of one grain, smoothest first.
    fn overall(&self, spheres: &[Sphere]) -> Option<Claim> {
        let [smooth, .., _] = spheres else { return None };
        if self.methods.is_empty() {
            let says = format!("{}: normal map and displacement are very similar (below 0.05)", smooth.place);
            return Some(Claim::number(says, smooth.normal_map).holds(smooth.normal_map < 0.05));
        }
        // The paper's roughest.
        let rough = spheres.last().filter(|_| self.case == Case::Mirror)?;
        let ratio = rough.unconverged? / smooth.unconverged?;
        let says = "9 × 9 slopes: L2 against the most slopes, over that at";
        let says = format!("{}: {says} {}, more for rougher", rough.place, smooth.place);
        Some(Claim::number(says, ratio).holds(ratio > 1.0))
    }

    /// Statements of the paper's discussion: which numbers of slopes are enough, and which way of placing
    /// them is better.
    fn judged(&self, place: &str, (maps, pictures, truth): (&Maps, &[Picture], &Picture)) -> Vec<Claim> {
        let of = |name: &str| maps.names().position(|n| n == name).map(|at| &pictures[at]);
        let error = |name: &str| of(name).map(|p| relative_l2(p, truth));
        let from = |name: &str, most: &str| of(name).zip(of(most)).map(|(a, b)| relative_l2(a, b));
        let mut claims = Vec::new();
        if self.case == Case::Mirror {
            let most = maps.names().last().unwrap_or_default();
            for name in ["slopes:9", "slopes:32"] {
                let says = format!("{place}: L2 of {name} against {most}");
                claims.extend(from(name, most).map(|e| Claim::number(says, e)));
            }
        }
        for name in maps.names() {
            claims.extend(error(name).map(|e| Claim::number(format!("{place}: L2 of {name}"), e)));
        }
        let most = maps.names().last().unwrap_or_default();
        if self.case != Case::Mirror && !self.methods.is_empty() {
            for (name, said, bound) in
                [("slopes", "all that matters", 0.02), ("slopes:9", "no difference", 0.005)]
            {
                let says = format!("{place}: L2 of {name} against {most}, {said} (below {bound})");
                claims.extend(from(name, most).map(|e| Claim::number(says, e).holds(e < bound)));
            }
        }
        if self.methods.contains(&"slopes:5:drawn") {
            for (grid, drawn) in [
                ("slopes", "slopes:5:drawn"),
                ("slopes:9", "slopes:9:drawn"),
                ("slopes:32", "slopes:32:drawn"),
            ] {
                if let Some((grid_error, drawn_error)) = error(grid).zip(error(drawn)) {
                    let says = format!("{place}: error of {grid} over that of {drawn}, below 1");
                    let ratio = grid_error / drawn_error;
                    let claim = Claim::number(says, ratio);
                    // The paper speaks of small numbers.
                    claims.push(if grid == "slopes:32" { claim } else { claim.holds(ratio < 1.0) });
                }
            }
        }
        claims
    }
}
