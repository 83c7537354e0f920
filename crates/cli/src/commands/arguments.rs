//! Arguments that several commands take, and their parsers.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, ValueEnum};
use ndfmap::core::brdf::{self, AnyLobe, LobeFactors, ParseLobeError};
use ndfmap::core::grid::Size;
use ndfmap::core::light::environment::{SceneEnvironment, Technique, builtin};
use ndfmap::core::ndf::{self, AnyMethod, ParseMethodError};
use ndfmap::core::surface::{SlopeFilter, Wrap, Wraps};
use ndfmap::inspect::{PictureReport, describe_picture};
use ndfmap::maps::environment::read_environment;
use ndfmap::maps::merl::read_merl;
use ndfmap::maps::model::is_model;
use ndfmap::maps::source::{
    BUILTIN_PREFIX, Convention, DEFAULT_HEIGHT_SCALE, SourceMap, SourceOptions, fit_height_scale,
    read_source, source_of_bytes,
};
use ndfmap::maps::{MapError, SourceKind};
use ndfmap::{Error, RotatingEnvironment, scene};
use serde_json::json;

use crate::voice::{detail, say, warn};

/// Reading of the source map.
#[derive(Debug, Args)]
#[command(next_help_heading = "Reading of the map")]
pub(super) struct SourceArguments {
    /// Layer, part or channel of an OpenEXR file that has several
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Take the map as normals or as heights [default: by what it looks like]
    #[arg(long, value_enum, ignore_case = true)]
    from: Option<From>,
    /// Direction of green in a normal map: up (opengl), down (directx), or as its slopes and name tell
    #[arg(long, value_enum, ignore_case = true, default_value_t = ConventionArgument::Auto)]
    convention: ConventionArgument,
    /// Height of one unit (full white), in texture widths; `auto` fits it to `--normal-map`
    #[arg(long, value_name = "S", value_parser = HeightScale::from_str, allow_negative_numbers = true,
        help = format!("Height of one unit (full white), in texture widths; `auto` fits it to `--normal-map` \
            [default: {DEFAULT_HEIGHT_SCALE}]"))]
    height_scale: Option<HeightScale>,
    /// Normal map of the same surface, whose slopes `--height-scale auto` fits
    #[arg(long, value_name = "FILE")]
    normal_map: Option<PathBuf>,
    /// White is deep: the height map is a depth map
    #[arg(long)]
    invert: bool,
    /// Derivative that takes slopes from heights
    #[arg(long, value_enum, ignore_case = true, default_value_t = FilterArgument::Central)]
    slope_filter: FilterArgument,
    /// Continuation beyond the edges: `repeat`, `clamp`, or one for each axis as in `repeat,clamp`
    #[arg(long, value_name = "X[,Y]", default_value = "repeat", value_parser = wraps)]
    wrap: Wraps,
}

/// Size of built-in maps.
#[derive(Debug, Args)]
#[command(next_help_heading = "Reading of the map")]
pub(super) struct BuiltinSize {
    /// Size of built-in maps, as in 512 or 640x480 [default: 512]
    #[arg(long, value_name = "SIZE", value_parser = size)]
    pub(super) map_size: Option<Size>,
}

/// Level of Zstandard, unless told otherwise: the library's own default.
pub(super) const ZSTD: i32 = 3;

/// Name that stands for stdin and stdout.
pub(super) const STANDARD: &str = "-";

/// Size of built-in maps, unless told otherwise.
const BUILTIN_SIZE: Size = Size { width: 512, height: 512 };

