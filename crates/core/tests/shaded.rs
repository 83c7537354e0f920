//! Shaded texels against values from an independent script, `tests/reference/shaded.py` (numpy and scipy), at
//! ten texels and twenty paths: LEADR's displaced surfaces, and mixtures in an environment.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::{DMat2, DMat3, DVec3, Vec3};
use ndfmap_core::brdf::{AnyLobe, Brdf, Directions, Microfacets, ShadingModel, SurfaceParams};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::SplitSum;
use ndfmap_core::light::environment::{Environment, FilteredEnvironment, Technique};
use ndfmap_core::ndf::{AnyMethod, FilteredTexel, IncidentLight, LocalEnvironment};
use ndfmap_core::units::SlopeVariance;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn directions(value: &Value) -> Vec<DVec3> {
    value.as_array().unwrap().iter().map(|d| DVec3::from_slice(&numbers(d))).collect()
}

fn reference() -> Value {
    serde_json::from_str(include_str!("reference/shaded.json")).unwrap()
}

/// A white surface: all of the light is reflected, by facets that mirror or that scatter.
const WHITE: SurfaceParams =
    SurfaceParams { diffuse: DVec3::ONE, specular: DVec3::ONE, roughness: SlopeVariance::ZERO };

#[test]
fn displaced_surfaces_are_those_of_an_independent_program() {
    let expected = reference();
    let (lights, eyes) = (directions(&expected["lights"]), directions(&expected["eyes"]));
    let method = "slopes".parse::<AnyMethod>().unwrap();
    // Measured 3e-11 and 6e-16: the integral of the Gaussian is a polynomial in this program. Specular facets
    // have the artificial normal too, which the printed form has not; here the eye sees nothing of it.
    for (key, lobe, shading, bound) in [
        ("masked", "beckmann:0.2", ShadingModel::Masked, 1e-9),
        ("shadowed", "beckmann:0.2", ShadingModel::Shadowed, 1e-9),
        ("diffuse", "lambert", ShadingModel::Masked, 1e-12),
    ] {
        let brdf = Brdf::new(lobe.parse::<AnyLobe>().unwrap(), shading);
        let prepared = method.prepare(&brdf, SlopeVariance::ZERO);
        let mut largest = 0.0_f64;
        for texel in expected["slopes"].as_array().unwrap() {
            let (mean, second) = (numbers(&texel["mean"]), numbers(&texel["second"]));
            let channels =
                [0.0, mean[0], mean[1], 1.0, second[0], second[1], second[2], 1.0].map(|c| c as f32);
            let texel_of = FilteredTexel {
                channels: &channels,
                params: &|_| WHITE,
                prepared: &prepared,
                at_means: false,
                slope_map: Some(DMat2::from_cols_slice(&numbers(&texel["stretch"]))),
            };
            let values = numbers(&texel[key]);
            let peak = values.iter().copied().fold(1e-3, f64::max);
            for ((wi, wo), value) in lights.iter().zip(&eyes).zip(&values) {
                let light =
                    IncidentLight { directions: Directions::new(*wi, *wo).unwrap(), irradiance: DVec3::ONE };
                let got = method.reflect(&texel_of, &[light]).x;
                largest = largest.max((got - value).abs() / peak);
            }
        }
        println!("{key}: {largest:.1e}");
        assert!(largest < bound, "{key}: {largest}");
    }
}

/// Environment of the script, a polynomial of order 2.
fn sky() -> FilteredEnvironment {
    let size = Size { width: 512, height: 256 };
    let blank = Environment::new(Grid::from_fn(size, |_, _| Vec3::ZERO)).unwrap();
    let sky = Grid::from_fn(size, |x, y| {
        let w = blank.direction(x as f64 + 0.5, y as f64 + 0.5);
        Vec3::splat((1.0 + 0.5 * w.y + 0.3 * w.z + 0.4 * w.x * w.z) as f32)
    });
    FilteredEnvironment::new(&Environment::new(sky).unwrap())
}

