//! The `ndfmap` program: reads the command line, runs one command, turns its outcome into an exit status.

use std::process::ExitCode;

use clap::Parser;
use ndfmap::commands::Program;

/// Bands of a bake come and go by the megabyte; the system's allocator gives each back and faults it in again.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    ndfmap::clean_up_when_interrupted();
    match Program::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("ndfmap: {failure}");
            failure.exit_code()
        }
    }
}
