//! The carved silver disk, after Tan et al. 2005, figures 4, 6 and 7: from the front, zooming out, and at an
//! oblique angle.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{DVec2, DVec3, Vec3};

use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun, zoom};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// The square's concentric rings as circles, without thin triangles in the middle (Shirley and Chiu 1997).
fn on_disk(x: f64, y: f64) -> DVec3 {
    if x == 0.0 && y == 0.0 {
        return DVec3::ZERO;
    }
    let (r, angle) =
        if x.abs() > y.abs() { (x, FRAC_PI_4 * y / x) } else { (y, FRAC_PI_2 - FRAC_PI_4 * x / y) };
    DVec3::new(r * angle.cos(), r * angle.sin(), 0.0)
}

fn scene(staging: &SceneOptions, camera: Camera) -> Scene {
    // A disk of radius 1 that faces +z; its map is stretched over the square around it.
    let mut mesh = Mesh::from_patch((32, 32), DVec2::ONE, |s, t| on_disk(2.0 * s - 1.0, 2.0 * t - 1.0));
    for vertex in &mut mesh.vertices {
        vertex.normal = Vec3::Z;
        vertex.tangent = Vec3::X.extend(1.0);
        vertex.uv = glam::Vec2::new(vertex.position.x + 1.0, 1.0 - vertex.position.y) / 2.0;
    }
    Scene {
        camera,
        objects: vec![Object { mesh: mesh.into(), material: 0 }],
        materials: vec![Material {
            name: "silver".to_owned(),
            map: staging.first_map("carved-disk"),
            params: SurfaceParams {
                diffuse: DVec3::splat(0.12),
                specular: DVec3::new(0.16, 0.158, 0.15),
                roughness: SlopeVariance::ZERO,
            },
            textures: None,
            displacement: None,
            brdf: brdf(ShadingModel::Tan, "torrance-sparrow:0.08"),
        }],
        lights: vec![sun([-0.5, 0.6, 0.9], [1.0, 0.97, 0.9]), sun([0.7, 0.1, 0.6], [0.35, 0.4, 0.5])],
        environment: None,
        background: Vec3::new(0.012, 0.013, 0.016),
        exposure: 1.0,
    }
}

pub(super) const ROW: Row = Row {
    name: "disk",
    summary: "a carved silver disk from the front",
    animation: "the camera moves away, from a close-up to a disk some fifty pixels wide",
    build: |staging| {
        let distance = zoom(2.0, 40.0, staging.time);
        scene(staging, Camera::new([0.0, 0.0, distance], [0.0, 0.0, 0.0], 35.0))
    },
};

pub(super) const OBLIQUE: Row = Row {
    name: "disk-oblique",
    summary: "the carved silver disk at an oblique angle, where footprints are long",
    animation: "the camera moves away",
    build: |staging| {
        let distance = zoom(1.0, 12.0, staging.time);
        let eye = [0.0, -2.6 * distance, 0.75 * distance];
        let mut camera = Camera::new(eye, [0.0, 0.0, 0.0], 40.0);
        camera.up = DVec3::Z;
        scene(staging, camera)
    },
};