#[derive(Clone, Copy, Debug, ValueEnum)]
enum From {
    Normal,
    Height,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ConventionArgument {
    Auto,
    Opengl,
    Directx,
}

/// Scale of heights: a number, or the one that fits a normal map.
#[derive(Clone, Copy, Debug)]
enum HeightScale {
    Fitted,
    Given(f64),
}

impl FromStr for HeightScale {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.to_lowercase().as_str() {
            "auto" => Ok(Self::Fitted),
            number => positive(number).map(Self::Given),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FilterArgument {
    Central,
    Sobel,
    /// Mean and spread of the surface between the heights, over each texel
    Bilinear,
}

impl SourceArguments {
    /// Warns where options say how to read a picture, of a file that is none.
    pub(super) fn warn_if_given(&self, file: &Path, what: &str) {
        let given = self.layer.is_some()
            || self.from.is_some()
            || self.convention != ConventionArgument::Auto
            || self.height_scale.is_some()
            || self.normal_map.is_some()
            || self.invert
            || self.slope_filter != FilterArgument::Central
            || self.wrap != Wraps::default();
        if given {
            warn(file, &format!("is {what}: options for the reading of pictures do nothing"));
        }
    }

    /// Reads the map, at a height scale that fits the normal map beside it where that is asked for.
    pub(super) fn read(&self, map: &Path, builtin: &BuiltinSize) -> Result<SourceMap, Error> {
        let options = self.fitted(map, builtin)?;
        let read = match map.to_str() {
            Some(STANDARD) => {
                let mut bytes = Vec::new();
                std::io::stdin().lock().read_to_end(&mut bytes).map_err(|e| MapError::io(map, e))?;
                source_of_bytes(map, &bytes, &options)?
            }
            _ => read_source(map, &options)?,
        };
        read.warnings.iter().for_each(|warning| warn(map, warning));
        if let Some(evidence) = read.convention {
            detail(format_args!("{}: {evidence}", map.display()));
        }
        Ok(read)
    }

    /// Describes a picture.
    pub(super) fn describe(&self, picture: &Path, builtin: &BuiltinSize) -> Result<PictureReport, Error> {
        describe_picture(picture, &self.fitted(picture, builtin)?)
    }

    /// Options in the library's form, for a map and for built-in maps of this size.
    fn fitted(&self, map: &Path, builtin: &BuiltinSize) -> Result<SourceOptions, Error> {
        let options = self.options(builtin.map_size.unwrap_or(BUILTIN_SIZE));
        let is_builtin = map.to_str().is_some_and(|name| name.starts_with(BUILTIN_PREFIX));
        if builtin.map_size.is_some() && !is_builtin {
            warn(map, "is not built in: `--map-size` does nothing");
        }
        let Some(HeightScale::Fitted) = self.height_scale else {
            if self.normal_map.is_some() {
                warn(map, "is not fitted to `--normal-map`, as `--height-scale auto` is not there");
            }
            return Ok(options);
        };
        let Some(normals) = &self.normal_map else {
            let reason = "--height-scale auto needs the normal map of the same surface, as --normal-map FILE";
            return Err(Error::Request(reason.to_owned()));
        };
        let fit = fit_height_scale(map, normals, &options)?;
        let (scale, correlation) = (fit.scale, fit.correlation);
        let deep = if fit.invert { ", white deep" } else { "" };
        say(format_args!(
            "{}: height scale {scale:.4}{deep} fits the normal map (slopes correlate by {correlation:.2})",
            map.display()
        ));
        Ok(SourceOptions { height_scale: Some(scale), invert: fit.invert, ..options })
    }

