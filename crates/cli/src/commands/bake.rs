//! `ndfmap bake`: a normal or height map in, a normal distribution map out.

use std::collections::HashSet;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr as _;
use std::time::Instant;

use clap::{Args, ValueEnum};
use ndfmap::choose::{Auto, Choice, Limit};
use ndfmap::core::compact::Storage;
use ndfmap::core::ndf::{AnyMethod, DEFAULT_METHOD, Encoding};
use ndfmap::core::observe::{Observer, Unobserved};
use ndfmap::maps::attribute::{AttributeMap, Transfer, read_attribute};
use ndfmap::maps::formats::{is_picture, to_write};
use ndfmap::maps::source::{BUILTIN_PREFIX, SourceMap};
use ndfmap::maps::{ChannelLayout, MAX_ATTRIBUTES, MapError, WriteOptions};
use ndfmap::{BakeJob, BakeReport, Error};
use rayon::prelude::*;
use serde::Serialize;

use super::arguments::{
    BuiltinSize, STANDARD, STORAGE_HELP, SourceArguments, ZSTD, brdf_spelling, method_spelling, methods_help,
    positive, read_brdf,
};
use super::{make_folder, make_way, print, print_json};
use crate::tables;
use crate::terminal::Terminal;
use crate::voice::{detail, say};

/// Spelling that asks for a choice of method.
const AUTO: &str = "auto";

/// Bake a normal or height map into a normal distribution map
#[derive(Debug, Args)]
#[command(after_long_help = methods_help())]
pub(super) struct Bake {
    /// Maps: picture files, `builtin:NAME`, `-` for stdin, or folders of pictures; after one map, the file to
    /// write may follow
    #[arg(required = true, value_name = "MAP")]
    maps: Vec<PathBuf>,
    /// The file to write: `.ktx2` or `.exr`, or `-` for a KTX2 on stdout
    #[arg(short, long, value_name = "FILE", conflicts_with = "output_dir")]
    output: Option<PathBuf>,
    /// Folder to write into, a `.ktx2` (for bumpslopes, an `.exr`) for each map
    #[arg(long, value_name = "DIR")]
    output_dir: Option<PathBuf>,
    #[arg(short, long, value_parser = method_or_auto, help = format!("Method that represents the normals; `--help` \
        lists them. `auto` measures this map and chooses [default: {DEFAULT_METHOD}; for bumpslopes, slopes]"))]
    method: Option<String>,
    /// For `auto`: the cheapest method whose error is at most this
    #[arg(long, value_name = "E", value_parser = positive, conflicts_with = "bytes_per_texel")]
    max_error: Option<f64>,
    /// For `auto`: the method of least error that takes at most this many bytes a texel
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(1..))]
    bytes_per_texel: Option<u32>,
    /// For `auto`: the reflectance lobe errors are measured with [default: blinn-phong:50]
    #[arg(long, value_parser = brdf_spelling)]
    brdf: Option<String>,
    /// A picture of the map's size whose values each lobe is to carry, such as an albedo; `srgb:FILE` decodes
    /// colours. May be given several times
    #[arg(long, value_name = "[srgb:]FILE", value_parser = attribute_path)]
    attribute: Vec<AttributePath>,
    #[arg(long, value_parser = Storage::from_str, default_value_t, help = STORAGE_HELP)]
    precision: Storage,
    /// Leave out levels finer than this one: level 0 is the normal map itself, which a renderer has
    #[arg(long, value_name = "N", default_value_t = 0)]
    from_level: usize,
    /// Compress a KTX2 with Zstandard, at a level from 1 (fast) to 22; 0 writes it plain [default: 3]
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, require_equals = true, default_missing_value = "3",
        value_parser = clap::value_parser!(i32).range(0..=22))]
    zstd: Option<i32>,
    /// Channels of an EXR: our RGBA layers, or OpenImageIO's six `bumpslopes` channels
    #[arg(long, value_enum, ignore_case = true, default_value_t = Layout::Native)]
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
    if text.eq_ignore_ascii_case(AUTO) { Ok(AUTO.to_owned()) } else { method_spelling(text) }
}

/// Lobe that `auto` measures with, unless told otherwise.
const AUTO_LOBE: &str = "blinn-phong:50";

