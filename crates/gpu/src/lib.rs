//! ndfmap-gpu: the scenes of `ndfmap-core` in real time, through the same maps, and shaders for other programs.
//!
//! [`Device`] is a GPU. [`Maps`] are a scene's baked materials in its memory, [`Renderer`] draws them, frame after frame, while
//! camera, lights, lobes and colours change. [`link`] joins the text of core's shaders with the passes here and checks it.

mod canvas;
mod device;
mod environment;
mod error;
pub mod export;
#[cfg(test)]
mod failures;
mod geometry;
pub mod link;
mod maps;
mod pipelines;
mod renderer;
mod tessellation;
mod truth;
mod uniforms;

pub use canvas::{Antialiasing, Canvas, Target};
pub use device::Device;
pub use error::GpuError;
pub use geometry::Geometry;
pub use maps::Maps;
pub use renderer::{Frame, Renderer, SceneView};
pub use tessellation::Meshes;
pub use truth::{FinestMaps, LEAST_SAMPLES, TrueFrame};
pub use wgpu;
