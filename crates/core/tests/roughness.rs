//! Roughness mips against values from an independent script, `tests/reference/roughness.py`, and on surfaces
//! whose answer is known.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::{DVec3, Vec3};
use ndfmap_core::brdf::{AnyLobe, Brdf, Directions, ShadingModel, SurfaceParams};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::observe::Unobserved;
use ndfmap_core::roughness::{EngineMaterial, Objective, RoughSurface, TABLE, Widening, find};
use ndfmap_core::surface::{Surface, SurfaceRow, Wraps};
use ndfmap_core::units::SlopeVariance;
use serde_json::Value;

/// Surface of given normals.
struct Normals(Grid<Vec3>);

impl Surface for Normals {
    fn size(&self) -> Size {
        self.0.size()
    }

    fn wraps(&self) -> Wraps {
        Wraps::default()
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        self.0.row(y).iter().enumerate().for_each(|(i, n)| row.set_normal(i, *n));
        row.spread.clear();
    }
}

fn numbers(value: &Value) -> Vec<f32> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap() as f32).collect()
}

const EIGHT: Size = Size { width: 8, height: 8 };

fn surface(normals: &[f32], roughness: &[f32]) -> RoughSurface {
    let normals = normals.chunks(3).map(Vec3::from_slice).collect();
    let roughness = Grid::from_vec(EIGHT, roughness.to_vec()).unwrap();
    RoughSurface::new(&Normals(Grid::from_vec(EIGHT, normals).unwrap()), &roughness).unwrap()
}

fn coarsest(surface: &RoughSurface, widening: Widening) -> f64 {
    let levels = surface.bake(widening, &Unobserved).unwrap();
    f64::from(levels.last().unwrap().row(0)[0])
}

#[test]
fn rules_and_fits_are_those_of_an_independent_program() {
    let maps: Value = serde_json::from_str(include_str!("reference/roughness.json")).unwrap();
    let (mut of_rules, mut of_fits) = (0.0_f64, 0.0_f64);
    for map in maps.as_array().unwrap() {
        let surface = surface(&numbers(&map["normals"]), &numbers(&map["roughness"]));
        for (name, expected) in map["rules"].as_object().unwrap() {
            let got = coarsest(&surface, Widening::Rule(find(name).unwrap()));
            of_rules = of_rules.max((got / expected.as_f64().unwrap() - 1.0).abs());
        }
        for (power, expected) in map["fit"].as_object().unwrap() {
            let objective = Objective { power: power.parse().unwrap() };
            let got = coarsest(&surface, Widening::Fit(objective));
            let off = got / expected.as_f64().unwrap() - 1.0;
            println!("power {power}: {got:.4}, expected {expected} ({:+.1} %)", 100.0 * off);
            of_fits = of_fits.max(off.abs());
        }
    }
    println!("rules {of_rules:.1e}, fits {of_fits:.1e}");
    // Sums in single floats; and forty rings, with widths and angles in steps.
    assert!(of_rules < 1e-5 && of_fits < 0.02, "{of_rules} {of_fits}");
}

#[test]
fn one_normal_keeps_its_roughness_by_every_way() {
    let flat: Vec<f32> = [0.6, 0.0, 0.8].repeat(64);
    let surface = surface(&flat, &[0.4; 64]);
    // A rule adds what rounding leaves of a length of one; three.js's takes a variance there and back by its
    // own rounded constants.
    for row in TABLE {
        let bound = if row.name == "three" { 0.005 } else { 2e-3 };
        let got = coarsest(&surface, Widening::Rule(row));
        assert!((got - 0.4).abs() < bound, "{}: {got}", row.name);
    }
    assert!(coarsest(&surface, Widening::Fit(Objective::default())) == f64::from(0.4_f32));
}

#[test]
fn three_js_widens_level_by_level() {
    // A checker of two normals: the mean of four is of length 0.8, once; above it all normals are one again.
    let checker = |i: usize| if (i + i / 8).is_multiple_of(2) { [0.6, 0.0, 0.8] } else { [-0.6, 0.0, 0.8] };
    let normals: Vec<f32> = (0..64).flat_map(checker).collect();
    let surface = surface(&normals, &[0.5; 64]);
    let levels = surface.bake(Widening::Rule(find("three").unwrap()), &Unobserved).unwrap();
    // Its knots: 0.5 lies between (0.4, 0.046) and (0.8, 0.276), and so variance 0.1035; 0.2 more lies
    // between (0.8, 0.276) and (1, 0.339): 0.8 + 0.2 (0.3035 - 0.276)/0.063.
    let expected = 0.8 + 0.2 * (0.3035 - 0.276) / 0.063;
    for level in &levels[1..] {
        let got = f64::from(level.row(0)[0]);
        assert!((got - expected).abs() < 1e-5, "{got} {expected}");
    }
}

#[test]
fn the_smaller_of_two_maps_is_enlarged() {
    let normals = Normals(Grid::from_fn(Size { width: 4, height: 2 }, |_, _| Vec3::Z));
    let roughness = Grid::from_fn(Size { width: 8, height: 8 }, |x, _| if x < 4 { 0.2 } else { 0.6 });
    let surface = RoughSurface::new(&normals, &roughness).unwrap();
    assert_eq!(surface.size(), EIGHT);
    let levels = surface.bake(Widening::Rule(find("plain").unwrap()), &Unobserved).unwrap();
    assert!((levels[3].row(0)[0] - 0.4).abs() < 1e-6);
    let smaller = Grid::from_fn(Size { width: 2, height: 1 }, |x, _| x as f32);
    let surface = RoughSurface::new(&normals, &smaller).unwrap();
    let levels = surface.bake(Widening::Rule(find("plain").unwrap()), &Unobserved).unwrap();
    // Bilinear between 0 and 1, which repeat: quarters and three quarters.
    assert_eq!(levels[0].row(0), [0.25, 0.25, 0.75, 0.75]);
    for bad in [f32::NAN, -0.1, 1.5] {
        assert!(RoughSurface::new(&normals, &Grid::from_fn(EIGHT, |_, _| bad)).is_err());
    }
}

#[test]
fn an_engine_shades_as_smith_does_where_nothing_is_clamped() {
    // Smith's product and the height-correlated form agree where the eye or the light is straight above.
    let brdf = Brdf::new("ggx:0.25".parse::<AnyLobe>().unwrap(), ShadingModel::Smith);
    for wi in [DVec3::new(0.3, 0.2, 0.9), DVec3::new(-0.7, 0.1, 0.4)] {
        let path = Directions::new(wi.normalize(), DVec3::Z).unwrap();
        let params = SurfaceParams {
            diffuse: DVec3::splat(0.2),
            specular: DVec3::splat(0.04),
            roughness: SlopeVariance::ZERO,
        };
        let due = brdf.facet(DVec3::Z, &params, &path).x;
        let got = EngineMaterial::DIELECTRIC.shade(DVec3::Z, 0.5, &path);
        assert!((got / due - 1.0).abs() < 1e-9, "{got} {due}");
    }
}
