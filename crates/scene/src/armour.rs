//! Golden armour of hemispherical scales on a curved body, after Tan et al. 2005, figure 8.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun, zoom};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// A torso: height and radii of its cross-section at t from 0 (hip) to 1 (neck).
fn torso(s: f64, t: f64) -> DVec3 {
    // Hip, waist, chest, shoulder, neck.
    const WIDTH: [f64; 6] = [0.62, 0.5, 0.56, 0.72, 0.62, 0.2];
    const DEPTH: [f64; 6] = [0.42, 0.34, 0.4, 0.46, 0.34, 0.18];
    let profile = |values: &[f64; 6]| {
        // Catmull-Rom through the six.
        let at = t.clamp(0.0, 1.0) * 5.0;
        let i = (at as usize).min(4);
        let u = at - i as f64;
        let p = |k: isize| values[(i as isize + k).clamp(0, 5) as usize];
        let (a, b, c, d) = (p(-1), p(0), p(1), p(2));
        b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)))
    };
    let (sin, cos) = (TAU * s).sin_cos();
    DVec3::new(-profile(&WIDTH) * cos, 2.0 * t - 1.0, profile(&DEPTH) * sin)
}

pub(super) const ROW: Row = Row {
    name: "armour",
    summary: "golden scale armour on a curved body",
    animation: "the camera moves away",
    build: |staging: &SceneOptions| {
        // Round the back to front, so that s runs to the right as seen from +z.
        let mesh = Mesh::from_patch((96, 96), DVec2::new(3.0, 2.0), |s, t| torso(s - 0.25, t));
        let distance = zoom(1.6, 14.0, staging.time);
        Scene {
            camera: Camera::new([0.25 * distance, 0.1 * distance, distance], [0.0, 0.0, 0.0], 55.0),
            objects: vec![Object { mesh: mesh.into(), material: 0 }],
            materials: vec![Material {
                name: "gold".to_owned(),
                map: staging.first_map("armour"),
                params: SurfaceParams {
                    diffuse: DVec3::new(0.25, 0.17, 0.05),
                    specular: DVec3::new(0.2, 0.145, 0.055),
                    roughness: SlopeVariance::ZERO,
                },
                textures: None,
                displacement: None,
                brdf: brdf(ShadingModel::Tan, "torrance-sparrow:0.1"),
            }],
            lights: vec![sun([0.6, 0.7, 0.8], [1.2, 1.15, 1.0]), sun([-0.8, 0.2, 0.4], [0.4, 0.45, 0.6])],
            environment: None,
            background: Vec3::new(0.02, 0.02, 0.025),
            exposure: 1.0,
        }
    },
};
