//! `ndfmap gltf`: a model in, the same model with roughness mips that keep its look with distance out.

use std::path::{Path, PathBuf};
use std::str::FromStr as _;

use clap::{Args, ValueEnum};
use ndfmap::Error;
use ndfmap::asset::{AssetFix, AssetJob, Written, write};
use ndfmap::draw::Theme;
use ndfmap::maps::asset::{Asset, Form};
use ndfmap::maps::atomic;
use ndfmap::roughness::Origin;

use super::arguments::ZSTD;
use super::roughness::rules_help;
use super::{check_apart, make_way, print, print_json, say_written, to_value};
use crate::tables;
use crate::terminal::Terminal;
use crate::voice::{say, warn};

/// Give a glTF model roughness mips that keep its look with distance
#[derive(Debug, Args)]
#[command(after_long_help = rules_help())]
pub(super) struct Gltf {
    /// Model: `.glb`, or `.gltf` with its files
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// The model to write, in the form of the input, or a `.gltf` as one `.glb`; for `--for files` a folder
    #[arg(short, long, value_name = "FILE|FOLDER", required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    /// Readers of the model: `web` (KTX2 by KHR_texture_basisu, with a PNG for the others), `bevy` (KTX2
    /// where PNG stands, normal maps too), or `files` (loose textures, and no model)
    #[arg(long = "for", value_enum, ignore_case = true, default_value_t = Readers::Web)]
    readers: Readers,
    /// Fit or formula of an engine for every material, whatever it does; `--help` lists them
    #[arg(long, value_name = "NAME", value_parser = Origin::from_str)]
    rule: Option<Origin>,
    /// Also write pictures before and after into this PNG file
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Measure and say what would be done, and write no model and no texture
    #[arg(long)]
    dry_run: bool,
    /// Level of Zstandard, from 1 (fast) to 22; 0 writes textures plain [default: 3]
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, require_equals = true, default_missing_value = "3",
        value_parser = clap::value_parser!(i32).range(0..=22))]
    zstd: Option<i32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Readers {
    Web,
    Bevy,
    Files,
}

impl Gltf {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let mut asset = Asset::read(&self.model)?;
        let is = |path: &Path, form: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(form));
        if self.readers != Readers::Files && self.output.as_deref().is_some_and(|out| is(out, "glb")) {
            asset = asset.packed()?;
        }
        if let Some(report) = &self.report {
            check_apart([Some(report), Some(&self.model), self.output.as_ref()].into_iter().flatten())?;
            make_way(report)?;
        }
        let output = self.output.as_deref().filter(|_| !self.dry_run);
        if let Some(output) = output {
            self.check(&asset, output)?;
        }
        let fix = AssetJob { asset: &asset, by: self.rule }.run(&Terminal::default())?;
        for warning in &fix.report.warnings {
            warn(&self.model, warning);
        }
        if let Some(report) = &self.report {
            let name = self.model.file_name().unwrap_or_default().to_string_lossy();
            let title = format!("{name}: a sphere and a floor at the level that gains most");
            atomic::write(report, &fix.sheet(&title).draw(Theme::Light).to_png()?)?;
            say_written(std::slice::from_ref(report));
        }
        let written = output.map(|output| self.write(&asset, &fix, output)).transpose()?;
        if let Some(written) = &written {
            say_written(&written.files);
        }
        match (fix.report.fixed(), self.readers) {
            (_, Readers::Bevy) => {
                say(format_args!(
                    "for Bevy, every layer that was measured has KTX2, with plain mips if nothing is better"
                ));
            }
            (0, _) => say(format_args!("no texture is exchanged")),
            _ => {}
        }
        if !json {
            return print(&tables::gltf(&fix.report, written.as_ref()));
        }
        let mut value = to_value(&fix.report)?;
        value["written"] = to_value(&written)?;
        print_json(&value)
    }

    /// Refuses outputs that are not of the input's form, before the work, which takes minutes.
    fn check(&self, asset: &Asset, output: &Path) -> Result<(), Error> {
        let refuse = |why: &str| Err(Error::Request(format!("{}: {why}", output.display())));
        if self.readers == Readers::Files {
            return if output.is_file() { refuse("is a file; textures go into a folder") } else { Ok(()) };
        }
        let own = |path: &Path| path.canonicalize().ok();
        if own(output).is_some() && own(output) == own(&self.model) {
            return refuse("is the input, which is not touched: name another file");
        }
        let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase());
        match (asset.is_binary(), extension.as_deref()) {
            (true, Some("glb")) | (false, Some("gltf")) => {
                // Files beside the input that would meet others there are found now.
                asset.edited(&[], Form::Web, output)?;
                make_way(output)
            }
            (true, _) => refuse("a .glb is written as a .glb"),
            (false, _) => refuse("a .gltf is written as a .gltf with its files beside it, or as one .glb"),
        }
    }

    fn write(&self, asset: &Asset, fix: &AssetFix, output: &Path) -> Result<Written, Error> {
        let zstd = Some(self.zstd.unwrap_or(ZSTD)).filter(|level| *level > 0);
        let files = match self.readers {
            Readers::Web => fix.files(asset, Form::Web, zstd, output)?,
            Readers::Bevy => fix.files(asset, Form::Bevy, zstd, output)?,
            Readers::Files => fix.texture_files(output, zstd)?,
        };
        // Of the output itself it was said before the work.
        files.iter().map(|file| &*file.path).filter(|path| *path != output).try_for_each(make_way)?;
        write(files)
    }
}
