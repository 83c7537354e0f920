//! Against values from an independent implementation: `tests/reference/generate.py` (numpy and scipy).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::{DVec3, Vec3};
use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::measure::TexelTruth;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::sphere::{DiskLattice, sh_count, spherical_harmonics};
use ndfmap_core::surface::{NormalGrid, Wraps};
use serde_json::Value;

fn expected() -> Value {
    serde_json::from_str(include_str!("reference/expected.json")).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn direction(value: &Value) -> DVec3 {
    DVec3::from_slice(&numbers(value))
}

#[test]
fn zonal_coefficients() {
    let expected = expected();
    for (spelling, values) in expected["zonal"].as_object().unwrap() {
        let rho = spelling.parse::<AnyLobe>().unwrap().zonal(16);
        for (l, (got, expected)) in rho.iter().zip(numbers(values)).enumerate() {
            // scipy's adaptive rule is asked for 1e-13 and reaches about 1e-11 on the narrow lobes.
            assert!((got - expected).abs() < 1e-10, "{spelling} l = {l}: {got} {expected}");
        }
    }
}

#[test]
fn harmonics() {
    let expected = expected();
    let directions = expected["directions"].as_array().unwrap();
    for (n, values) in directions.iter().zip(expected["harmonics"].as_array().unwrap()) {
        let mut y = vec![0.0; sh_count(16)];
        spherical_harmonics(16, direction(n), &mut y);
        for (i, (got, expected)) in y.iter().zip(numbers(values)).enumerate() {
            // Two recurrences in double precision up to order 16.
            assert!((got - expected).abs() < 1e-12, "index {i}: {got} {expected}");
        }
    }
}

#[test]
fn effective_lobes_of_explicit_normals() {
    let expected = expected();
    let normals: Vec<Vec3> =
        expected["normals"].as_array().unwrap().iter().map(|n| direction(n).as_vec3()).collect();
    let size = Size::new(8, 4).unwrap();
    let surface = NormalGrid { normals: Grid::from_vec(size, normals).unwrap(), wraps: Wraps::default() };
    let lobe = "blinn-phong:50".parse::<AnyLobe>().unwrap();
    let w = [direction(&expected["w"])];
    for (method, value) in expected["blinn-phong:50"].as_object().unwrap() {
        let value = value.as_f64().unwrap();
        let got = if method == "truth" {
            let lattice = DiskLattice { directions: w.to_vec(), rows: vec![(w[0].y, 0..1)] };
            TexelTruth::new(&surface, &*lobe, &lattice).texel(Size { width: 1, height: 1 }, 0, 0)[0]
        } else {
            let method = method.parse::<AnyMethod>().unwrap();
            let bake = Bake::new(&surface, &*method).precision(Precision::Single);
            let (pyramid, _) = bake.to_pyramid().unwrap();
            let last = pyramid.sizes().len() - 1;
            let mut out = [0.0];
            method.evaluator(&*lobe, &w).evaluate(&pyramid.texel(last, 0, 0), &mut out);
            out[0]
        };
        // Sums in single floats: 1e-7 each, magnified by s = 50 in the exponent.
        assert!((got / value - 1.0).abs() < 2e-5, "{method}: {got} {value}");
    }
}
