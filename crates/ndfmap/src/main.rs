//! The `ndfmap` program: reads the command line, runs one command, turns its outcome into an exit status.

use std::process::ExitCode;

use clap::Parser;
use ndfmap::commands::Program;

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
