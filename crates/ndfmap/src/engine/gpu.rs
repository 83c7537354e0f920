//! A GPU renders: `ndfmap-gpu`.

use ndfmap_core::grid::Size;
use ndfmap_core::ndf::Method;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::scene::{Material, Scene};
use ndfmap_gpu::{
    Antialiasing, Canvas, Device, Effort, FinestMaps, Geometry, GpuError, Lookups, Maps, Meshes, Renderer,
    Sampling, SceneView,
};
use ndfmap_trace::filtered;
use ndfmap_trace::truth::{self, TruePicture};
use serde_json::{Value, json};

use super::{Engine, RenderedPicture, TrueGeometry, View};
use crate::Failure;

/// A GPU, and how it draws.
pub(crate) struct Gpu<'a> {
    device: &'a Device,
    renderer: Renderer<'a>,
    /// The device's own sampler filters, with so many taps, in place of ours.
    sampler: Option<u16>,
    outlines: Antialiasing,
}

impl From<GpuError> for Failure {
    fn from(error: GpuError) -> Self {
        match error {
            // No device is to blame.
            GpuError::Shader(_) => Self::Failed(error.to_string()),
            _ => Self::Failed(format!("{error} (`--device cpu` renders without a GPU)")),
        }
    }
}

impl<'a> Gpu<'a> {
    /// Prepares to draw on a device.
    pub(crate) fn new(device: &'a Device, sampler: Option<u16>, multisample: bool) -> Result<Self, Failure> {
        let outlines = if multisample { Antialiasing::Multisampled } else { Antialiasing::Parts };
        Ok(Self { device, renderer: Renderer::new(device)?, sampler, outlines })
    }

    fn shown<'v>(view: &'v View<'_, Geometry>) -> SceneView<'v> {
        SceneView { scene: view.scene, geometry: view.set, camera: &view.camera }
    }
}

impl Engine for Gpu<'_> {
    type Maps<'a>
        = Maps<'a>
    where
        Self: 'a;
    type Set = Geometry;

    fn describe(&self) -> Value {
        json!({
            "device": "gpu",
            "adapter": self.device.description(),
            "clock": if self.device.has_timestamps() { "device" } else { "wall" },
            "sampler": self.sampler,
            "outlines": if self.outlines == Antialiasing::Parts { "parts" } else { "multisampled" },
        })
    }

    fn bake<'a>(
        &'a self,
        materials: &[Material],
        method: &'a dyn Method,
        precision: Precision,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Maps<'a>, Failure> {
        Ok(Maps::new(self.device, materials, method, precision, progress)?)
    }

    fn set(&self, scene: &Scene, size: Size) -> Result<Geometry, Failure> {
        Ok(Meshes::new(self.device, scene)?.cut(&scene.camera, size)?)
    }

    fn truth(
        &self,
        view: &View<'_, Geometry>,
        effort: &truth::Effort,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<TruePicture, Failure> {
        if view.scene.is_displaced() || view.scene.environment.is_some() {
            // Facets of relief are rays' business, and so is light that is drawn by chance.
            let geometry = TrueGeometry::new(view.scene);
            return Ok(geometry.truth(view.scene).render(&view.camera, view.size, effort, progress));
        }
        let canvas = Canvas::new(self.device, view.size, Antialiasing::Sharp)?;
        let finest = FinestMaps::new(self.device, &view.scene.materials)?;
        let effort = Effort { samples: effort.rays, noise: effort.noise, progress };
        let truth = self.renderer.truth(&canvas, &Self::shown(view), &finest, &effort)?;
        Ok(TruePicture { picture: truth.picture, rays: truth.samples, noise: truth.noise })
    }

    fn draw(
        &self,
        view: &View<'_, Geometry>,
        maps: &Maps<'_>,
        lookups: filtered::Lookups,
        _progress: &(dyn Fn(f64) + Sync),
    ) -> Result<RenderedPicture, Failure> {
        let filtered::Lookups { filtering, neighbours, at_means } = lookups;
        let sampling = self.sampler.map_or(Sampling::Taps(filtering), Sampling::Sampler);
        let lookups = Lookups { sampling, neighbours, at_means };
        let canvas = Canvas::new(self.device, view.size, self.outlines)?;
        let shown = Self::shown(view);
        self.renderer.draw(&canvas, &shown, maps, lookups)?;
        let picture = canvas.read()?;
        // The picture's own passes made pipelines and read the result back: a frame like the next one tells what it takes.
        let milliseconds = self.renderer.time(&canvas, &shown, maps, lookups)?;
        Ok(RenderedPicture { picture, milliseconds })
    }
}
