//! The `ndfmap` program: reads the command line, runs one command, turns its outcome into an exit status.

mod commands;
mod interrupt;
mod tables;
mod terminal;

use std::process::ExitCode;

use clap::Parser;
use commands::Program;
use ndfmap::Error;

/// Bands of a bake come and go by the megabyte; the system's allocator gives each back and faults it in
/// again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    interrupt::clean_up_when_interrupted();
    match Program::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ndfmap: {}", said(&error));
            // 1 failed, 2 wrong usage.
            ExitCode::from(if matches!(error, Error::Request(_)) { 2 } else { 1 })
        }
    }
}

/// An error, with what a user of the program can do about it.
fn said(error: &Error) -> String {
    match error {
        // Of an invalid shader no device is to blame.
        #[cfg(feature = "gpu")]
        Error::Gpu(gpu) if !matches!(gpu, ndfmap::gpu::GpuError::Shader(_)) => {
            format!("{error} (`--device cpu` renders without a GPU)")
        }
        _ => error.to_string(),
    }
}
