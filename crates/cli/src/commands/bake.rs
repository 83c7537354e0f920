//! `ndfmap bake`: a normal or height map in, a normal distribution map out.

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use ndfmap::choose::{Auto, Choice, Limit};
use ndfmap::core::ndf::{AnyMethod, Encoding};
use ndfmap::maps::attribute::{AttributeMap, Transfer, read_attribute};
use ndfmap::maps::formats::to_write;
use ndfmap::maps::source::SourceMap;
use ndfmap::maps::{ChannelLayout, MAX_ATTRIBUTES, WriteOptions};
use ndfmap::{BakeJob, BakeReport, Error};

use super::arguments::{
    BuiltinSize, Precision, SourceArguments, brdf_spelling, method_spelling, methods_help, positive,
    read_brdf,
};
use super::{print, print_json, say_if_replaced, warn};
use crate::tables;
use crate::terminal::Terminal;

/// Spelling that asks for a choice of method.
const AUTO: &str = "auto";

/// Bake a normal or height map into a normal distribution map
#[derive(Debug, Args)]
#[command(after_long_help = methods_help())]
pub(super) struct Bake {
    /// The map: a picture file, or `builtin:NAME`
    map: PathBuf,
    /// The file to write: `.ktx2` or `.exr`
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Method that represents the normals; `--help` lists them. `auto` measures this map and chooses
    #[arg(short, long, default_value = "slopes", value_parser = method_or_auto)]
    method: String,
    /// For `auto`: the cheapest method whose error is at most this
    #[arg(long, value_name = "E", value_parser = positive, conflicts_with = "bytes_per_texel")]
    max_error: Option<f64>,
    /// For `auto`: the method of least error that takes at most this many bytes a texel
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(1..))]
    bytes_per_texel: Option<u32>,
    /// For `auto`: the reflectance lobe errors are measured with
    #[arg(long, default_value = "blinn-phong:50", value_parser = brdf_spelling)]
    brdf: String,
    /// A picture of the map's size whose values each lobe is to carry, such as an albedo; `srgb:FILE` decodes
    /// colours. May be given several times
    #[arg(long, value_name = "[srgb:]FILE", value_parser = attribute_path)]
    attribute: Vec<AttributePath>,
    /// Bits of a stored channel
    #[arg(long, value_enum, default_value_t = Precision::Half)]
    precision: Precision,
    /// Compress a KTX2 with Zstandard, at a level from 1 (fast) to 22
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, default_missing_value = "3",
        value_parser = clap::value_parser!(i32).range(1..=22))]
    zstd: Option<i32>,
    /// Channels of an EXR: our RGBA layers, or OpenImageIO's six `bumpslopes` channels
    #[arg(long, value_enum, default_value_t = Layout::Native)]
    layout: Layout,
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    builtin: BuiltinSize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Layout {
    Native,
    Bumpslopes,
}

/// File of an attribute, with the transfer function of its values.
#[derive(Clone, Debug)]
struct AttributePath {
    path: PathBuf,
    transfer: Transfer,
}

fn attribute_path(text: &str) -> Result<AttributePath, String> {
    let (path, transfer) = match text.strip_prefix("srgb:") {
        Some(path) => (path, Transfer::Srgb),
        None => (text, Transfer::Linear),
    };
    if path.is_empty() {
        Err("names no file".to_owned())
    } else {
        Ok(AttributePath { path: path.into(), transfer })
    }
}

fn method_or_auto(text: &str) -> Result<String, String> {
    if text == AUTO { Ok(text.to_owned()) } else { method_spelling(text) }
}

