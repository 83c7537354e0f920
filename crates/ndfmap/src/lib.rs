//! ndfmap: normal distribution maps from files to pictures. Its typed functions do all that the program
//! `ndfmap` does.
//!
//! - [`maps`] reads sources and baked maps; [`BakeJob`] bakes one into the other, and [`choose`] finds the
//!   method for a map.
//! - [`compare`] measures methods on a map, [`render`] renders scenes through baked maps and by brute force,
//!   [`report`] shows both, by the sheets and plots of [`draw`].
//! - [`core`] has the mathematics, [`trace`] the CPU renderer, and `gpu` (a feature) the same in real time,
//!   and shaders for other programs.
//!
//! Long work takes an [`Observer`](core::observe::Observer), who is told of its progress and may stop it.
//!
//! ```no_run
//! use ndfmap::BakeJob;
//! use ndfmap::core::ndf::Vmf;
//! use ndfmap::maps::WriteOptions;
//! use ndfmap::maps::source::{SourceOptions, read_source};
//!
//! let map = read_source("bricks_normal.png".as_ref(), &SourceOptions::default())?;
//! let report = BakeJob::new(&map, Vmf::new(4)?).save("bricks.ktx2".as_ref(), &WriteOptions::default())?;
//! println!("{} levels, {} bytes", report.levels, report.bytes);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use ndfmap_core as core;
#[cfg(feature = "shaders")]
pub use ndfmap_gpu as gpu;
pub use ndfmap_maps as maps;
pub use ndfmap_scene as scene;
pub use ndfmap_trace as trace;

#[cfg(all(feature = "models", feature = "basis"))]
pub mod asset;
mod bake;
pub mod choose;
pub mod compare;
mod device;
pub mod draw;
mod error;
pub mod inspect;
pub mod render;
pub mod report;
pub mod roughness;
mod scene_spec;

pub use bake::{BakeJob, BakeReport, BakeSeconds};
pub use device::DeviceReport;
pub use error::Error;
pub use scene_spec::{CameraSpec, DisplacementOptions, RotatingEnvironment, SceneSpec};
