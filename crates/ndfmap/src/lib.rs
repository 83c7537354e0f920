//! ndfmap: the program, and the library's front door.
//!
//! Library users need [`core`] (mathematics), [`maps`] (files) and perhaps [`trace`] (pictures) and `gpu` (the same in real time) only; the rest of this crate is the
//! program: its commands, how they measure, and how they draw.

pub use ndfmap_core as core;
#[cfg(feature = "gpu")]
pub use ndfmap_gpu as gpu;
pub use ndfmap_maps as maps;
pub use ndfmap_trace as trace;

mod auto;
pub mod commands;
mod engine;
mod fail;
mod imaging;
mod interrupt;
mod measure;
mod progress;
mod report;
mod staging;

pub use fail::Failure;
pub use interrupt::clean_up_when_interrupted;
