//! Devices that render: the processor, or a GPU. Both make the same pictures of the same maps and scenes; see
//! `docs/gpu.md`.

mod cpu;
#[cfg(feature = "gpu")]
mod gpu;

pub(crate) use cpu::Cpu;
#[cfg(feature = "gpu")]
pub(crate) use gpu::Gpu;

use ndfmap_core::compact::Storage;
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Observer;
use ndfmap_scene::metrics::Picture;
use ndfmap_scene::{Camera, Effort, Material, Scene, TruePicture};
use ndfmap_trace::truth::Truth;
use ndfmap_trace::{DisplacedMeshes, Geometry};
use serde::Serialize;

use crate::Error;

/// Description of the device that rendered.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "device", rename_all = "lowercase")]
#[non_exhaustive]
pub enum DeviceReport {
    /// The processor.
    Cpu,
    /// A GPU.
    Gpu {
        /// Name of the adapter, and its interface to us.
        adapter: String,
        /// Clock that times frames: `device`, or `wall`.
        clock: &'static str,
        /// Taps of the device's own sampler, where it filters.
        sampler: Option<u16>,
        /// Antialiasing of outlines: `parts`, or `multisampled`.
        outlines: &'static str,
    },
}

/// Scene that is set up, seen by a camera.
pub(crate) struct View<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) set: &'a S,
    pub(crate) camera: Camera,
    pub(crate) size: Size,
}

/// Picture through baked maps, and the time of a frame like it.
pub(crate) struct RenderedPicture {
    pub(crate) picture: Picture,
    pub(crate) milliseconds: f64,
}

/// Geometry for the CPU renderer's truth, of a scene, displaced or not.
pub(crate) struct TrueGeometry {
    plain: Geometry,
    displacement: Option<DisplacedMeshes>,
}

impl TrueGeometry {
    pub(crate) fn new(scene: &Scene, observer: &dyn Observer) -> Self {
        if !scene.is_displaced() {
            return Self { plain: Geometry::new(scene), displacement: None };
        }
        let displacement = DisplacedMeshes::new(scene);
        let (facets, bytes) = (displacement.facets() as f64 / 1e6, displacement.bytes() as f64 / 1e6);
        observer.note(&format!("displaced truth: {facets:.1} million facets, {bytes:.0} MB"));
        Self { plain: Geometry::without_displacement(scene), displacement: Some(displacement) }
    }

    pub(crate) fn truth<'a>(&'a self, scene: &'a Scene) -> Truth<'a> {
        match &self.displacement {
            Some(displacement) => Truth::displaced(scene, &self.plain, displacement),
            None => Truth::new(scene, &self.plain),
        }
    }
}

/// Device that renders.
pub(crate) trait Engine {
    /// Maps baked for the device.
    type Maps;

    /// Triangles of a scene, and all else that the device keeps of a scene.
    type Set;

    /// Describes the device.
    fn describe(&self) -> DeviceReport;

    /// Bakes a scene's maps.
    fn bake(
        &self,
        materials: &[Material],
        method: &AnyMethod,
        storage: Storage,
        observer: &dyn Observer,
    ) -> Result<Self::Maps, Error>;

    /// Sets a scene up for pictures of this size by its camera, or by one less than a pixel away.
    fn set(&self, scene: &Scene, size: Size) -> Result<Self::Set, Error>;

    /// Renders by brute force.
    fn truth(
        &self,
        view: &View<'_, Self::Set>,
        effort: &Effort,
        observer: &dyn Observer,
    ) -> Result<TruePicture, Error>;

    /// Renders through maps.
    fn draw(
        &self,
        view: &View<'_, Self::Set>,
        maps: &Self::Maps,
        lookups: Lookups,
        observer: &dyn Observer,
    ) -> Result<RenderedPicture, Error>;
}
