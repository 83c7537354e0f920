//! `ndfmap bake`: a normal or height map in, a normal distribution map out.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use ndfmap_core::bake::{Bake as CoreBake, BakeReport};
use ndfmap_core::ndf::Method;
use ndfmap_core::pyramid;
use ndfmap_maps::formats::exr::{write_bumpslopes, write_native};
use ndfmap_maps::formats::ktx2::Ktx2Sink;
use ndfmap_maps::source::{SourceMap, read_source};
use ndfmap_maps::{Header, NdfMap, VERSION};
use serde_json::json;

use super::arguments::{Precision, SourceArguments, method, method_spelling, methods_help};
use super::{print, print_json, say_if_replaced, warn};
use crate::Failure;
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
    /// How to represent the normals; `--help` lists them
    #[arg(short, long, default_value = "slopes", value_parser = method_spelling)]
    method: String,
    /// Bits of a stored channel
    #[arg(long, value_enum, default_value_t = Precision::Half)]
    precision: Precision,
    /// Channels of an EXR: our RGBA layers, or OpenImageIO's six `bumpslopes` channels
    #[arg(long, value_enum, default_value_t = Layout::Native)]
    layout: Layout,
    #[command(flatten)]
    source: SourceArguments,
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

    pub(super) fn run(self, json: bool) -> Result<(), Failure> {
        let target = self.target()?;
        let method = method(&self.method)?;
        let start = Instant::now();
        let map = read_source(&self.map, &self.source.options())?;
        let read = start.elapsed().as_secs_f64();
        for warning in &map.warnings {
            warn(&self.map, warning);
        }
        say_if_replaced(&self.output);
        let done = self.bake(target, &map, &*method)?;
        let size = map.surface.size();
        let levels = ndfmap_core::pyramid::level_sizes(size).len();
        if json {
            return print_json(&json!({
                "method": method.spelling(),
                "width": size.width,
                "height": size.height,
                "levels": levels,
                "layers": method.layers(),
                "format": target.name(),
                "bytes": done.bytes,
                "threads": rayon::current_num_threads(),
                "seconds": { "read": read, "bake": done.bake, "write": done.write },
                "warnings": map.warnings,
            }));
        }
        print(&format!(
            "{}: {} × {}, {levels} levels, {} layers of {}, {} bytes ({:.3} s read, {:.3} s bake, {:.3} s write)",
            self.output.display(),
            size.width,
            size.height,
            method.layers(),
            method.spelling(),
            done.bytes,
            read,
            done.bake,
            done.write
        ))
    }

    fn bake(&self, target: Target, map: &SourceMap, method: &dyn Method) -> Result<Done, Failure> {
        let progress = Progress::new(&method.spelling());
        // Bumpslopes of heights change their units, so they are rounded when written, and only then.
        let converts = target == Target::Bumpslopes && map.surface.has_height();
        let precision = if converts { pyramid::Precision::Single } else { self.precision.into() };
        let bake = CoreBake { surface: &*map.surface, method, precision, progress: &|f| progress.set(f) };
        let header = header_of(map, method);
        let start = Instant::now();
        if target == Target::Ktx2 {
            // Baked straight into the file, so its time counts as baking; what remains is the rename.
            let mut sink = Ktx2Sink::create(&self.output, &header, bake.layout())?;
            let report = bake.run(&mut sink)?;
            refuse_overflow(report, &self.output)?;
            let baked = start.elapsed().as_secs_f64();
            let bytes = sink.finish()?;
            return Ok(Done { bytes, bake: baked, write: start.elapsed().as_secs_f64() - baked });
        }
        let (pyramid, report) = bake.to_pyramid();
        refuse_overflow(report, &self.output)?;
        let baked = start.elapsed().as_secs_f64();
        let map = NdfMap { header, pyramid };
        let bytes = match target {
            Target::Bumpslopes => write_bumpslopes(&self.output, &map, self.precision.into())?,
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
        method: method.spelling(),
        width: size.width,
        height: size.height,
        wrap: Header::spell_wraps(map.surface.wraps()),
        encoding: method.encoding().to_owned(),
        attributes: Vec::new(),
        source: map.source.clone(),
    }
}
