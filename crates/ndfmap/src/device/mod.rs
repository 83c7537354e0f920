//! What renders: the processor, or a GPU. The same maps and scenes, the same pictures; see `docs/gpu.md`.

mod cpu;
#[cfg(feature = "gpu")]
mod gpu;

pub(crate) use cpu::Cpu;
#[cfg(feature = "gpu")]
pub(crate) use gpu::Gpu;

use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Observer;
use ndfmap_core::pyramid::Precision;
use ndfmap_scene::metrics::Picture;
use ndfmap_scene::{Camera, Effort, Material, Scene, TruePicture};
use ndfmap_trace::truth::Truth;
use ndfmap_trace::{DisplacedMeshes, Geometry};
use serde::Serialize;

use crate::Error;

/// What rendered.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "device", rename_all = "lowercase")]
#[non_exhaustive]
pub enum DeviceReport {
    /// The processor.
    Cpu,
    /// A GPU.
    Gpu {
        /// Its name, and its interface to us.
        adapter: String,
        /// Whose clock frames are timed by: `device`, or `wall`.
        clock: &'static str,
        /// Taps of the device's own sampler, where that filters.
        sampler: Option<u16>,
        /// How outlines are smoothed: `parts`, or `multisampled`.
        outlines: &'static str,
    },
}

/// A scene that is set up, seen by a camera.
pub(crate) struct View<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) set: &'a S,
    pub(crate) camera: Camera,
    pub(crate) size: Size,
}

/// A picture through baked maps, and what a frame like it takes.
pub(crate) struct RenderedPicture {
    pub(crate) picture: Picture,
    pub(crate) milliseconds: f64,
}

/// What the CPU renderer's truth hits, of a scene with relief or without.
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

/// What renders.
pub(crate) trait Engine {
    /// Maps baked for it.
    type Maps;

    /// A scene's triangles, and what else it keeps of a scene.
    type Set;

    /// What it is.
    fn describe(&self) -> DeviceReport;

    /// Bakes a scene's maps.
    fn bake(
        &self,
        materials: &[Material],
        method: &AnyMethod,
        precision: Precision,
        observer: &dyn Observer,
    ) -> Result<Self::Maps, Error>;

    /// Sets a scene up for pictures of this size from where its camera is, or less than a pixel away.
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