/// Map to be baked, and the file that it goes into.
#[derive(Clone, Debug)]
struct Pair {
    map: PathBuf,
    output: PathBuf,
    /// The map was found in a folder, not named.
    found: bool,
}

/// Outcome of one map among several, for scripts.
#[derive(Serialize)]
struct Outcome {
    map: String,
    output: String,
    #[serde(flatten)]
    report: Option<BakeReport>,
    /// Reason why there is no output.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    /// True for a picture of a folder that holds neither normals nor heights.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    no_map: bool,
}

impl Outcome {
    fn new(pair: &Pair, baked: Result<BakeReport, Error>) -> Self {
        let spelled = |path: &Path| path.display().to_string();
        let no_map = pair.found && matches!(baked, Err(Error::Map(MapError::NoMap { .. })));
        let error = baked.as_ref().err().map(ToString::to_string);
        Self { map: spelled(&pair.map), output: spelled(&pair.output), report: baked.ok(), error, no_map }
    }
}

impl Bake {
    /// Spelling of the method.
    fn method(&self) -> &str {
        let usual = if self.layout == Layout::Bumpslopes { "slopes" } else { DEFAULT_METHOD };
        self.method.as_deref().unwrap_or(usual)
    }

    /// Refuses options that contradict each other, before anything is read.
    fn check(&self, outputs: &[Pair]) -> Result<(), Error> {
        let bumpslopes = self.layout == Layout::Bumpslopes;
        let limited = self.max_error.is_some() || self.bytes_per_texel.is_some();
        let slopes = |method: AnyMethod| method.encoding() == Encoding::SlopeMoments;
        let slopes = self.method().parse().is_ok_and(slopes);
        let extension = |path: &Path| path.extension().map(|e| e.to_string_lossy().to_lowercase());
        for Pair { output, .. } in outputs.iter().filter(|pair| !is_standard(&pair.output)) {
            let extension = extension(output).unwrap_or_default();
            let wrong = if bumpslopes && (!["exr", "tx"].contains(&extension.as_str()) || !slopes) {
                "the bumpslopes layout needs an output ending in .exr and `--method slopes`".to_owned()
            } else if let Err(unwritten) = to_write(output) {
                unwritten.to_string()
            } else if !bumpslopes && extension == "tx" {
                format!("{}: a .tx file holds bumpslopes: name `--layout bumpslopes`", output.display())
            } else if self.zstd.is_some_and(|level| level > 0) && extension != "ktx2" {
                "`--zstd` is for KTX2; an EXR is compressed as it is".to_owned()
            } else {
                continue;
            };
            return Err(Error::Request(wrong));
        }
        let wrong = if self.method() == AUTO && !limited {
            "`--method auto` needs `--max-error E` or `--bytes-per-texel B`".to_owned()
        } else if self.method() != AUTO && limited {
            "`--max-error` and `--bytes-per-texel` are for `--method auto`".to_owned()
        } else if self.method() != AUTO && self.brdf.is_some() {
            "`--brdf` is for `--method auto`: a bake knows no BRDF".to_owned()
        } else if self.attribute.len() > MAX_ATTRIBUTES {
            format!("at most {MAX_ATTRIBUTES} attributes are carried")
        } else {
            return Ok(());
        };
        Err(Error::Request(wrong))
    }

    /// Maps and their outputs, as `MAP OUT`, `MAP -o OUT`, or `MAP... --output-dir DIR` name them.
    fn pairs(&self) -> Result<Vec<Pair>, Error> {
        if let Some(folder) = &self.output_dir {
            return self.pairs_into(folder);
        }
        let single = |map: &PathBuf, output: &PathBuf| {
            if output.is_dir() {
                let why = "is a folder: `--output-dir` writes into one";
                return Err(Error::Request(format!("{}: {why}", output.display())));
            }
            Ok(vec![Pair { map: map.clone(), output: output.clone(), found: false }])
        };
        match (&self.maps[..], &self.output) {
            ([map], _) if map.is_dir() => {
                let why = "is a folder: name `--output-dir DIR` for what its pictures are baked into";
                Err(Error::Request(format!("{}: {why}", map.display())))
            }
            ([map], Some(output)) => single(map, output),
            ([map, output], None) if to_write(output).is_ok() || is_standard(output) => single(map, output),
            ([map], None) => Err(Error::Request(format!(
                "name the file to write, as in `ndfmap bake {} {}`",
                map.display(),
                named_after(map, "ktx2").display()
            ))),
            (_, Some(output)) => Err(Error::Request(format!(
                "{}: is one output; several maps need `--output-dir DIR`, a folder to write into",
                output.display()
            ))),
            (maps, None) => {
                let why = maps.last().and_then(|last| to_write(last).err());
                let why = why.map(|e| format!("{e}; ")).unwrap_or_default();
                Err(Error::Request(format!(
                    "{why}several maps need `--output-dir DIR`, a folder to write into"
                )))
            }
        }
    }

