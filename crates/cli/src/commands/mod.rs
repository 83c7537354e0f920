//! The command line: common part of all commands, and the table of commands.
//!
//! A command is one file here and one row of `Command`. Every command keeps these rules: `--json` prints
//! exactly one document on stdout and everything else goes to stderr; exit status is 0 when done, 1 when
//! failed, 2 for wrong usage; nothing is overwritten without saying so.

mod arguments;
mod bake;
mod compare;
mod demo;
mod figure;
mod gltf;
mod inspect;
mod render;
mod roughness;
#[cfg(feature = "gpu")]
mod shader;
mod shell;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Parser, Subcommand};
use serde::Serialize;
use serde_json::Value;

use ndfmap::Error;
use ndfmap::maps::{MapError, NdfMap};

use crate::voice::{self, Verbosity, say, warn};

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
#[command(next_help_heading = "Options of every command")]
struct Global {
    /// Print one JSON document on stdout
    #[arg(long, global = true)]
    json: bool,
    /// Print errors alone on stderr
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print details on stderr: what tells that a picture is a map, and times
    #[arg(short, long, global = true)]
    verbose: bool,
    /// Fail where a file would be replaced
    #[arg(long, global = true)]
    no_clobber: bool,
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
    Figure(figure::FigureCommand),
    Gltf(gltf::Gltf),
    Roughness(Box<roughness::Roughness>),
    #[cfg(feature = "gpu")]
    Shader(shader::Shader),
    Completions(shell::Completions),
    Man(shell::Man),
}

impl Program {
    /// Runs the command.
    pub(crate) fn run(self) -> Result<(), Error> {
        voice::set(match (self.global.quiet, self.global.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Usual,
        });
        NO_CLOBBER.store(self.global.no_clobber, Ordering::Relaxed);
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
            Command::Figure(command) => command.run(json),
            Command::Gltf(command) => command.run(json),
            Command::Roughness(command) => command.run(json),
            #[cfg(feature = "gpu")]
            Command::Shader(command) => command.run(json),
            Command::Completions(command) => command.run(),
            Command::Man(command) => command.run(),
        }
    }
}

/// Options whose value may be left out, and so needs an equals sign.
const OPTIONAL_VALUES: [&str; 4] = ["--truth", "--displace", "--sampler", "--zstd"];

/// Hint for a command line that could not be read, where a number follows such an option.
pub(crate) fn equals_hint(arguments: impl Iterator<Item = String>) -> Option<String> {
    let arguments: Vec<String> = arguments.collect();
    let [option, value] = arguments
        .windows(2)
        .find(|two| OPTIONAL_VALUES.contains(&two[0].as_str()) && two[1].parse::<f64>().is_ok())
        .filter(|two| arguments[0] != "compare" || two[0] != "--truth")?
    else {
        return None;
    };
    Some(format!("a value of `{option}` follows an equals sign: write `{option}={value}`"))
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

/// Prints a JSON document, with the program's version and its command line.
fn print_json(value: &impl Serialize) -> Result<(), Error> {
    let mut value = to_value(value)?;
    if let Value::Object(document) = &mut value {
        let arguments: Vec<String> =
            std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
        let program = serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "arguments": arguments });
        document.insert("ndfmap".to_owned(), program);
    }
    print(&serde_json::to_string_pretty(&value).map_err(|e| Error::Failed(e.to_string()))?)
}

/// Returns a report as a JSON value, to which a command may add.
fn to_value(report: &impl Serialize) -> Result<Value, Error> {
    serde_json::to_value(report).map_err(|e| Error::Failed(e.to_string()))
}

/// True where no file may be replaced.
static NO_CLOBBER: AtomicBool = AtomicBool::new(false);

/// Refuses, before long work, a file that `--no-clobber` would keep.
fn check_kept(path: &Path) -> Result<(), Error> {
    if NO_CLOBBER.load(Ordering::Relaxed) && path.exists() {
        return Err(Error::Failed(format!("{}: is there, and `--no-clobber` keeps it", path.display())));
    }
    Ok(())
}

/// Warns of a baked map that is read alone, though a renderer's normal map is due near by.
fn warn_of_missing_levels(path: &Path, map: &NdfMap) {
    if map.header.from_level > 0 {
        let from = map.header.from_level;
        let what = format!(
            "begins at level {from}: nearer than that its normal map is to be shaded (docs/compact.md)"
        );
        warn(path, &what);
    }
}

/// Makes way for a file: says that it is replaced, or refuses to.
fn make_way(path: &Path) -> Result<(), Error> {
    if path.is_dir() {
        return Err(Error::Request(format!("{}: is a folder, not a file to write", path.display())));
    }
    if !path.exists() {
        return Ok(());
    }
    check_kept(path)?;
    say(format_args!("replacing {}", path.display()));
    Ok(())
}

/// Refuses outputs of which two would go into one file.
fn check_apart<'a>(outputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<(), Error> {
    let mut seen = std::collections::HashSet::new();
    for path in outputs {
        if !seen.insert(path) {
            return Err(Error::Request(format!("{}: is named for two outputs", path.display())));
        }
    }
    Ok(())
}

/// Circumstances of a report: the command, when and where it ran. Paths stand in it as they were given.
fn circumstances() -> Vec<String> {
    let arguments = std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned());
    let command = std::iter::once("ndfmap".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ");
    let date = humantime::format_rfc3339_seconds(std::time::SystemTime::now());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (system, processor) = (std::env::consts::OS, std::env::consts::ARCH);
    vec![command, format!("{date}, {system} on {processor}, {cores} cores")]
}

/// Makes a folder for outputs.
fn make_folder(folder: &Path) -> Result<(), Error> {
    if folder.is_file() {
        return Err(Error::Request(format!("{}: is a file, not a folder for the outputs", folder.display())));
    }
    std::fs::create_dir_all(folder).map_err(|e| MapError::io(folder, e).into())
}

/// Says what was written.
fn say_written(files: &[PathBuf]) {
    files.iter().for_each(|file| say(format_args!("wrote {}", file.display())));
}