impl Bake {
    /// Refuses options that contradict each other, before anything is read.
    fn check(&self) -> Result<(), Error> {
        let extension = self.output.extension().map(|e| e.to_string_lossy().to_lowercase());
        let extension = extension.as_deref().unwrap_or_default();
        let bumpslopes = self.layout == Layout::Bumpslopes;
        let limited = self.max_error.is_some() || self.bytes_per_texel.is_some();
        let slopes = |method: AnyMethod| method.encoding() == Encoding::SlopeMoments;
        let slopes = self.method.parse().is_ok_and(slopes);
        let wrong = if bumpslopes && (!["exr", "tx"].contains(&extension) || !slopes) {
            "the bumpslopes layout needs an output ending in .exr and `--method slopes`".to_owned()
        } else if let Err(unwritten) = to_write(&self.output) {
            unwritten.to_string()
        } else if !bumpslopes && extension == "tx" {
            format!("{}: a .tx file holds bumpslopes: name `--layout bumpslopes`", self.output.display())
        } else if self.method == AUTO && !limited {
            "`--method auto` needs `--max-error E` or `--bytes-per-texel B`".to_owned()
        } else if self.method != AUTO && limited {
            "`--max-error` and `--bytes-per-texel` are for `--method auto`".to_owned()
        } else if self.zstd.is_some() && extension != "ktx2" {
            "`--zstd` is for KTX2; an EXR is compressed as it is".to_owned()
        } else if self.attribute.len() > MAX_ATTRIBUTES {
            format!("at most {MAX_ATTRIBUTES} attributes are carried")
        } else {
            return Ok(());
        };
        Err(Error::Request(wrong))
    }

    /// Method that was asked for, or is chosen by measuring.
    fn choose(&self, map: &SourceMap, terminal: &Terminal) -> Result<(AnyMethod, Option<Choice>), Error> {
        if self.method != AUTO {
            return Ok((self.method.parse()?, None));
        }
        let limit = match (self.max_error, self.bytes_per_texel) {
            (Some(error), _) => Limit::Error(error),
            (None, Some(bytes)) => Limit::Bytes(bytes as usize),
            (None, None) => unreachable!("checked before the map was read"),
        };
        let brdf = read_brdf(&self.brdf)?;
        let asked = Auto {
            surface: &*map.surface,
            lobe: &*brdf,
            precision: self.precision.into(),
            lobes_only: !self.attribute.is_empty(),
        };
        let choice = asked.choose(limit, terminal)?;
        eprintln!("{}", tables::choice(&choice));
        Ok((choice.method.parse()?, Some(choice)))
    }

    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        self.check()?;
        let terminal = Terminal::default();
        let start = Instant::now();
        let map = self.source.read(&self.map, self.builtin.size)?;
        let size = map.surface.size();
        let attributes = self.attribute.iter().map(|a| read_attribute(&a.path, a.transfer, size));
        let attributes = attributes.collect::<Result<Vec<AttributeMap>, _>>()?;
        let read = start.elapsed().as_secs_f64();
        for warning in &map.warnings {
            warn(&self.map, warning);
        }
        let (method, choice) = self.choose(&map, &terminal)?;
        if !attributes.is_empty() && !method.carries_attributes() {
            let why = "has no lobes that carry attributes; `vmf` and `gmm` have";
            return Err(Error::Request(format!("`{method}` {why}")));
        }
        say_if_replaced(&self.output);
        let job = BakeJob::new(&map, method)
            .precision(self.precision.into())
            .attributes(&attributes)
            .observer(&terminal);
        let channels = match self.layout {
            Layout::Native => ChannelLayout::Native,
            Layout::Bumpslopes => ChannelLayout::Bumpslopes,
        };
        let options = WriteOptions { zstd: self.zstd, channels, ..WriteOptions::default() };
        let mut report = job.save(&self.output, &options)?;
        report.seconds.read = read;
        report.auto = choice;
        if json {
            return print_json(&report);
        }
        let BakeReport { method, width, height, levels, layers, bytes, seconds, .. } = &report;
        print(&format!(
            "{}: {width} × {height}, {levels} levels, {layers} layers of {method}, {bytes} bytes \
             ({:.3} s read, {:.3} s bake, {:.3} s write)",
            self.output.display(),
            seconds.read,
            seconds.bake,
            seconds.write
        ))
    }
}
