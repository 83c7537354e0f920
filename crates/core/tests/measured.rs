//! Measured materials against values from an independent script: `tests/reference/measured.py` (numpy).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::DVec3;
use ndfmap_core::brdf::measured::materials;
use ndfmap_core::brdf::{Brdf, Directions, Measured, PublishedFit, ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;
use serde_json::Value;

fn expected() -> Value {
    serde_json::from_str(include_str!("reference/measured.json")).unwrap()
}

fn vectors(value: &Value) -> Vec<DVec3> {
    let one = |v: &Value| DVec3::from([0, 1, 2].map(|c| v[c].as_f64().unwrap()));
    value.as_array().unwrap().iter().map(one).collect()
}

#[test]
fn materials_reflect_as_was_published() {
    let expected = expected();
    let (wi, wo) = (vectors(&expected["wi"]), vectors(&expected["wo"]));
    for fit in PublishedFit::ALL {
        for (name, values) in expected[fit.name()].as_object().unwrap() {
            let material = Measured::published(fit, name).unwrap();
            for ((wi, wo), value) in wi.iter().zip(&wo).zip(vectors(values)) {
                let got = material.reflectance(*wi, *wo);
                assert!((got - value).length() < 1e-9 * value.length(), "{fit}:{name}: {got} {value}");
            }
        }
    }
}

#[test]
fn a_true_facet_is_the_material_and_a_facet_its_factors() {
    let expected = expected();
    let material = Measured::published(PublishedFit::Sgd, "gold-metallic-paint").unwrap();
    let params = SurfaceParams {
        diffuse: material.factors().diffuse,
        specular: DVec3::ONE,
        roughness: SlopeVariance::ZERO,
    };
    let brdf = Brdf::new(material, ShadingModel::Han);
    // A normal that leans, with light and eye turned as it is: Han et al.'s model is M times the cosine.
    let lean = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.5);
    let pairs = vectors(&expected["wi"]).into_iter().zip(vectors(&expected["wo"]));
    for ((wi, wo), value) in pairs.zip(vectors(&expected["sgd"]["gold-metallic-paint"])) {
        let directions = Directions::between(lean * wi, lean * wo).unwrap();
        let n = lean * DVec3::Z;
        let truth = brdf.true_facet(n, &params, &directions);
        assert!((truth - value * wi.z).length() < 1e-9 * value.length(), "{truth} {}", value * wi.z);
        // Pairs of directions in the tail may be further off than the whole: 0.32 is among those measured.
        let by_factors = brdf.facet(n, &params, &directions);
        let off = (by_factors - truth).length() / truth.length();
        assert!(off > 0.0 && off < 0.35, "{off}");
    }
}

#[test]
fn factors_are_the_least_squares_of_an_independent_program() {
    for (name, least) in expected()["residual"].as_object().unwrap() {
        let material = Measured::published(PublishedFit::Sgd, name).unwrap();
        let (got, least) = (material.factors().residual.factored, least.as_f64().unwrap());
        // The script ends after 4000 turns; both are the same to four digits.
        assert!((got / least - 1.0).abs() < 1e-3, "{name}: {got} {least}");
    }
}

#[test]
fn every_published_material_is_factored() {
    let mut residuals: Vec<[f64; 2]> = Vec::new();
    for name in materials() {
        let residual = Measured::published(PublishedFit::Sgd, name).unwrap().factors().residual;
        residuals.push([residual.factored, residual.fitted]);
    }
    assert_eq!(residuals.len(), 100);
    for (which, median, worst) in [(0, 0.0265, 0.109), (1, 0.0390, 0.188)] {
        let mut all: Vec<f64> = residuals.iter().map(|r| r[which]).collect();
        all.sort_by(f64::total_cmp);
        // As measured, rounded up: the tables' worst is black-obsidian, the lobes' is steel, whose
        // f a sum of kernels holds to a tenth.
        assert!(all[49] < 1.01 * median && all[99] < 1.01 * worst, "{} {}", all[49], all[99]);
    }
}
