//! `ndfmap figure`: the figures and tables of the four papers, made again with their numbers beside ours.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use ndfmap::Error;
use ndfmap::core::observe::Observer as _;
use ndfmap::maps::atomic;
use ndfmap::render;
use ndfmap_figures::{Figure, Made, PAGE, Plan, TABLE, find, index, write};
use serde_json::json;

use super::render::Device;
use super::{check_kept, circumstances, make_folder, make_way, print, print_json, say_written, to_value};
use crate::tables;
use crate::terminal::Terminal;
use crate::voice::say;

/// Make figures and tables of the papers again, with the papers' numbers beside ours
#[derive(Debug, Args)]
#[command(after_long_help = figures_help())]
pub(super) struct FigureCommand {
    /// Names of the figures
    #[arg(value_name = "NAME", value_delimiter = ',', value_parser = figure_name,
        required_unless_present_any = ["all", "list"])]
    name: Vec<String>,
    /// List the figures
    #[arg(long, conflicts_with_all = ["name", "all", "output"])]
    list: bool,
    /// Make every figure, and a page of them all
    #[arg(long, conflicts_with = "name")]
    all: bool,
    /// Folder for the pictures and numbers
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    output: Option<PathBuf>,
    /// Make small pictures of small maps, in a minute or two for all; their numbers are rough
    #[arg(long)]
    quick: bool,
    /// Seed of the truths' rays
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Device whose frame rates `tan-speed` measures; all else is made on the processor
    #[arg(long, value_enum, ignore_case = true, default_value_t = Device::Cpu)]
    device: Device,
}

fn figure_name(text: &str) -> Result<String, String> {
    match find(text) {
        Some(row) => Ok(row.name.to_owned()),
        None => {
            let nearest = TABLE.iter().max_by(|a, b| {
                let near = |row: &Figure| strsim::jaro_winkler(text, row.name);
                near(a).total_cmp(&near(b))
            });
            let hint = nearest.map_or_else(String::new, |row| format!("; `{}` is nearest", row.name));
            Err(format!("there is no figure `{text}`{hint}; `ndfmap figure --list` has them all"))
        }
    }
}

fn figures_help() -> String {
    let rows = TABLE.iter().map(|row| format!("  {:15} {}: {}", row.name, row.place, row.summary));
    format!("Figures:\n{}", rows.collect::<Vec<_>>().join("\n"))
}

impl FigureCommand {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        if self.list {
            return if json {
                let row = |row: &Figure| {
                    json!({
                        "name": row.name, "paper": row.paper.title(), "place": row.place, "summary": row.summary,
                    })
                };
                print_json(&json!({ "figures": TABLE.iter().map(row).collect::<Vec<_>>() }))
            } else {
                print(&tables::figures())
            };
        }
        let folder = self.output.clone().unwrap_or_default();
        let chosen: Vec<&Figure> =
            TABLE.iter().filter(|row| self.all || self.name.iter().any(|name| name == row.name)).collect();
        make_folder(&folder)?;
        // Before the work, which takes minutes.
        for row in &chosen {
            for ending in [".json", ".png", "-dark.png"] {
                make_way(&folder.join(format!("{}{ending}", row.name)))?;
            }
        }
        if self.all {
            check_kept(&folder.join(PAGE))?;
        }
        let (start, terminal, device) = (Instant::now(), Terminal::default(), self.device()?);
        let plan = Plan { quick: self.quick, seed: self.seed, device: &device, observer: &terminal };
        let (mut made, mut written): (Vec<Made>, Vec<PathBuf>) = (Vec::new(), Vec::new());
        for row in chosen {
            terminal.check()?;
            let (one, files) = write(row, &plan, &folder)?;
            say(format_args!("{}: {}, {:.1} s", row.name, one.verdict, one.seconds));
            made.push(one);
            written.extend(files);
        }
        if self.all {
            let path = folder.join(PAGE);
            make_way(&path)?;
            atomic::write(&path, index(&made, &circumstances())?.as_bytes())?;
            written.push(path);
        }
        say_written(&written);
        if !json {
            return print(&tables::made(&made));
        }
        let mut value = json!({ "figures": to_value(&made)? });
        value["files"] = written.iter().map(|f| f.display().to_string()).collect();
        value["seconds"] = start.elapsed().as_secs_f64().into();
        print_json(&value)
    }

    /// Device of frame rates.
    fn device(&self) -> Result<render::Device, Error> {
        #[cfg(feature = "gpu")]
        if let Some(device) = self.device.open()? {
            return Ok(render::Device::Gpu { device, sampler: None, multisample: false });
        }
        #[cfg(not(feature = "gpu"))]
        self.device.refuse_gpu()?;
        Ok(render::Device::Cpu)
    }
}
