//! A plane to the horizon, any map on it, the light ahead: the view in which normal maps sparkle.

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// Half of the plane's side; the map covers two by two.
const HALF: f64 = 60.0;

fn build(staging: &SceneOptions) -> Scene {
    let place = |s: f64, t: f64| DVec3::new((2.0 * s - 1.0) * HALF, 0.0, (1.0 - 2.0 * t) * HALF);
    let mesh = Mesh::from_patch((1, 1), DVec2::splat(HALF), place);
    // No whole number of the map's sides in a half, a third or a quarter of the way: every frame differs.
    let ahead = 3.3 * staging.time;
    Scene {
        camera: Camera::new([0.3, 1.1, 8.0 - ahead], [0.3, -0.35, 4.0 - ahead], 50.0),
        objects: vec![Object { mesh: mesh.into(), material: 0 }],
        materials: vec![Material {
            name: "plane".to_owned(),
            map: staging.first_map("foil"),
            params: SurfaceParams {
                diffuse: DVec3::new(0.2, 0.25, 0.32),
                specular: DVec3::splat(0.06),
                roughness: SlopeVariance::ZERO,
            },
            textures: None,
            displacement: None,
            brdf: brdf(ShadingModel::Smith, "beckmann:0.15"),
        }],
        lights: vec![sun([0.1, 0.45, -1.0], [1.6, 1.5, 1.35])],
        environment: None,
        background: Vec3::new(0.02, 0.03, 0.05),
        exposure: 1.0,
    }
}

pub(super) const ROW: Row = Row {
    name: "plane",
    summary: "any map on a plane to the horizon, the sun ahead",
    animation: "the camera glides forward",
    build,
};
