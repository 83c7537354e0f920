//! A GPU renders: `ndfmap-gpu`.

use ndfmap_core::compact::Storage;
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::{Lookups, Sampling};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Observer;
use ndfmap_gpu::{
    Antialiasing, Canvas, Device, FinestMaps, Frame, Geometry, Maps, Meshes, Renderer, SceneView, TrueFrame,
};
use ndfmap_scene::{Effort, Material, Scene, TruePicture};

use super::{DeviceReport, Engine, RenderedPicture, TrueGeometry, View};
use crate::Error;

/// GPU with its options for drawing.
pub(crate) struct Gpu {
    device: Device,
    renderer: Renderer,
    /// Taps of the device's own sampler, which then filters in place of ours.
    sampler: Option<u16>,
    outlines: Antialiasing,
}

impl Gpu {
    /// Prepares to draw on a device.
    pub(crate) fn new(device: Device, sampler: Option<u16>, multisample: bool) -> Result<Self, Error> {
        let outlines = if multisample { Antialiasing::Multisampled } else { Antialiasing::Parts };
        Ok(Self { renderer: Renderer::new(&device)?, device, sampler, outlines })
    }

    fn shown<'v>(view: &'v View<'_, Geometry>) -> SceneView<'v> {
        SceneView { scene: view.scene, geometry: view.set, camera: &view.camera }
    }
}

impl Engine for Gpu {
    type Maps = Maps;
    type Set = Geometry;

    fn describe(&self) -> DeviceReport {
        let parts = self.outlines == Antialiasing::Parts;
        DeviceReport::Gpu {
            adapter: self.device.description(),
            clock: if self.device.has_timestamps() { "device" } else { "wall" },
            sampler: self.sampler,
            outlines: if parts { "parts" } else { "multisampled" },
        }
    }

    fn bake(
        &self,
        materials: &[Material],
        method: &AnyMethod,
        storage: Storage,
        observer: &dyn Observer,
    ) -> Result<Maps, Error> {
        Ok(Maps::new(&self.device, materials, method, storage, observer)?)
    }

    fn set(&self, scene: &Scene, size: Size) -> Result<Geometry, Error> {
        Ok(Meshes::new(&self.device, scene)?.cut(&scene.camera, size)?)
    }

    fn truth(
        &self,
        view: &View<'_, Geometry>,
        effort: &Effort,
        observer: &dyn Observer,
    ) -> Result<TruePicture, Error> {
        let measured = view.scene.materials.iter().any(|m| m.brdf.lobe.measured().is_some());
        if view.scene.is_displaced() || view.scene.environment.is_some() || measured {
            // Displaced facets, and light that is drawn by chance, need rays; and shaders know a measured
            // material by its factors alone.
            let geometry = TrueGeometry::new(view.scene, observer);
            return Ok(geometry.truth(view.scene).render(&view.camera, view.size, effort, observer)?);
        }
        let canvas = Canvas::new(&self.device, view.size, Antialiasing::Sharp)?;
        let finest = FinestMaps::new(&self.device, &view.scene.materials)?;
        let frame = TrueFrame { view: Self::shown(view), finest: &finest };
        Ok(self.renderer.truth(&canvas, &frame, effort, observer)?)
    }

    fn draw(
        &self,
        view: &View<'_, Geometry>,
        maps: &Maps,
        lookups: Lookups,
        _observer: &dyn Observer,
    ) -> Result<RenderedPicture, Error> {
        let sampling = self.sampler.map_or(lookups.sampling, Sampling::Sampler);
        let lookups = Lookups { sampling, ..lookups };
        let canvas = Canvas::new(&self.device, view.size, self.outlines)?;
        let frame = Frame { view: Self::shown(view), maps, lookups };
        self.renderer.draw(&canvas, &frame)?;
        let picture = canvas.read()?;
        // The picture's own passes made pipelines and read the result back: a second frame like it takes the
        // true time.
        let milliseconds = self.renderer.time(&canvas, &frame)?;
        Ok(RenderedPicture { picture, milliseconds })
    }
}
