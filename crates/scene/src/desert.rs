//! A desert under a low sun, after Tan et al. 2005, figure 1: dunes and ripples in the map, over rolling
//! terrain.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun, zoom};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// Side of the terrain.
const SIDE: f64 = 40.0;

/// Rolling ground, in whole waves.
pub(super) fn rolling(x: f64, z: f64, height: f64) -> f64 {
    let wave = |a: f64, b: f64, phase: f64| (TAU * (a * x + b * z) / SIDE + phase).sin();
    height
        * (wave(2.0, 1.0, 0.3)
            + 0.6 * wave(-1.0, 3.0, 1.7)
            + 0.35 * wave(5.0, 2.0, 4.1)
            + 0.2 * wave(4.0, -6.0, 0.9))
}

pub(super) const ROW: Row = Row {
    name: "desert",
    summary: "dunes and ripples over rolling terrain under a low sun",
    animation: "the camera rises, from ripples to a whole desert",
    build: |staging: &SceneOptions| {
        let place = |s: f64, t: f64| {
            let (x, z) = ((s - 0.5) * SIDE, (0.5 - t) * SIDE);
            DVec3::new(x, rolling(x, z, 0.55), z)
        };
        let mesh = Mesh::from_patch((160, 160), DVec2::splat(SIDE / 2.5), place);
        let distance = zoom(1.2, 26.0, staging.time);
        let ground = rolling(0.0, 0.0, 0.55);
        let eye = [0.15 * distance, ground + 0.55 * distance, 0.85 * distance];
        Scene {
            camera: Camera::new(eye, [0.0, ground, 0.0], 45.0),
            objects: vec![Object { mesh: mesh.into(), material: 0 }],
            materials: vec![Material {
                name: "sand".to_owned(),
                map: staging.first_map("dunes"),
                params: SurfaceParams {
                    diffuse: DVec3::new(0.75, 0.5, 0.27),
                    specular: DVec3::splat(0.04),
                    roughness: SlopeVariance::ZERO,
                },
                textures: None,
                displacement: None,
                brdf: brdf(ShadingModel::Tan, "torrance-sparrow:0.2"),
            }],
            lights: vec![sun([-1.0, 0.42, -0.35], [3.2, 2.7, 2.1]), sun([0.3, 1.0, 0.3], [0.35, 0.45, 0.65])],
            environment: None,
            background: Vec3::new(0.25, 0.4, 0.62),
            exposure: 1.0,
        }
    },
};
