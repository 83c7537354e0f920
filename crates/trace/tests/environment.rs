//! Light from everywhere, where the answer is known: white skies, skies of one direction, and integrals
//! worked out apart.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use common::{SQUARE, filtered, map, plate, truth};
use glam::{DVec3, Vec3};
use ndfmap_core::brdf;
use ndfmap_core::brdf::{AnyLobe, Brdf, Directions, ShadingModel, SurfaceParams};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::Light;
use ndfmap_core::light::environment::{Environment, SceneEnvironment, Technique, builtin};
use ndfmap_core::lookup::Lookups;
use ndfmap_core::surface::{NormalGrid, Surface, SurfaceRow, Wraps};
use ndfmap_scene::Scene;
use ndfmap_scene::metrics::{Picture, relative_l2};

fn flat() -> Arc<dyn Surface> {
    Arc::new(NormalGrid { normals: Grid::from_fn(SQUARE, |_, _| Vec3::Z), wraps: Wraps::default() })
}

/// The scene in an environment, and no other light.
fn inside(mut scene: Scene, environment: Environment, technique: Technique) -> Scene {
    scene.lights.clear();
    scene.environment = Some(SceneEnvironment { technique, ..SceneEnvironment::new(environment) });
    scene
}

/// `∫ L(wi) facet(n, wi, wo) dwi` for an eye straight above, by Gauss-free brute force: a lattice over
/// half-vectors, which are where facets are narrow, and one over directions for the diffuse part.
fn integral(scene: &Scene, n: DVec3, sky: &dyn Fn(DVec3) -> DVec3) -> DVec3 {
    integral_of(scene, n, sky, Brdf::facet)
}

/// Light of one normal, by the lobe or by the material itself.
type Facet = fn(&Brdf, DVec3, &SurfaceParams, &Directions) -> DVec3;

/// That integral by this facet.
fn integral_of(scene: &Scene, n: DVec3, sky: &dyn Fn(DVec3) -> DVec3, facet: Facet) -> DVec3 {
    let material = &scene.materials[0];
    let brdf = &material.brdf;
    let lattice = |count: usize, f: &dyn Fn(f64, f64) -> DVec3| {
        let mut sum = DVec3::ZERO;
        for i in 0..count {
            for j in 0..count {
                sum += f((i as f64 + 0.5) / count as f64, (j as f64 + 0.5) / count as f64);
            }
        }
        sum / (count * count) as f64
    };
    let (x, y) = ndfmap_core::sphere::frame(n);
    let around = |z: f64, phi: f64| {
        let r = (1.0 - z * z).max(0.0).sqrt();
        x * (r * phi.cos()) + y * (r * phi.sin()) + n * z
    };
    // Half-vectors at tan² = a t/(1 - t): the quantiles of a GGX lobe, dense where the lobe is.
    let a = 2.0 * brdf.width(material.params.roughness).get();
    let specular = lattice(400, &|s, t| {
        let tan2 = a * s / (1.0 - s);
        let z = 1.0 / (1.0 + tan2).sqrt();
        let wh = around(z, TAU * t);
        let u = wh.dot(DVec3::Z);
        if u <= 0.0 {
            return DVec3::ZERO;
        }
        let Some(directions) = Directions::between(2.0 * u * wh - DVec3::Z, DVec3::Z) else {
            return DVec3::ZERO;
        };
        let density = a / (PI * z.powi(4) * (a + tan2).powi(2)) * z;
        let plain = SurfaceParams { diffuse: DVec3::ZERO, ..material.params };
        sky(directions.wi) * facet(brdf, n, &plain, &directions) * (4.0 * u / density)
    });
    let diffuse = lattice(400, &|s, t| {
        let wi = around(s, TAU * t);
        let Some(directions) = Directions::between(wi, DVec3::Z) else { return DVec3::ZERO };
        let fresnel = brdf.shading.fresnel(material.params.specular, directions.u);
        let share = if brdf.is_specular() { brdf.shading.diffuse_share(fresnel) } else { DVec3::ONE };
        sky(wi) * share * material.params.diffuse * (2.0 * s)
    });
    if brdf.is_specular() { specular + diffuse } else { diffuse }
}

fn mean(picture: &Picture) -> DVec3 {
    picture.texels().iter().map(|p| p.as_dvec3()).sum::<DVec3>() / picture.texels().len() as f64
}

