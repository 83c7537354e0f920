//! The `ndfmap` program: reads the command line, runs one command, turns its outcome into an exit status.

mod commands;
#[cfg(feature = "gpu")]
mod hushed;
mod interrupt;
mod tables;
mod terminal;
mod voice;

use std::process::ExitCode;

use clap::Parser;
use commands::Program;
use ndfmap::Error;

/// Allocator for the bands of a bake, which come and go by the megabyte: the system's gives each back and
/// faults it in again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    interrupt::clean_up_when_interrupted();
    let program = Program::try_parse().unwrap_or_else(|error| {
        if let Some(hint) = commands::equals_hint(std::env::args().skip(1)) {
            eprintln!("ndfmap: {hint}");
        }
        error.exit()
    });
    match program.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("ndfmap: {}", said(&error));
            // Status 1 stands for failed, 2 for wrong usage.
            ExitCode::from(if matches!(error, Error::Request(_)) { 2 } else { 1 })
        }
    }
}

/// Message of an error, with advice to the user of the program.
fn said(error: &Error) -> String {
    match error {
        // No device is to blame for a shader that cannot be.
        #[cfg(feature = "gpu")]
        Error::Gpu(gpu)
            if !matches!(gpu, ndfmap::gpu::GpuError::Shader(_) | ndfmap::gpu::GpuError::Unsuited { .. }) =>
        {
            format!("{error} (`--device cpu` renders without a GPU)")
        }
        _ => error.to_string(),
    }
}
