//! Straight grooves, after Han et al. 2007, figure 1: two directions and no others, so that answers have
//! closed forms.

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

pub(super) const ROW: Row = Row {
    name: "v-groove",
    summary: "straight grooves on a square, the simplest two-lobed surface",
    animation: "the light sweeps across the grooves",
    build: |staging: &SceneOptions| {
        let mesh = Mesh::from_patch((1, 1), DVec2::ONE, |s, t| DVec3::new(2.0 * s - 1.0, 2.0 * t - 1.0, 0.0));
        Scene {
            camera: Camera::new([0.0, 0.0, 4.0], [0.0, 0.0, 0.0], 35.0),
            objects: vec![Object { mesh: mesh.into(), material: 0 }],
            materials: vec![Material {
                name: "grooves".to_owned(),
                map: staging.first_map("v-groove"),
                params: SurfaceParams {
                    diffuse: DVec3::splat(0.1),
                    specular: DVec3::splat(0.2),
                    roughness: SlopeVariance::ZERO,
                },
                textures: None,
                displacement: None,
                brdf: brdf(ShadingModel::Han, "blinn-phong:60"),
            }],
            lights: vec![sun([3.0 * staging.time - 1.5, 0.2, 1.0], [1.0, 1.0, 1.0])],
            environment: None,
            background: Vec3::splat(0.01),
            exposure: 1.0,
        }
    },
};
