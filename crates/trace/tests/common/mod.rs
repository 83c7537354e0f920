//! A plate with a map, seen from straight above, by brute force and through maps.

#![allow(dead_code, reason = "each test file uses some of it")]

use std::sync::Arc;

use glam::{DVec3, Vec3};
use ndfmap_core::brdf::{AnyLobe, Brdf, ShadingModel, SurfaceParams};
use ndfmap_core::grid::Size;
use ndfmap_core::light::Light;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Unobserved;
use ndfmap_core::procedural;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::surface::Surface;
use ndfmap_core::units::SlopeVariance;
use ndfmap_scene::metrics::Picture;
use ndfmap_scene::{Camera, Effort, Material, Mesh, Object, Scene, TruePicture};
use ndfmap_trace::Geometry;
use ndfmap_trace::filtered::{BakedMaps, Filtered};
use ndfmap_trace::truth::Truth;

pub(crate) const SQUARE: Size = Size { width: 4, height: 4 };

pub(crate) fn map(name: &str, side: usize) -> Arc<dyn Surface> {
    (procedural::find(name).unwrap().build)(Size::new(side, side).unwrap()).into()
}

/// A plane of side 2 at z = 0 that faces +z, seen from `distance` through an angle that just holds it.
pub(crate) fn plate(surface: Arc<dyn Surface>, lobe: &str, shading: ShadingModel, distance: f64) -> Scene {
    let mesh =
        Mesh::from_patch((1, 1), glam::DVec2::ONE, |s, t| DVec3::new(2.0 * s - 1.0, 2.0 * t - 1.0, 0.0));
    let degrees = 2.0 * (1.0 / distance).atan().to_degrees();
    Scene {
        camera: Camera::new([0.0, 0.0, distance], [0.0; 3], degrees),
        objects: vec![Object { mesh: mesh.into(), material: 0 }],
        materials: vec![Material {
            name: "plate".to_owned(),
            map: surface.into(),
            params: SurfaceParams {
                diffuse: DVec3::new(0.4, 0.3, 0.2),
                specular: DVec3::splat(0.1),
                roughness: SlopeVariance::ZERO,
            },
            textures: None,
            displacement: None,
            brdf: Brdf { lobe: lobe.parse::<AnyLobe>().unwrap(), shading },
        }],
        lights: vec![Light::Directional {
            towards: DVec3::new(0.3, 0.2, 0.9).normalize(),
            irradiance: DVec3::ONE,
        }],
        environment: None,
        background: Vec3::ZERO,
        exposure: 1.0,
    }
}

pub(crate) fn truth(scene: &Scene, size: Size, rays: usize, seed: u64) -> TruePicture {
    let geometry = Geometry::new(scene);
    Truth::new(scene, &geometry)
        .render(&scene.camera, size, &Effort { rays, noise: 0.0, seed }, &|_| ())
        .unwrap()
}

pub(crate) fn filtered(scene: &Scene, method: &str, size: Size, lookups: Lookups) -> Picture {
    let geometry = Geometry::new(scene);
    let method = method.parse::<AnyMethod>().unwrap();
    let maps = BakedMaps::new(&scene.materials, &method, Precision::Single, &|_| ()).unwrap();
    Filtered { scene, geometry: &geometry, maps: &maps }
        .render(&scene.camera, size, lookups, &Unobserved)
        .unwrap()
}