    fn pairs_into(&self, folder: &Path) -> Result<Vec<Pair>, Error> {
        let extension = if self.layout == Layout::Bumpslopes { "exr" } else { "ktx2" };
        let mut pairs = Vec::new();
        let mut add = |map: PathBuf, found: bool| {
            let output = folder.join(named_after(&map, extension));
            pairs.push(Pair { map, output, found });
        };
        for map in &self.maps {
            if !map.is_dir() {
                add(map.clone(), false);
                continue;
            }
            let read = std::fs::read_dir(map).map_err(|e| MapError::io(map, e))?;
            let mut inside: Vec<PathBuf> = read.filter_map(|entry| Some(entry.ok()?.path())).collect();
            inside.retain(|path| path.is_file() && is_picture(path));
            if inside.is_empty() {
                return Err(Error::Request(format!("{}: holds no picture", map.display())));
            }
            inside.sort();
            inside.into_iter().for_each(|map| add(map, true));
        }
        let mut seen = HashSet::new();
        if let Some(twice) = pairs.iter().find(|pair| !seen.insert(&pair.output)) {
            let why = "would be written twice, for two maps of one name: bake them into two folders";
            return Err(Error::Request(format!("{}: {why}", twice.output.display())));
        }
        make_folder(folder)?;
        Ok(pairs)
    }

    /// Method that was asked for, or is chosen by measuring.
    fn choose(&self, map: &SourceMap, observer: &dyn Observer) -> Result<(AnyMethod, Option<Choice>), Error> {
        if self.method() != AUTO {
            return Ok((self.method().parse()?, None));
        }
        let limit = match (self.max_error, self.bytes_per_texel) {
            (Some(error), _) => Limit::Error(error),
            (None, Some(bytes)) => Limit::Bytes(bytes as usize),
            (None, None) => unreachable!("checked before the map was read"),
        };
        let brdf = read_brdf(self.brdf.as_deref().unwrap_or(AUTO_LOBE))?;
        let asked = Auto {
            surface: &*map.surface,
            lobe: &*brdf,
            storage: self.precision,
            lobes_only: !self.attribute.is_empty(),
        };
        let choice = asked.choose(limit, observer)?;
        say(tables::choice(&choice));
        Ok((choice.method.parse()?, Some(choice)))
    }

