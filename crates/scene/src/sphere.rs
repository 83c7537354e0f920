//! Sphere that moves away, after Han et al. 2007, figure 6.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun, zoom};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// A ball of radius 1, its map once around and half as often from pole to pole.
pub(super) fn ball(s: f64, t: f64) -> DVec3 {
    let ((sin, cos), (up, out)) = ((TAU * s).sin_cos(), (PI * (t - 0.5)).sin_cos());
    DVec3::new(-out * cos, up, out * sin)
}

pub(super) const ROW: Row = Row {
    name: "sphere",
    summary: "one bumpy sphere",
    animation: "the camera moves away, from filling the frame to some forty pixels",
    build: |staging: &SceneOptions| {
        let mesh = Mesh::from_patch((128, 64), DVec2::new(2.0, 1.0), |s, t| ball(s + 0.25, t));
        let distance = zoom(3.4, 50.0, staging.time);
        Scene {
            camera: Camera::new([0.0, 0.3 * distance, distance], [0.0, 0.0, 0.0], 35.0),
            objects: vec![Object { mesh: mesh.into(), material: 0 }],
            materials: vec![Material {
                name: "ball".to_owned(),
                map: staging.first_map("ripples"),
                params: SurfaceParams {
                    diffuse: DVec3::new(0.25, 0.05, 0.04),
                    specular: DVec3::splat(0.15),
                    roughness: SlopeVariance::ZERO,
                },
                textures: None,
                displacement: None,
                brdf: brdf(ShadingModel::Han, "blinn-phong:100"),
            }],
            lights: vec![sun([0.5, 0.8, 0.9], [2.5, 2.4, 2.3]), sun([-0.9, 0.1, 0.3], [0.5, 0.6, 0.9])],
            environment: None,
            background: Vec3::new(0.015, 0.017, 0.02),
            exposure: 1.0,
        }
    },
};