#[test]
fn every_lobe_is_right_in_a_furnace() {
    for spelling in brdf::TABLE.iter().flat_map(|row| row.samples) {
        for shading in [ShadingModel::Han, ShadingModel::Smith, ShadingModel::Masked, ShadingModel::Shadowed]
        {
            if spelling.parse::<AnyLobe>().unwrap().measured().is_some() && shading != ShadingModel::Han {
                // A measured lobe has its own masking in it.
                continue;
            }
            let white = builtin::find("white").unwrap().build();
            let mut scene = inside(plate(flat(), "lambert", shading, 1e6), white, Technique::Prefiltered);
            scene.set_brdf(&*spelling.parse::<AnyLobe>().unwrap());
            scene.set_shading(shading);
            let expected = integral(&scene, DVec3::Z, &|_| DVec3::ONE);
            // A measured material is not quite its factors.
            let itself = integral_of(&scene, DVec3::Z, &|_| DVec3::ONE, Brdf::true_facet);
            let true_picture = truth(&scene, SQUARE, 512, 3);
            let apart = (mean(&true_picture.picture) - itself).length() / itself.length();
            // Sixteen pixels: a quarter of a pixel's noise, thrice; and what single floats leave.
            assert!(
                apart < 0.75 * true_picture.noise + 1e-4,
                "truth of {spelling} {shading:?}: {apart}, noise {}",
                true_picture.noise
            );
            for technique in Technique::ALL {
                scene.environment.as_mut().unwrap().technique = technique;
                for method in ["fixed", "toksvig", "vmf:2", "gmm:2", "sh:7", "slopes:32"] {
                    let got = mean(&filtered(&scene, method, SQUARE, Lookups::TRILINEAR));
                    let apart = (got - expected).length() / expected.length();
                    // A table of 16 × 16, and of harmonics what order 8 leaves of a half-space of
                    // half-vectors: 1 %. Slopes are a grid to three deviations, which holds all but 1 % of a
                    // Gaussian; of a wide lobe that is none, the factor `4 u c` differs between where the
                    // grid is and where the lobe is.
                    let bound = match (method, spelling.split(':').next()) {
                        ("slopes:32", Some("beckmann" | "lambert"))
                        | ("fixed" | "toksvig" | "vmf:2" | "gmm:2" | "sh:7", _) => 0.012,
                        _ => 0.08,
                    };
                    assert!(
                        apart < bound,
                        "{method} with {spelling} {shading:?} {}: {apart}",
                        technique.name()
                    );
                }
            }
        }
    }
}

#[test]
fn one_direction_is_a_directional_light() {
    let size = Size { width: 512, height: 256 };
    let irradiance = DVec3::new(3.0, 2.5, 2.0);
    let blank = Environment::new(Grid::from_fn(size, |_, _| Vec3::ZERO)).unwrap();
    let towards = DVec3::new(0.4, 0.3, 0.85).normalize();
    let (x, y) = blank.texel(towards);
    let mut picture = blank.picture().clone();
    picture.row_mut(y)[x] = (irradiance / blank.solid_angle(y)).as_vec3();
    let one = Environment::new(picture).unwrap();
    let towards = one.direction(x as f64 + 0.5, y as f64 + 0.5);
    for (lobe, shading) in [
        ("ggx:0.3", ShadingModel::Smith),
        ("blinn-phong:30", ShadingModel::Han),
        ("lambert", ShadingModel::Han),
    ] {
        let mut lit = plate(map("foil", 32), lobe, shading, 4.0);
        lit.lights = vec![Light::Directional { towards, irradiance }];
        let sky = inside(plate(map("foil", 32), lobe, shading, 4.0), one.clone(), Technique::Prefiltered);
        for method in ["vmf:4", "slopes", "toksvig"] {
            let by = |scene| filtered(scene, method, Size { width: 24, height: 24 }, Lookups::TRILINEAR);
            // All but 50 times the mean, 50/131072 of it, shines as a light; a light sees facets from above
            // the base surface only.
            let apart = relative_l2(&by(&sky), &by(&lit));
            assert!(apart < 0.005, "{method} {lobe}: {apart}");
        }
        let size = Size { width: 8, height: 8 };
        let (a, b) = (truth(&sky, size, 2048, 1), truth(&lit, size, 2048, 2));
        let apart = relative_l2(&a.picture, &b.picture);
        // A texel is 0.7 degrees wide, a light is not: of lobes 12 degrees and more wide nothing.
        assert!(
            apart < 1.5 * a.noise.hypot(b.noise) + 0.002,
            "truth {lobe}: {apart}, noise {} {}",
            a.noise,
            b.noise
        );
    }
}

#[test]
fn truth_is_the_integral() {
    // One pixel that sees a whole map, under a sky with lamps: the mean over texels of the integral over the
    // sky.
    let surface = map("foil", 8);
    let studio = builtin::find("studio").unwrap().build();
    for (lobe, shading) in [
        ("ggx:0.25", ShadingModel::Smith),
        ("blinn-phong:40", ShadingModel::Han),
        ("lambert", ShadingModel::Han),
    ] {
        let scene =
            inside(plate(Arc::clone(&surface), lobe, shading, 1e6), studio.clone(), Technique::Prefiltered);
        let (mut row, mut expected) = (SurfaceRow::flat(8), DVec3::ZERO);
        for y in 0..8 {
            surface.read_row(y, &mut row);
            for x in 0..8 {
                expected += integral(&scene, row.normal(x).as_dvec3(), &|w| studio.radiance(w)) / 64.0;
            }
        }
        let true_picture = truth(&scene, Size { width: 1, height: 1 }, 1 << 17, 5);
        let got = mean(&true_picture.picture);
        let apart = (got - expected).length() / expected.length();
        // Four deviations of the noise, itself known from one difference only, and the lattice's own at the
        // lamps' edges.
        assert!(
            apart < 4.0 * true_picture.noise + 0.004,
            "{lobe}: {got} {expected}, noise {}",
            true_picture.noise
        );
    }
}

#[test]
fn nothing_rings_black_or_burns_out_beside_a_sun() {
    // A sun 100 000 times the mean: every pixel of a lit plate has light, by either technique, as the truth
    // has.
    for technique in Technique::ALL {
        let sky = builtin::find("sky").unwrap().build();
        let scene = inside(plate(map("foil", 32), "ggx:0.3", ShadingModel::Smith, 4.0), sky, technique);
        for method in ["fixed", "vmf:4", "sh:7", "slopes", "gmm:4"] {
            let picture = filtered(&scene, method, Size { width: 32, height: 32 }, Lookups::TRILINEAR);
            for pixel in picture.texels() {
                assert!(
                    pixel.is_finite() && pixel.min_element() > 0.0,
                    "{method} {}: {pixel}",
                    technique.name()
                );
            }
        }
    }
}
