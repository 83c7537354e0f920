//! A sphere of Gaussian roughness, lit from where it is seen, after Dupuy et al. 2013, tables 3 to 5; meant
//! to be displaced.
//!
//! Its map is of longitude and latitude. The slopes are the same everywhere only as a displacement, which
//! knows how the map is stretched.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use super::sphere::ball;
use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun, zoom};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::grid::Size;
use ndfmap_core::procedural::{Grain, sphere_noise};
use ndfmap_core::units::SlopeVariance;

/// Deviation of the slopes, displaced at scale 1.
const DEVIATION: f64 = 0.25;

fn build(staging: &SceneOptions, grain: Grain) -> Scene {
    let mesh = Mesh::from_patch((128, 64), DVec2::ONE, |s, t| ball(s + 0.25, t));
    let Size { width, .. } = staging.map_size;
    // World length of a texture width in the mean over the sphere, as a displacement takes it: its area is
    // that of half a square texture.
    let depth = (8.0 * PI).sqrt();
    let own = || {
        let size = Size { width: 2 * width, height: width };
        Arc::new(sphere_noise(size, grain.deviations(DEVIATION), depth, 2013))
    };
    // From filling the frame to ten pixels of five hundred.
    let distance = zoom(3.5, 158.0, staging.time);
    Scene {
        camera: Camera::new([0.0, 0.0, distance], [0.0, 0.0, 0.0], 35.0),
        objects: vec![Object { mesh: mesh.into(), material: 0 }],
        materials: vec![Material {
            name: "noise".to_owned(),
            map: staging.map.clone().unwrap_or_else(|| crate::MaterialMap::Surface(own())),
            params: SurfaceParams {
                diffuse: DVec3::splat(0.75),
                specular: DVec3::splat(0.04),
                roughness: SlopeVariance::ZERO,
            },
            textures: None,
            displacement: None,
            brdf: brdf(ShadingModel::Masked, "beckmann:0.15"),
        }],
        lights: vec![sun([0.0, 0.0, 1.0], [3.0, 3.0, 3.0])],
        environment: None,
        background: Vec3::ZERO,
        exposure: 1.0,
    }
}

const ANIMATION: &str = "the camera moves away, from filling the frame to some ten pixels";

pub(super) const ROW: Row = Row {
    name: "noise-sphere",
    summary: "a rough sphere, alike on all sides, slopes of deviation 0.25 when displaced",
    animation: ANIMATION,
    build: |staging| build(staging, Grain::Isotropic),
};

pub(super) const LATITUDINAL: Row = Row {
    name: "noise-sphere-latitudinal",
    summary: "the same with scratches along the equator",
    animation: ANIMATION,
    build: |staging| build(staging, Grain::Latitudinal),
};

pub(super) const LONGITUDINAL: Row = Row {
    name: "noise-sphere-longitudinal",
    summary: "the same with scratches from pole to pole",
    animation: ANIMATION,
    build: |staging| build(staging, Grain::Longitudinal),
};