    fn options(&self, builtin_size: Size) -> SourceOptions {
        SourceOptions {
            layer: self.layer.clone(),
            kind: self.from.map(|from| match from {
                From::Normal => SourceKind::Normal,
                From::Height => SourceKind::Height,
            }),
            convention: match self.convention {
                ConventionArgument::Auto => None,
                ConventionArgument::Opengl => Some(Convention::OpenGl),
                ConventionArgument::Directx => Some(Convention::DirectX),
            },
            height_scale: match self.height_scale {
                Some(HeightScale::Given(scale)) => Some(scale),
                Some(HeightScale::Fitted) | None => None,
            },
            invert: self.invert,
            slope_filter: match self.slope_filter {
                FilterArgument::Central => SlopeFilter::CentralDifference,
                FilterArgument::Sobel => SlopeFilter::Sobel,
                FilterArgument::Bilinear => SlopeFilter::Bilinear,
            },
            wraps: self.wrap,
            builtin_size,
        }
    }
}

/// Help of `--precision`, the storage of a channel.
pub(super) const STORAGE_HELP: &str = "Storage of a channel: `half` or `single` floats; or integers in the range \
    that the map's own values fill, `unorm8`, `unorm10` or `unorm16`";

/// Light from everywhere.
#[derive(Debug, Args)]
#[command(next_help_heading = "Light from everywhere")]
pub(super) struct EnvironmentArguments {
    /// Light the scene by an environment in place of its own lights: a float picture (.hdr, .exr) by latitude
    /// and longitude or of a cube, or `builtin:NAME`
    #[arg(long, value_name = "FILE", requires = "scene")]
    environment: Option<PathBuf>,
    /// Turn the environment around the vertical, in degrees; with two numbers, from one to the other as time
    /// goes from 0 to 1
    #[arg(long, value_name = "DEGREES[,TO]", value_parser = turn, allow_hyphen_values = true, requires = "environment")]
    turn: Option<[f64; 2]>,
    /// Environment as highlights see it: cubes that microfacets have blurred (prefiltered), or Han et
    /// al.'s series over half-vectors (harmonics)
    #[arg(long, value_name = "HOW", default_value = "prefiltered", value_parser = Technique::from_str, requires = "environment")]
    environment_light: Technique,
}

impl EnvironmentArguments {
    /// Reads and prepares the environment, if one was asked for.
    pub(super) fn read(&self) -> Result<Option<RotatingEnvironment>, Error> {
        let Some(path) = &self.environment else { return Ok(None) };
        let (environment, warnings) = read_environment(path)?;
        warnings.iter().for_each(|w| warn(path, w));
        let environment =
            SceneEnvironment { technique: self.environment_light, ..SceneEnvironment::new(environment) };
        let suns = &environment.filtered.suns;
        if !suns.lights.is_empty() {
            let (count, percent) = (suns.lights.len(), 100.0 * suns.share);
            let name = path.display();
            let sources = if count == 1 { "source shines as a light" } else { "sources shine as lights" };
            say(format_args!(
                "{name}: {count} small bright {sources} of its own: {percent:.1} % of all light"
            ));
        }
        Ok(Some(RotatingEnvironment {
            environment,
            rotation: self.turn.unwrap_or_default().map(f64::to_radians),
        }))
    }
}

impl EnvironmentArguments {
    /// JSON of the environment, for scripts.
    pub(super) fn to_json(&self, read: &RotatingEnvironment) -> serde_json::Value {
        let suns = &read.environment.filtered.suns;
        json!({
            "file": self.environment,
            "technique": self.environment_light.name(),
            "turn": read.rotation.map(f64::to_degrees),
            "suns": suns.lights.len(),
            "suns_share": suns.share,
        })
    }
}

fn turn(text: &str) -> Result<[f64; 2], String> {
    let degrees = |t: &str| match t.parse::<f64>() {
        Ok(v) if v.abs() <= 1e6 => Ok(v),
        _ => Err(format!("`{t}` is no number of degrees")),
    };
    match text.split(',').collect::<Vec<_>>()[..] {
        [one] => Ok([degrees(one)?; 2]),
        [from, to] => Ok([degrees(from)?, degrees(to)?]),
        _ => Err("one number of degrees, or two".to_owned()),
    }
}

/// List of every built-in environment, for `--help`.
pub(super) fn environments_help() -> String {
    let rows = builtin::TABLE.iter().map(|r| format!("  {:12} {}", r.name, r.summary));
    format!("Built-in environments (`builtin:NAME`):\n{}", rows.collect::<Vec<_>>().join("\n"))
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.is_finite() && v > 0.0 => Ok(v),
        _ => Err("must be a number above 0".to_owned()),
    }
}

fn wraps(text: &str) -> Result<Wraps, String> {
    let wrap =
        |word: &str| word.parse::<Wrap>().map_err(|_| format!("`{word}` is neither `repeat` nor `clamp`"));
    match text.split(',').collect::<Vec<_>>()[..] {
        [both] => Ok(Wraps { x: wrap(both)?, y: wrap(both)? }),
        [x, y] => Ok(Wraps { x: wrap(x)?, y: wrap(y)? }),
        _ => Err("one word for both axes, or one for each".to_owned()),
    }
}

/// Largest side of a built-in map, and of a picture.
const MAX_BUILTIN: usize = 8192;

pub(super) fn size(text: &str) -> Result<Size, String> {
    let side = |t: &str| match t.parse::<usize>() {
        Ok(n @ 1..=MAX_BUILTIN) => Ok(n),
        _ => Err(format!("`{t}` is no side from 1 to {MAX_BUILTIN}")),
    };
    match text.split_once('x') {
        Some((w, h)) => Ok(Size { width: side(w)?, height: side(h)? }),
        None => side(text).map(|n| Size { width: n, height: n }),
    }
}

/// Checks a method's spelling; an unknown one suggests the nearest.
pub(super) fn method_spelling(text: &str) -> Result<String, String> {
    match text.parse::<AnyMethod>() {
        Ok(_) => Ok(text.to_owned()),
        Err(ParseMethodError::Unknown(name)) => Err(unknown(&name, ndf::TABLE.iter().map(|r| r.name))),
        Err(other) => Err(other.to_string()),
    }
}

/// Prefix in the spelling of a measured lobe, before its file.
const MERL: &str = "merl:";

/// Checks a BRDF's spelling; an unknown one suggests the nearest. Files are for [`read_brdf`] to check.
pub(super) fn brdf_spelling(text: &str) -> Result<String, String> {
    if text.eq_ignore_ascii_case("merl") || text == MERL {
        return Err("a file must follow, as in `merl:FILE`".to_owned());
    }
    if text.starts_with(MERL) {
        return Ok(text.to_owned());
    }
    match text.parse::<AnyLobe>() {
        Ok(_) => Ok(text.to_owned()),
        Err(ParseLobeError::Unknown(name)) => {
            Err(unknown(&name, brdf::TABLE.iter().chain(brdf::ALIASES).map(|r| r.name).chain(["merl"])))
        }
        Err(other) => Err(other.to_string()),
    }
}

/// Reads the lobe of a checked spelling. For a measured one it prints what its factors leave out.
pub(super) fn read_brdf(spelling: &str) -> Result<AnyLobe, Error> {
    let lobe: AnyLobe = match spelling.strip_prefix(MERL) {
        Some(file) => {
            let (lobe, missing) = read_merl(file.as_ref())?;
            if missing > 0 {
                warn(file.as_ref(), &format!("{missing} values are negative or no number, and left out"));
            }
            lobe.into()
        }
        None => spelling.parse::<AnyLobe>().map_err(|e| Error::Request(e.to_string()))?,
    };
    if let Some(measured) = lobe.measured() {
        let LobeFactors { residual, channels, .. } = measured.factors();
        let [factored, fitted] = [residual.factored, residual.fitted].map(|left| 100.0 * left);
        let kernels = channels.each_ref().map(|channel| channel.kernels.len());
        let [red, green, blue] = kernels;
        say(format_args!(
            "{spelling}: kd + f(theta_h) g(theta_d) leaves {factored:.1} % of the table, and f as {red}, {green} and \
             {blue} kernels {fitted:.1} %"
        ));
    }
    Ok(lobe)
}

/// Checks the name of a scene; a name neither built in nor like a model's file suggests the nearest.
pub(super) fn scene_name(text: &str) -> Result<String, String> {
    if scene::find(text).is_some() || is_model(text.as_ref()) {
        return Ok(text.to_owned());
    }
    if let Some(reason) = no_scene(text.as_ref()) {
        return Err(format!("{text}: {reason}"));
    }
    let models: Vec<&str> = ndfmap::maps::model::TABLE.iter().flat_map(|f| f.extensions).copied().collect();
    let nearest = unknown(text, scene::TABLE.iter().map(|r| r.name));
    Err(format!("{nearest}, and models: .{}", models.join(", .")))
}

/// Reason why a file is no scene, and what to do about it; `None` for a name that is no file's.
fn no_scene(path: &Path) -> Option<String> {
    if path.is_dir() {
        return Some("is a folder: name the model in it".to_owned());
    }
    let name = path.file_name()?.to_string_lossy().to_lowercase();
    if name.ends_with(".gz") || name.ends_with(".zip") || name.ends_with(".7z") {
        return Some("is packed: unpack it first".to_owned());
    }
    let program = match name.rsplit_once('.')?.1 {
        "blend" => "a Blender file: in Blender, File > Export > glTF 2.0",
        "usd" | "usda" | "usdc" | "usdz" => "a USD file: export glTF 2.0",
        "max" => "a 3ds Max file: export glTF 2.0 or FBX",
        "ma" | "mb" => "a Maya file: export glTF 2.0 or FBX",
        "c4d" | "skp" | "3dm" | "step" | "stp" | "iges" => {
            "a file of its own program: export glTF 2.0 or FBX"
        }
        "dae" | "3ds" | "stl" | "x3d" | "abc" | "vrm" => {
            "of a format that is not read: convert it to glTF 2.0"
        }
        _ if path.exists() => "no model of a known format: convert it to glTF 2.0",
        _ => return None,
    };
    Some(format!("is {program}"))
}

/// Says that a name is unknown, and which is nearest.
pub(super) fn unknown(name: &str, known: impl Iterator<Item = &'static str> + Clone) -> String {
    // A nearest name below 0.7 is not near.
    let near = known.clone().filter(|k| strsim::jaro_winkler(name, k) > 0.7);
    let nearest = near.max_by(|a, b| strsim::jaro_winkler(name, a).total_cmp(&strsim::jaro_winkler(name, b)));
    let all = known.collect::<Vec<_>>().join(", ");
    match nearest {
        Some(nearest) => format!("there is no `{name}`; did you mean `{nearest}`? There are {all}"),
        None => format!("there is no `{name}`; there are {all}"),
    }
}

/// List of every method with its parameters and summary, and of every built-in map, for `--help`.
pub(super) fn methods_help() -> String {
    let rows = ndf::TABLE.iter().map(|r| {
        let also = match r.aliases {
            [] => String::new(),
            names => format!("; also {}", names.join(", ")),
        };
        format!("  {}{}\n      {} ({}){also}", r.name, r.parameters, r.summary, r.paper)
    });
    format!(
        "Methods:\n{}\n\nBuilt-in maps (`builtin:NAME`):\n{}",
        rows.collect::<Vec<_>>().join("\n"),
        builtin_help()
    )
}

fn builtin_help() -> String {
    let rows = ndfmap::core::procedural::TABLE.iter().map(|r| format!("  {:12} {}", r.name, r.summary));
    rows.collect::<Vec<_>>().join("\n")
}

/// List of every BRDF with its parameter and summary, for `--help`.
pub(super) fn brdfs_help() -> String {
    let rows = brdf::TABLE
        .iter()
        .chain(brdf::ALIASES)
        .map(|r| format!("  {}{}\n      {}", r.name, r.parameter, r.summary));
    let merl = "  merl:FILE\n      a file of measurements in the MERL format (.binary), factored, in its own colours".to_owned();
    format!("BRDFs:\n{}", rows.chain([merl]).collect::<Vec<_>>().join("\n"))
}
