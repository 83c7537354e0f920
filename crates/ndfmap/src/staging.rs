//! From what the command line asks for to a scene: built-in or from a file, with its own camera, lights and lobe or others.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use ndfmap_core::brdf::{AnyLobe, ShadingModel};
use ndfmap_core::grid::Size;
use ndfmap_core::light::Light;
use ndfmap_core::light::environment::SceneEnvironment;
use ndfmap_core::scene::{self, Camera, Scene, SceneOptions};
use ndfmap_core::surface::Surface;
use ndfmap_maps::model::{ModelOptions, read_model};

use crate::Failure;

/// A scene as asked for; what is `None` or empty stays as the scene has it.
#[derive(Clone, Default)]
pub(crate) struct SceneSpec {
    /// Name of a built-in scene, or a model file.
    pub(crate) scene: String,
    /// Map of the first material.
    pub(crate) map: Option<Arc<dyn Surface>>,
    /// Size of built-in maps.
    pub(crate) map_size: Option<Size>,
    pub(crate) lobe: Option<AnyLobe>,
    pub(crate) shading: Option<ShadingModel>,
    pub(crate) camera: Option<CameraArgument>,
    pub(crate) lights: Vec<Light>,
    /// Colours of the first material.
    pub(crate) diffuse: Option<DVec3>,
    pub(crate) specular: Option<DVec3>,
    pub(crate) exposure: Option<f64>,
    /// Let heights displace meshes.
    pub(crate) displacement: Option<DisplacementOptions>,
    /// Light from everywhere, in place of the scene's own lights.
    pub(crate) environment: Option<RotatingEnvironment>,
}

/// An environment that turns as time goes.
#[derive(Clone)]
pub(crate) struct RotatingEnvironment {
    pub(crate) environment: SceneEnvironment,
    /// In radians, at time 0 and at time 1.
    pub(crate) rotation: [f64; 2],
}

/// How heights displace meshes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DisplacementOptions {
    /// Times what keeps their slopes.
    pub(crate) scale: f64,
    pub(crate) shadows: bool,
}

/// A camera as spelled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraArgument {
    pub(crate) eye: DVec3,
    pub(crate) target: DVec3,
    pub(crate) degrees: Option<f64>,
}

impl SceneSpec {
    /// True for a scene that depends on time; models do not, but their light may.
    pub(crate) fn moves(&self) -> bool {
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

    /// The scene at a time.
    pub(crate) fn set(&self, time: f64) -> Result<Scene, Failure> {
        let mut staging = SceneOptions { time, map: self.map.clone(), ..SceneOptions::default() };
        if let Some(size) = self.map_size {
            staging.map_size = size;
        }
        let path = Path::new(&self.scene);
        let mut scene = match scene::find(&self.scene) {
            Some(row) => (row.build)(&staging),
            None => {
                let (scene, warnings) = read_model(path, &ModelOptions { staging })?;
                warnings.iter().for_each(|w| eprintln!("ndfmap: warning: {}: {w}", path.display()));
                scene
            }
        };
        self.colour(&mut scene);
        if let Some(lobe) = &self.lobe {
            scene.set_brdf(&**lobe);
            if lobe.measured().is_some() {
                // It has brought its own.
                self.colour(&mut scene);
            }
        }
        if let Some(shading) = self.shading {
            scene.set_shading(shading);
        }
        if let Some(DisplacementOptions { scale, shadows }) = self.displacement {
            if let Some(measured) = self.lobe.as_ref().filter(|lobe| lobe.measured().is_some()) {
                let why = "a measured lobe is none of microfacets, which displaced surfaces are made of";
                return Err(Failure::Usage(format!("--displace: {}: {why}", measured)));
            }
            scene.displace(scale, shadows).map_err(|e| {
                Failure::Usage(format!("--displace {}: {e}; name one with `--map`", self.scene))
            })?;
        }
        if let Some(camera) = self.camera {
            let degrees = camera.degrees.unwrap_or(scene.camera.degrees);
            scene.camera = Camera::new(camera.eye.into(), camera.target.into(), degrees);
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
