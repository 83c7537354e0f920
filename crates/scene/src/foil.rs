//! Crumpled foil on a gently bent sheet, which dulls with distance, after Olano and North 1997.

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun, zoom};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

pub(super) const ROW: Row = Row {
    name: "foil",
    summary: "a gently bent sheet of crumpled foil",
    animation: "the camera moves away",
    build: |staging: &SceneOptions| {
        let mesh = Mesh::from_patch((48, 48), DVec2::splat(2.0), |s, t| {
            let (x, y) = (2.0 * s - 1.0, 2.0 * t - 1.0);
            DVec3::new(x, y, 0.25 * (1.0 - x * x) + 0.08 * (3.0 * y + x).sin())
        });
        let distance = zoom(2.4, 30.0, staging.time);
        Scene {
            camera: Camera::new([0.3 * distance, 0.1 * distance, distance], [0.0, 0.0, 0.1], 40.0),
            objects: vec![Object { mesh: mesh.into(), material: 0 }],
            materials: vec![Material {
                name: "foil".to_owned(),
                map: staging.first_map("foil"),
                params: SurfaceParams {
                    diffuse: DVec3::splat(0.06),
                    specular: DVec3::new(0.6, 0.6, 0.62),
                    roughness: SlopeVariance::ZERO,
                },
                textures: None,
                displacement: None,
                brdf: brdf(ShadingModel::Smith, "ggx:0.12"),
            }],
            lights: vec![sun([-0.4, 0.7, 1.0], [2.6, 2.5, 2.3]), sun([0.9, 0.2, 0.5], [0.7, 0.8, 1.0])],
            environment: None,
            background: Vec3::new(0.015, 0.015, 0.02),
            exposure: 1.0,
        }
    },
};
