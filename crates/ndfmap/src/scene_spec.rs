//! Specification of a scene: built-in or from a file, with its own camera, lights and lobe, or with others.

use std::path::Path;

use glam::DVec3;
use ndfmap_core::brdf::{AnyLobe, ShadingModel};
use ndfmap_core::grid::Size;
use ndfmap_core::light::Light;
use ndfmap_core::light::environment::SceneEnvironment;
use ndfmap_core::observe::Observer;
use ndfmap_maps::model::{ModelOptions, read_model};
use ndfmap_scene as scene;
use ndfmap_scene::{Camera, MaterialMap, Scene, SceneOptions};

use crate::Error;

/// Scene as asked for; fields that are `None` or empty leave the scene's own.
#[derive(Clone, Default)]
pub struct SceneSpec {
    /// Name of a built-in scene, or a model file.
    pub scene: String,
    /// Map of the first material.
    pub map: Option<MaterialMap>,
    /// Name of the model's material that the map and the colours are for; `None` for that of its first mesh.
    pub material: Option<String>,
    /// Size of built-in maps.
    pub map_size: Option<Size>,
    /// Lobe of every material.
    pub lobe: Option<AnyLobe>,
    /// Shading model of every material.
    pub shading: Option<ShadingModel>,
    /// Camera.
    pub camera: Option<CameraSpec>,
    /// Factor on the camera's distance from what it looks at, greater than 0; `None` for 1.
    pub distance: Option<f64>,
    /// Lights.
    pub lights: Vec<Light>,
    /// Diffuse albedo of the first material, linear RGB.
    pub diffuse: Option<DVec3>,
    /// Reflectance of the first material at normal incidence, linear RGB.
    pub specular: Option<DVec3>,
    /// Factor on light, before display values take sRGB of it.
    pub exposure: Option<f64>,
    /// Displacement of meshes by heights; `None` for none.
    pub displacement: Option<DisplacementOptions>,
    /// Light from everywhere, in place of the scene's own lights.
    pub environment: Option<RotatingEnvironment>,
}

/// Environment that turns as time goes on.
#[derive(Clone)]
pub struct RotatingEnvironment {
    /// The environment.
    pub environment: SceneEnvironment,
    /// Rotation around the vertical in radians, at time 0 and at time 1.
    pub rotation: [f64; 2],
}

/// Options of the displacement of meshes by heights.
#[derive(Clone, Copy, Debug)]
pub struct DisplacementOptions {
    /// Factor on the depth that keeps their slopes.
    pub scale: f64,
    /// True where facets shade each other.
    pub shadows: bool,
}

/// Camera in place of the scene's own.
#[derive(Clone, Copy, Debug)]
pub struct CameraSpec {
    /// Position of the camera.
    pub eye: DVec3,
    /// Point in the middle of the picture.
    pub target: DVec3,
    /// Angle of view in degrees, from the bottom to the top of the picture.
    pub degrees: Option<f64>,
}

impl SceneSpec {
    /// True for a scene that depends on time; models do not, but their light may.
    #[must_use]
    pub fn moves(&self) -> bool {
        scene::find(&self.scene).is_some()
            || self.environment.as_ref().is_some_and(|e| e.rotation[0] != e.rotation[1])
    }

    /// Gives the first material the colours that were asked for.
    fn colour(&self, scene: &mut Scene) {
        if let Some(first) = scene.materials.first_mut()
            && (self.diffuse.is_some() || self.specular.is_some())
        {
            first.params.diffuse = self.diffuse.unwrap_or(first.params.diffuse);
            first.params.specular = self.specular.unwrap_or(first.params.specular);
            first.textures = None;
        }
    }

    /// Builds the scene at a time from 0 to 1. The observer is told of a model reader's warnings.
    ///
    /// # Errors
    /// [`Error::Map`] for a model that cannot be read, and [`Error::Request`] for a displacement that does
    /// not fit.
    pub fn build(&self, time: f64, observer: &dyn Observer) -> Result<Scene, Error> {
        let mut staging = SceneOptions { time, map: self.map.clone(), ..SceneOptions::default() };
        if let Some(size) = self.map_size {
            staging.map_size = size;
        }
        let path = Path::new(&self.scene);
        let mut scene = match scene::find(&self.scene) {
            Some(row) => {
                if let Some(name) = &self.material {
                    let why = "a built-in scene has no names of materials; models have";
                    return Err(Error::Request(format!("--material {name}: {why}")));
                }
                (row.build)(&staging)
            }
            None => {
                let options = ModelOptions { staging, material: self.material.clone() };
                let (scene, warnings) = read_model(path, &options)?;
                warnings.iter().for_each(|w| observer.note(&format!("warning: {}: {w}", path.display())));
                scene
            }
        };
        self.colour(&mut scene);
        if let Some(lobe) = &self.lobe {
            scene.set_brdf(&**lobe);
            if lobe.measured().is_some() {
                // The material has brought its own.
                self.colour(&mut scene);
            }
        }
        if let Some(shading) = self.shading {
            scene.set_shading(shading);
        }
        if let Some(DisplacementOptions { scale, shadows }) = self.displacement {
            if let Some(measured) = self.lobe.as_ref().filter(|lobe| lobe.measured().is_some()) {
                let why = "a measured lobe is none of microfacets, which displaced surfaces are made of";
                return Err(Error::Request(format!("--displace: {}: {why}", measured)));
            }
            scene.displace(scale, shadows).map_err(|e| {
                Error::Request(format!("--displace {}: {e}; name one with `--map`", self.scene))
            })?;
        }
        if let Some(camera) = self.camera {
            let degrees = camera.degrees.unwrap_or(scene.camera.degrees);
            scene.camera = Camera::new(camera.eye.into(), camera.target.into(), degrees);
        }
        if let Some(distance) = self.distance {
            scene.camera = scene.camera.at_distance(distance);
        }
        if !self.lights.is_empty() || self.environment.is_some() {
            scene.lights.clone_from(&self.lights);
        }
        if let Some(RotatingEnvironment { environment, rotation: [from, to] }) = &self.environment {
            let rotation = from + (to - from) * time;
            scene.environment = Some(SceneEnvironment { rotation, ..environment.clone() });
        }
        if let Some(exposure) = self.exposure {
            scene.exposure = exposure as f32;
        }
        Ok(scene)
    }
}
