//! `ndfmap bake`: a normal or height map in, a normal distribution map out.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use ndfmap_core::bake::{Bake as CoreBake, BakeReport};
use ndfmap_core::ndf::{AnyMethod, Method};
use ndfmap_core::pyramid;
use ndfmap_maps::attribute::{AttributeMap, Transfer, read_attribute};
use ndfmap_maps::formats::exr::{write_bumpslopes, write_native};
use ndfmap_maps::formats::ktx2::{Ktx2Sink, write_compressed};
use ndfmap_maps::source::{SourceMap, read_source};
use ndfmap_maps::{Header, MAX_ATTRIBUTES, NdfMap, VERSION};
use serde_json::json;

use super::arguments::{
    BuiltinSize, Precision, SourceArguments, brdf_spelling, method, method_spelling, methods_help, positive,
    read_brdf,
};
use super::{print, print_json, say_if_replaced, warn};
use crate::Failure;
use crate::auto::{AUTO, Auto, Choice, Limit};
use crate::progress::Progress;

/// Bake a normal or height map into a normal distribution map
#[derive(Debug, Args)]
#[command(after_long_help = methods_help())]
pub(super) struct Bake {
    /// The map: a picture file, or `builtin:NAME`
    map: PathBuf,
    /// The file to write: `.ktx2` or `.exr`
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// How to represent the normals; `--help` lists them. `auto` measures this map and chooses
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

/// What can be written, by the output's extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Target {
    Ktx2,
    Exr,
    Bumpslopes,
}

impl Target {
    fn name(self) -> &'static str {
        match self {
            Self::Ktx2 => "ktx2",
            Self::Exr => "exr",
            Self::Bumpslopes => "exr-bumpslopes",
        }
    }
}

