//! The command line: common part of all commands, and the table of commands.
//!
//! A command is one file here and one row of `Command`. Every command keeps these rules: `--json` prints
//! exactly one document on stdout and everything else goes to stderr; exit status is 0 when done, 1 when
//! failed, 2 for wrong usage; nothing is overwritten without saying so.

mod arguments;
mod bake;
mod compare;
mod demo;
mod inspect;
mod render;
#[cfg(feature = "gpu")]
mod shader;

use std::path::Path;

use clap::{Parser, Subcommand};
use serde::Serialize;
use serde_json::Value;

use ndfmap::Error;

/// Bakes normal and displacement maps into filterable normal distribution maps, and measures what each
/// method gains.
#[derive(Debug, Parser)]
#[command(name = "ndfmap", version, about, max_term_width = 100)]
pub(crate) struct Program {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    global: Global,
}

#[derive(Debug, clap::Args)]
struct Global {
    /// Print one JSON document on stdout
    #[arg(long, global = true)]
    json: bool,
    /// Threads to use [default: one for each core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Demo),
    Bake(bake::Bake),
    Inspect(inspect::Inspect),
    Compare(compare::Compare),
    Render(Box<render::Render>),
    #[cfg(feature = "gpu")]
    Shader(shader::Shader),
}

impl Program {
    /// Runs the command.
    pub(crate) fn run(self) -> Result<(), Error> {
        if let Some(threads) = self.global.threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
            pool.build_global().map_err(|e| Error::Failed(format!("cannot start {threads} threads: {e}")))?;
        }
        let json = self.global.json;
        match self.command {
            Command::Demo(command) => command.run(json),
            Command::Bake(command) => command.run(json),
            Command::Inspect(command) => command.run(json),
            Command::Compare(command) => command.run(json),
            Command::Render(command) => command.run(json),
            #[cfg(feature = "gpu")]
            Command::Shader(command) => command.run(json),
        }
    }
}

/// Prints text, or JSON, on stdout; a reader that hung up is not our failure.
fn print(text: &str) -> Result<(), Error> {
    print_bytes(format!("{}\n", text.trim_end_matches('\n')).as_bytes())
}

/// Writes bytes on stdout as they are.
fn print_bytes(bytes: &[u8]) -> Result<(), Error> {
    use std::io::Write;
    match std::io::stdout().lock().write_all(bytes) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::Failed(format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}

fn print_json(value: &impl Serialize) -> Result<(), Error> {
    print(&serde_json::to_string_pretty(value).map_err(|e| Error::Failed(e.to_string()))?)
}

/// Returns a report as a JSON value, to which a command may add.
fn to_value(report: &impl Serialize) -> Result<Value, Error> {
    serde_json::to_value(report).map_err(|e| Error::Failed(e.to_string()))
}

/// Prints a warning on stderr.
fn warn(map: &Path, warning: &str) {
    eprintln!("ndfmap: warning: {}: {warning}", map.display());
}

/// Says something of a file on stderr that is no warning.
fn say(map: &Path, words: &str) {
    eprintln!("ndfmap: {}: {words}", map.display());
}

/// Says that a file is about to be replaced.
fn say_if_replaced(path: &Path) {
    if path.exists() {
        eprintln!("ndfmap: replacing {}", path.display());
    }
}