    /// Bakes one map.
    fn bake(
        &self,
        Pair { map: path, output, .. }: &Pair,
        observer: &dyn Observer,
    ) -> Result<BakeReport, Error> {
        let start = Instant::now();
        let map = self.source.read(path, &self.builtin)?;
        let size = map.surface.size();
        let attributes = self.attribute.iter().map(|a| read_attribute(&a.path, a.transfer, size));
        let attributes = attributes.collect::<Result<Vec<AttributeMap>, _>>()?;
        let read = start.elapsed().as_secs_f64();
        let (method, choice) = self.choose(&map, observer)?;
        if !attributes.is_empty() && !method.carries_attributes() {
            let why = "has no lobes that carry attributes; `vmf` and `gmm` have";
            return Err(Error::Request(format!("`{method}` {why}")));
        }
        let job = BakeJob::new(&map, method)
            .storage(self.precision)
            .from_level(self.from_level)
            .attributes(&attributes)
            .observer(observer);
        let channels = match self.layout {
            Layout::Native => ChannelLayout::Native,
            Layout::Bumpslopes => ChannelLayout::Bumpslopes,
        };
        let ktx2 = is_standard(output) || output.extension().is_some_and(|e| e.eq_ignore_ascii_case("ktx2"));
        let zstd = Some(self.zstd.unwrap_or(ZSTD)).filter(|level| ktx2 && *level > 0);
        let options = WriteOptions { zstd, channels, ..WriteOptions::default() };
        let mut report = if is_standard(output) {
            save_to_stdout(&job, &options)?
        } else {
            make_way(output)?;
            job.save(output, &options)?
        };
        report.seconds.read = read;
        report.auto = choice;
        let seconds = &report.seconds;
        detail(format_args!(
            "{}: {:.3} s read, {:.3} s bake, {:.3} s write",
            output.display(),
            seconds.read,
            seconds.bake,
            seconds.write
        ));
        Ok(report)
    }

    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let pairs = self.pairs()?;
        self.check(&pairs)?;
        let terminal = Terminal::default();
        if let ([pair], None) = (&pairs[..], &self.output_dir) {
            if is_standard(&pair.output) && std::io::stdout().is_terminal() {
                let why = "a map is nothing for a terminal: name a file, or send it to another program";
                return Err(Error::Request(why.to_owned()));
            }
            if is_standard(&pair.output) && json {
                return Err(Error::Request("`--json` and a map cannot both go to stdout".to_owned()));
            }
            let report = self.bake(pair, &terminal)?;
            if json {
                return print_json(&Outcome::new(pair, Ok(report)));
            }
            return match is_standard(&pair.output) {
                true => Ok(()),
                false => print(&tables::bake(&pair.output.display().to_string(), &report)),
            };
        }
        self.bake_all(pairs, &terminal, json)
    }

    /// Bakes several maps at once; one that fails stops no other.
    fn bake_all(&self, pairs: Vec<Pair>, terminal: &Terminal, json: bool) -> Result<(), Error> {
        let count = pairs.len();
        terminal.begin(&format!("bake {count} maps"));
        let done = std::sync::atomic::AtomicUsize::new(0);
        let bake = |pair: Pair| {
            let baked = self.bake(&pair, &Unobserved);
            let done = 1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            terminal.progress(done as f64 / count as f64);
            Outcome::new(&pair, baked)
        };
        let outcomes: Vec<Outcome> = pairs.into_par_iter().map(bake).collect();
        let failed = outcomes.iter().filter(|outcome| outcome.error.is_some() && !outcome.no_map).count();
        for outcome in &outcomes {
            match &outcome.error {
                Some(reason) if outcome.no_map => say(format_args!("left out: {reason}")),
                Some(reason) => eprintln!("ndfmap: failed: {reason}"),
                None => {}
            }
        }
        if json {
            print_json(&serde_json::json!({ "maps": super::to_value(&outcomes)? }))?;
        } else {
            let rows = outcomes.iter().filter_map(|o| Some(tables::bake(&o.output, o.report.as_ref()?)));
            print(&rows.collect::<Vec<_>>().join("\n"))?;
        }
        match failed {
            0 => Ok(()),
            failed => Err(Error::Failed(format!("{failed} of {count} maps could not be baked"))),
        }
    }
}

/// True for the name of stdin and stdout.
fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD
}

/// Name of an output after its map: `foil.ktx2` for `builtin:foil` and for `maps/foil.png`.
fn named_after(map: &Path, extension: &str) -> PathBuf {
    let name = map.to_str().and_then(|name| name.strip_prefix(BUILTIN_PREFIX)).map(Path::new).unwrap_or(map);
    let name = if is_standard(name) { Path::new("map") } else { name };
    Path::new(name.file_stem().unwrap_or_default()).with_added_extension(extension)
}

/// Saves a KTX2 beside the temporary files of the system, and sends it to stdout.
fn save_to_stdout(job: &BakeJob<'_>, options: &WriteOptions) -> Result<BakeReport, Error> {
    let failed = |e: std::io::Error| Error::Failed(format!("stdout: {e}"));
    let folder = tempfile::tempdir().map_err(failed)?;
    let path = folder.path().join("map.ktx2");
    let report = job.save(&path, options)?;
    let mut file = std::fs::File::open(&path).map_err(failed)?;
    let mut stdout = std::io::stdout().lock();
    match std::io::copy(&mut file, &mut stdout).and_then(|_| stdout.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(failed(e)),
        _ => Ok(report),
    }
}
