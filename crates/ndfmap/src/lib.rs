//! ndfmap: the program, and the library's front door.
//!
//! Library users need [`core`] (mathematics), [`maps`] (files) and perhaps [`trace`] (pictures) only; the rest of this crate is the
//! program: its commands, how they measure, and how they draw.

pub use ndfmap_core as core;
pub use ndfmap_maps as maps;
pub use ndfmap_trace as trace;

mod auto;
pub mod commands;
mod fail;
mod imaging;
mod interrupt;
mod measure;
mod progress;
mod report;
mod staging;

pub use fail::Failure;
pub use interrupt::clean_up_when_interrupted;