#[test]
fn blurred_cubes_are_those_of_an_independent_program() {
    let expected = reference();
    let at: Vec<DVec3> = ["lights", "eyes"].iter().flat_map(|key| directions(&expected[key])).collect();
    let light = sky();
    // A level has 64 to 4 texels on a side of the cube, and is linear between them. Measured, Beckmann and
    // GGX: 3e-4, 2e-3, 6e-3, 9e-3, 0.029 and 1.8e-3, 4e-3, 7e-3, 0.012, 0.032.
    let bounds = [[5e-4, 3e-3, 8e-3, 0.012, 0.035], [2.5e-3, 5e-3, 9e-3, 0.015, 0.038]];
    for blur in expected["blurs"].as_array().unwrap() {
        let ggx = blur["facets"] == "ggx";
        let cube = light.prefiltered(if ggx { Microfacets::Ggx } else { Microfacets::Beckmann });
        assert_eq!(cube.levels(), 6);
        let level = (5.0 * blur["roughness"].as_f64().unwrap()).round();
        let off = |(w, radiance): (&DVec3, f64)| cube.lookup(*w, level).x / radiance - 1.0;
        let off: Vec<f64> = at.iter().zip(numbers(&blur["radiance"])).map(off).collect();
        let largest = off.iter().fold(0.0_f64, |most, off| most.max(off.abs()));
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        println!("{} {level}: {largest:.1e}, mean {mean:.1e}", blur["facets"]);
        assert!(largest < bounds[usize::from(ggx)][level as usize - 1], "{blur}: {largest}");
        // Coarse texels err both ways: half a percent is left of the widest.
        assert!(mean.abs() < 0.007, "{blur}: {mean}");
    }
}

#[test]
fn mixtures_in_an_environment_are_those_of_an_independent_program() {
    let expected = reference();
    let (eyes, views) = (directions(&expected["eyes"]), directions(&expected["views"]));
    let light = sky();
    let method = "vmf:3".parse::<AnyMethod>().unwrap();
    let shine = SurfaceParams { diffuse: DVec3::ZERO, ..WHITE };
    // Sums over texels of 0.7 degrees in floats, and of 2.8 degrees; at views between those of the table,
    // 22.5 degrees apart, it is interpolated. Measured 4e-6, 4e-4 and 0.03.
    for (key, eyes, technique, bound) in [
        ("irradiance", &eyes, Technique::Prefiltered, 1e-5),
        ("equation_26_at_views", &views, Technique::Harmonics, 1e-3),
        ("equation_26", &eyes, Technique::Harmonics, 0.04),
    ] {
        let (lobe, params) =
            if technique == Technique::Harmonics { ("blinn-phong:20", shine) } else { ("lambert", WHITE) };
        let brdf = Brdf::new(lobe.parse::<AnyLobe>().unwrap(), ShadingModel::Han);
        let (prepared, split_sum) = (method.prepare(&brdf, SlopeVariance::ZERO), SplitSum::new(&brdf));
        let mut largest = 0.0_f64;
        for texel in expected["mixtures"].as_array().unwrap() {
            let channels: Vec<f32> = numbers(&texel["channels"]).iter().map(|c| *c as f32).collect();
            let texel_of = FilteredTexel {
                channels: &channels,
                params: &|_| params,
                prepared: &prepared,
                at_means: technique == Technique::Harmonics,
                slope_map: None,
            };
            let all = &texel[key];
            let value = |at: usize| all.as_f64().unwrap_or_else(|| numbers(all)[at]);
            let peak = (0..eyes.len()).map(value).fold(0.0, f64::max);
            for (at, wo) in eyes.iter().enumerate() {
                let local = LocalEnvironment {
                    light: &light,
                    technique,
                    to_environment: DMat3::IDENTITY,
                    wo: *wo,
                    split_sum: &split_sum,
                };
                let got = method.reflect_environment(&texel_of, &local).x;
                largest = largest.max((got - value(at)).abs() / peak);
            }
        }
        println!("{key}: {largest:.1e}");
        assert!(largest < bound, "{key}: {largest}");
    }
}