/// A file, and how its values are to be taken.
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
    fn target(&self) -> Result<Target, Failure> {
        let extension = self.output.extension().map(|e| e.to_string_lossy().to_lowercase());
        match (extension.as_deref(), self.layout) {
            (Some("ktx2"), Layout::Native) => Ok(Target::Ktx2),
            (Some("exr"), Layout::Native) => Ok(Target::Exr),
            (Some("exr" | "tx"), Layout::Bumpslopes) if self.method == "slopes" => Ok(Target::Bumpslopes),
            (_, Layout::Bumpslopes) => Err(Failure::Usage(
                "the bumpslopes layout needs an output ending in .exr and `--method slopes`".to_owned(),
            )),
            _ => Err(Failure::Usage(format!("{}: maps are written as .ktx2 or .exr", self.output.display()))),
        }
    }

    /// Options that contradict each other, found before anything is read.
    fn check(&self, target: Target) -> Result<(), Failure> {
        let limited = self.max_error.is_some() || self.bytes_per_texel.is_some();
        let wrong = if self.method == AUTO && !limited {
            "`--method auto` needs `--max-error E` or `--bytes-per-texel B`".to_owned()
        } else if self.method != AUTO && limited {
            "`--max-error` and `--bytes-per-texel` are for `--method auto`".to_owned()
        } else if self.zstd.is_some() && target != Target::Ktx2 {
            "`--zstd` is for KTX2; an EXR is compressed as it is".to_owned()
        } else if self.attribute.len() > MAX_ATTRIBUTES {
            format!("at most {MAX_ATTRIBUTES} attributes are carried")
        } else {
            return Ok(());
        };
        Err(Failure::Usage(wrong))
    }

    /// The method asked for, or chosen by measuring.
    fn choose(&self, map: &SourceMap) -> Result<(AnyMethod, Option<Choice>), Failure> {
        if self.method != AUTO {
            return Ok((method(&self.method)?, None));
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
        let choice = asked.choose(limit)?;
        eprintln!("{}", choice.to_table());
        Ok((method(&choice.method)?, Some(choice)))
    }

    pub(super) fn run(self, json: bool) -> Result<(), Failure> {
        let target = self.target()?;
        self.check(target)?;
        let start = Instant::now();
        let map = read_source(&self.map, &self.source.options(self.builtin.size))?;
        let size = map.surface.size();
        let attributes = self.attribute.iter().map(|a| read_attribute(&a.path, a.transfer, size));
        let attributes = attributes.collect::<Result<Vec<AttributeMap>, _>>()?;
        let read = start.elapsed().as_secs_f64();
        for warning in &map.warnings {
            warn(&self.map, warning);
        }
        let (method, choice) = self.choose(&map)?;
        if !attributes.is_empty() && !method.carries_attributes() {
            return Err(Failure::Usage(format!(
                "`{}` has no lobes that carry attributes; `vmf` and `gmm` have",
                method
            )));
        }
        say_if_replaced(&self.output);
        let done = self.bake(target, &map, &*method, &attributes)?;
        let levels = ndfmap_core::pyramid::level_sizes(size).len();
        let layers = method.layers_with(attributes.len());
        if json {
            let mut value = json!({
                "method": method.to_string(),
                "width": size.width,
                "height": size.height,
                "levels": levels,
                "layers": layers,
                "format": target.name(),
                "bytes": done.bytes,
                "threads": rayon::current_num_threads(),
                "seconds": { "read": read, "bake": done.bake, "write": done.write },
                "warnings": map.warnings,
            });
            if let Some(choice) = choice {
                value["auto"] = choice.to_json();
            }
            return print_json(&value);
        }
        print(&format!(
            "{}: {} × {}, {levels} levels, {layers} layers of {}, {} bytes ({:.3} s read, {:.3} s bake, {:.3} s write)",
            self.output.display(),
            size.width,
            size.height,
            method,
            done.bytes,
            read,
            done.bake,
            done.write
        ))
    }

    fn bake(
        &self,
        target: Target,
        map: &SourceMap,
        method: &dyn Method,
        attributes: &[AttributeMap],
    ) -> Result<Done, Failure> {
        let progress = Progress::new(&method.to_string());
        // Bumpslopes of heights change their units, so they are rounded when written, and only then.
        let converts = target == Target::Bumpslopes && map.surface.has_height();
        let precision = if converts { pyramid::Precision::Single } else { self.precision.into() };
        let values: Vec<_> = attributes.iter().map(|a| a.values.clone()).collect();
        let bake =
            CoreBake::new(&*map.surface, method).precision(precision).attributes(&values).observer(&progress);
        let mut header = header_of(map, method);
        header.attributes = attributes.iter().map(|a| a.attribute.clone()).collect();
        let layout = bake.layout();
        let start = Instant::now();
        if target == Target::Ktx2 && self.zstd.is_none() {
            // Baked straight into the file, so its time counts as baking; what remains is the rename.
            let mut sink = Ktx2Sink::create(&self.output, &header, layout)?;
            let report = bake.run(&mut sink)?;
            refuse_overflow(report, &self.output)?;
            let baked = start.elapsed().as_secs_f64();
            let bytes = sink.finish()?;
            return Ok(Done { bytes, bake: baked, write: start.elapsed().as_secs_f64() - baked });
        }
        let (pyramid, report) = bake.to_pyramid()?;
        refuse_overflow(report, &self.output)?;
        let baked = start.elapsed().as_secs_f64();
        let map = NdfMap { header, pyramid };
        let bytes = match (target, self.zstd) {
            (Target::Bumpslopes, _) => write_bumpslopes(&self.output, &map, self.precision.into())?,
            (Target::Ktx2, Some(level)) => write_compressed(&self.output, &map, level)?,
            _ => write_native(&self.output, &map)?,
        };
        Ok(Done { bytes, bake: baked, write: start.elapsed().as_secs_f64() - baked })
    }
}

struct Done {
    bytes: u64,
    bake: f64,
    write: f64,
}

fn refuse_overflow(report: BakeReport, output: &Path) -> Result<(), Failure> {
    if report.overflowed == 0 {
        return Ok(());
    }
    let reason = "channels are too large for half floats (65504): use `--precision single` or a smaller `--height-scale`";
    Err(Failure::Failed(format!("{}: {} {reason}", output.display(), report.overflowed)))
}

/// The header of a map baked by `method`.
pub(super) fn header_of(map: &SourceMap, method: &dyn Method) -> Header {
    let size = map.surface.size();
    Header {
        version: VERSION,
        method: method.to_string(),
        width: size.width,
        height: size.height,
        wrap: Header::spell_wraps(map.surface.wraps()),
        encoding: method.encoding().name().to_owned(),
        attributes: Vec::new(),
        source: map.source.clone(),
    }
}
