//! `ndfmap demo`: everything on a built-in map, in one folder, without any input.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use ndfmap::core::grid::Size;
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::core::ndf::{AnyMethod, DEFAULT_METHOD};
use ndfmap::core::pyramid::Precision;
use ndfmap::draw::Theme;
use ndfmap::maps::source::{SourceOptions, read_source};
use ndfmap::maps::{WriteOptions, atomic};
use ndfmap::render::{Device, RenderJob, render};
use ndfmap::report::contact_sheet;
use ndfmap::scene::Effort;
use ndfmap::{BakeJob, Error, SceneSpec};

use super::arguments::read_brdf;
use super::compare::{DEFAULT_METHODS, Measured, Run};
use super::{make_way, print, print_json, to_value};
use crate::tables;
use crate::terminal::Terminal;

/// Show what distance does to a built-in map, and what each method saves
#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder for the pictures, the report and a baked map
    #[arg(short, long, value_name = "DIR", default_value = "ndfmap-demo")]
    output: PathBuf,
}

/// Map of the demo, crumpled foil, the oldest example of all: shiny facets that dull with distance.
const MAP: &str = "builtin:foil";

/// Lobe of the demo, sharp enough to sparkle and wide enough for every method to represent.
const BRDF: &str = "blinn-phong:50";

/// Contact sheets of scenes: file, scene, and times.
const SHEETS: [(&str, &str, &[f64]); 2] =
    [("disk.png", "disk", &[0.1, 0.4, 0.7]), ("plane.png", "plane", &[0.0])];

/// Methods that they show beside the truth: what renderers use, what they might use, and ours.
const SHOWN: [&str; 3] = ["naive", "toksvig", "vmf:4"];

/// Contact sheet of a scene, as a PNG file.
fn sheet(scene: &str, times: &[f64], terminal: &Terminal) -> Result<Vec<u8>, Error> {
    let methods = SHOWN.iter().map(|m| m.parse()).collect::<Result<Vec<AnyMethod>, _>>()?;
    let spec = SceneSpec { scene: scene.to_owned(), ..SceneSpec::default() };
    let job = RenderJob {
        scene: &spec,
        times,
        methods: &methods,
        size: Size { width: 224, height: 224 },
        storage: Precision::Half.into(),
        lookups: Lookups::taps(Filtering::fine(16)),
        truth: Some(Effort { rays: 128, noise: 0.0, seed: 0 }),
        sparkle: false,
        keep: true,
        keep_drift: false,
    };
    contact_sheet(&render(&job, &Device::Cpu, terminal, &mut |_, _| Ok(()))?, scene, Theme::Light)
}

impl Demo {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let (start, terminal) = (Instant::now(), Terminal::default());
        let map = read_source(MAP.as_ref(), &SourceOptions::default())?;
        let mut methods = Vec::new();
        for spelling in DEFAULT_METHODS.split(',') {
            methods.push(spelling.parse()?);
        }
        let run = Run {
            map: &map,
            methods: &methods,
            baked: &[],
            engines: &[],
            brdf: &*read_brdf(BRDF)?,
            storage: Precision::Half.into(),
            filtering: false,
            pictures: None,
        };
        let Measured { comparison, mut written, .. } = run.measure(Some(&self.output), &terminal)?;
        for (name, scene, times) in SHEETS {
            let path = self.output.join(name);
            make_way(&path)?;
            atomic::write(&path, &sheet(scene, times, &terminal)?)?;
            written.push(path);
        }

        let path = self.output.join("foil.ktx2");
        make_way(&path)?;
        BakeJob::new(&map, DEFAULT_METHOD.parse::<AnyMethod>()?)
            .observer(&terminal)
            .save(&path, &WriteOptions::default())?;
        written.push(path);

        if json {
            let mut value = to_value(&comparison)?;
            value["files"] = written.iter().map(|f| f.display().to_string()).collect();
            value["seconds"] = start.elapsed().as_secs_f64().into();
            return print_json(&value);
        }
        let files: Vec<String> = written.iter().map(|f| format!("  {}", f.display())).collect();
        print(&format!(
            "{MAP}: crumpled foil that moves away. Level 0 is the map itself; at level 6 a texel covers\n\
             64 × 64 of its texels. 0 is perfect, 1 is as wrong as a black picture.\n\n{}\n\
             Written in {:.1} s; open the report in a browser:\n{}",
            tables::comparison(&comparison),
            start.elapsed().as_secs_f64(),
            files.join("\n")
        ))
    }
}
