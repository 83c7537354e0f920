//! `ndfmap completions` and `ndfmap man`: what shells and manuals know of the program, from its own table of
//! options.

use std::path::PathBuf;

use clap::{Args, CommandFactory};
use clap_complete::Shell;
use ndfmap::Error;
use ndfmap::maps::atomic;

use super::{Program, make_folder, make_way, print_bytes, say_written};

/// Name of the program.
const NAME: &str = "ndfmap";

/// Print a script that completes commands and options in a shell
#[derive(Debug, Args)]
pub(super) struct Completions {
    /// The shell
    #[arg(value_enum, ignore_case = true)]
    shell: Shell,
}

impl Completions {
    pub(super) fn run(self) -> Result<(), Error> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Program::command(), NAME, &mut script);
        print_bytes(&script)
    }
}

/// Write manual pages, one for each command
#[derive(Debug, Args)]
pub(super) struct Man {
    /// Folder for the pages
    #[arg(short, long, value_name = "DIR", default_value = "man")]
    output: PathBuf,
}

impl Man {
    pub(super) fn run(self) -> Result<(), Error> {
        make_folder(&self.output)?;
        let mut program = Program::command();
        program.build();
        let commands = std::iter::once(program.clone()).chain(program.get_subcommands().cloned());
        let mut written = Vec::new();
        for command in commands.filter(|command| command.get_name() != "help") {
            let name = command.get_display_name().unwrap_or(NAME).to_owned();
            let mut page = Vec::new();
            let man = clap_mangen::Man::new(command);
            man.render(&mut page).map_err(|e| Error::Failed(e.to_string()))?;
            let path = self.output.join(format!("{name}.1"));
            make_way(&path)?;
            atomic::write(&path, &page)?;
            written.push(path);
        }
        say_written(&written);
        Ok(())
    }
}
