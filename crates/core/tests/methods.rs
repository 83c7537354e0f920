//! Effective lobes of methods against values from an independent script: `tests/reference/methods.py` (numpy
//! and scipy), at ten texels and twenty directions.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::DVec3;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::ndf::AnyMethod;
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Error of a lobe that a method may have, as a part of the lobe's largest value at the texel.
fn bound(method: &str, lobe: &str) -> f64 {
    match (method, lobe) {
        // Our closed form of the widened cosine (`brdf/lambert.rs`) is an approximation, worse the wider: of
        // these peaks one is as wide as an exponent of 8.
        ("phong:3", "lambert") => 2e-3,
        ("vmf:3" | "vmf:3:series" | "gmm:3", "lambert") => 4e-4,
        // Measured at most 8e-10: powers, for which this program has a polynomial.
        _ => 1e-9,
    }
}

#[test]
fn effective_lobes_are_those_of_an_independent_program() {
    let expected: Value = serde_json::from_str(include_str!("reference/methods.json")).unwrap();
    let directions: Vec<DVec3> =
        expected["directions"].as_array().unwrap().iter().map(|d| DVec3::from_slice(&numbers(d))).collect();
    for (spelling, texels) in expected["methods"].as_object().unwrap() {
        let method = spelling.parse::<AnyMethod>().unwrap();
        assert_eq!(texels.as_array().unwrap().len(), 10);
        for lobe_name in ["blinn-phong:50", "blinn-phong:400", "lambert"] {
            let lobe = lobe_name.parse::<AnyLobe>().unwrap();
            let mut largest = 0.0_f64;
            for texel in texels.as_array().unwrap() {
                let Some(values) = texel["lobes"].get(lobe_name) else { continue };
                let mut channels: Vec<f32> = numbers(&texel["channels"]).iter().map(|c| *c as f32).collect();
                channels.resize(4 * method.layers(), 1.0);
                let mut got = vec![0.0; directions.len()];
                method.evaluator(&*lobe, &directions).evaluate(&channels, &mut got);
                let values = numbers(values);
                let peak = values.iter().copied().fold(1e-3, f64::max);
                for (got, value) in got.iter().zip(&values) {
                    largest = largest.max((got - value).abs() / peak);
                }
            }
            println!("{spelling} {lobe_name}: {largest:.1e}");
            assert!(largest < bound(spelling, lobe_name), "{spelling} {lobe_name}: {largest}");
        }
    }
}
