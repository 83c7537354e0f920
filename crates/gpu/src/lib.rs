//! ndfmap-gpu: the scenes of `ndfmap-scene` in real time, through the same maps, and shaders for other
//! programs.
//!
//! [`export`] writes a method's shader in the language of another program. [`link`] joins the text of core's
//! shaders with the passes here and checks it. Both need no GPU.
//!
//! With the feature `render` (a default), `Device` is a GPU, ours or the caller's own. `Maps` are a scene's
//! baked materials in its memory. `Renderer` draws them, frame after frame, while camera, lights, lobes and
//! colours change: on a `Canvas` of ours that is read back, or recorded into the caller's commands on the
//! caller's texture.

#[cfg(feature = "render")]
mod canvas;
#[cfg(feature = "render")]
mod device;
#[cfg(feature = "render")]
mod environment;
mod error;
pub mod export;
#[cfg(all(test, feature = "render"))]
mod failures;
#[cfg(feature = "render")]
mod geometry;
pub mod link;
#[cfg(feature = "render")]
mod maps;
#[cfg(feature = "render")]
mod pipelines;
#[cfg(feature = "render")]
mod renderer;
#[cfg(feature = "render")]
mod tessellation;
#[cfg(feature = "render")]
mod truth;
#[cfg(feature = "render")]
mod uniforms;

pub use error::GpuError;
#[cfg(feature = "render")]
pub use {
    canvas::{Antialiasing, Canvas, Target},
    device::Device,
    geometry::Geometry,
    maps::Maps,
    renderer::{Frame, Renderer, SceneView},
    tessellation::Meshes,
    truth::{FinestMaps, LEAST_SAMPLES, TrueFrame},
    wgpu,
};
