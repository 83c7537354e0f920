//! `ndfmap render`: pictures of a scene, through baked maps and by brute force, and their differences.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use clap::{Args, ValueEnum};
use glam::DVec3;
use ndfmap::core::brdf::ShadingModel;
use ndfmap::core::compact::Storage;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::light::Light;
use ndfmap::core::lookup::{Filtering, Lookups, Sampling};
use ndfmap::core::ndf::{AnyMethod, DEFAULT_METHOD};
use ndfmap::core::observe::Observer;
use ndfmap::draw::Theme;
use ndfmap::maps::atomic;
use ndfmap::maps::formats::{WritePicture, picture_writer};
use ndfmap::maps::formats::{read_file, read_ndf};
use ndfmap::maps::picture::write_picture;
use ndfmap::maps::source::BUILTIN_PREFIX;
use ndfmap::render::{self, Frame, RenderJob, RenderReport};
use ndfmap::report::{SheetPlan, contact_sheet};
use ndfmap::scene::tone::Tone;
use ndfmap::scene::{BakedSurface, Effort};
use ndfmap::{CameraSpec, DisplacementOptions, Error, SceneSpec, scene};
use serde_json::{Map, Value, json};

use super::arguments::{
    BuiltinSize, EnvironmentArguments, STORAGE_HELP, SourceArguments, brdf_spelling, brdfs_help,
    environments_help, method_spelling, methods_help, positive, read_brdf, scene_name, size,
};
use super::{
    check_apart, check_kept, make_way, print, print_json, say_written, to_value, warn_of_missing_levels,
};
#[cfg(feature = "gpu")]
use crate::hushed::hushed;
use crate::tables;
use crate::terminal::Terminal;
use crate::voice::{say, warn};

/// Render a scene through baked maps, and by brute force to compare
#[derive(Debug, Args)]
#[command(after_long_help = [scenes_help(), methods_help(), brdfs_help(), environments_help()].join("\n\n"))]
pub(super) struct Render {
    /// A built-in scene, or a model: .gltf, .glb, .fbx, .obj or .ply
    #[arg(long, value_name = "NAME|FILE", value_parser = scene_name)]
    scene: String,
    /// A normal or height map, `builtin:NAME`, or a baked map, for the scene's first material
    #[arg(long)]
    map: Option<PathBuf>,
    /// Material of a model that `--map`, `--diffuse` and `--specular` are for [default: that of its first
    /// mesh]
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// The picture to write, by the first method: .png as shown, .exr in linear light; several frames are
    /// numbered
    #[arg(short, long, value_name = "FILE", required_unless_present_any = ["compare", "truth_output", "json"])]
    output: Option<PathBuf>,
    #[arg(short, long, value_delimiter = ',', value_parser = method_spelling, help = format!("Methods, separated by commas \
        [default: {DEFAULT_METHOD}; displaced, slopes; or a baked map's own]"))]
    method: Vec<String>,
    /// Render the truth too, with this many rays a pixel (a multiple of 32, rounded up), and measure against
    /// it
    #[arg(long, value_name = "RAYS", num_args = 0..=1, require_equals = true, default_missing_value = "256",
        value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    truth: Option<u32>,
    /// Stop the truth once its noise (relative L2) is below this
    #[arg(long, value_name = "X", value_parser = positive, requires = "truth")]
    truth_noise: Option<f64>,
    /// Write the truth's picture
    #[arg(long, value_name = "FILE", requires = "truth")]
    truth_output: Option<PathBuf>,
    /// Write a contact sheet: truth, each method, differences and errors
    #[arg(long, value_name = "SHEET.png")]
    compare: Option<PathBuf>,
    /// Draw the contact sheet on dark paper
    #[arg(long, requires = "compare")]
    dark: bool,
    /// Also measure how each method sparkles as the camera drifts by a pixel; 17 more pictures each
    #[arg(long, requires = "truth")]
    sparkle: bool,
    /// Size of the picture, as in 500 or 640x480
    #[arg(long, value_name = "SIZE", default_value = "500", value_parser = size)]
    size: Size,
    /// When: 0 to 1, or several times separated by commas
    #[arg(long, value_delimiter = ',', default_value = "0", value_parser = time)]
    time: Vec<f64>,
    /// This many frames from time 0 to 1, in place of `--time`
    #[arg(long, value_name = "N", conflicts_with = "time", value_parser = clap::value_parser!(u16).range(1..=10_000))]
    frames: Option<u16>,
    /// Where the camera is and looks: EX,EY,EZ,TX,TY,TZ and perhaps its angle of view in degrees
    #[arg(long, value_name = "NUMBERS", value_parser = camera, allow_hyphen_values = true)]
    camera: Option<CameraSpec>,
    /// Factor on the camera's distance from what it looks at: 4 makes things a quarter as large
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    distance: Option<f64>,
    /// A light in place of the scene's: the direction to it X,Y,Z, or `point:X,Y,Z`, and perhaps :R,G,B. May
    /// be repeated
    #[arg(long, value_name = "LIGHT", value_parser = light, allow_hyphen_values = true)]
    light: Vec<Light>,
    /// A reflectance lobe in place of the materials' own; where a material has roughness of its own, that
    /// still widens it
    #[arg(long, value_parser = brdf_spelling)]
    brdf: Option<String>,
    /// Shading model around the lobe: the factor of Tan et al., of Han et al. or of Smith (tan, han, smith);
    /// or what displaced surfaces have (masked, shadowed)
    #[arg(long, value_parser = ShadingModel::from_str, conflicts_with = "displace")]
    model: Option<ShadingModel>,
    #[command(flatten)]
    displace: DisplaceArguments,
    #[command(flatten)]
    environment: EnvironmentArguments,
    /// Diffuse albedo R,G,B of the first material, in place of its own; its textures go
    #[arg(long, value_name = "R,G,B", value_parser = colour)]
    diffuse: Option<DVec3>,
    /// Reflectance R,G,B at normal incidence of the first material, in place of its own; its textures go
    #[arg(long, value_name = "R,G,B", value_parser = colour)]
    specular: Option<DVec3>,
    #[command(flatten)]
    filter: FilterArguments,
    /// Display values are sRGB of light times this
    #[arg(long, value_parser = positive)]
    exposure: Option<f64>,
    /// Tone curve that brings highlights into the range of the PNG that `-o` writes: cut off (clip), or
    /// compressed (reinhard)
    #[arg(long, default_value = "clip", value_parser = Tone::from_str)]
    tone: Tone,
    /// Device that renders
    #[arg(long, value_enum, ignore_case = true, default_value_t = Device::Auto)]
    device: Device,
    /// The GPU's own sampler filters maps in place of `--filter`: trilinear, or with up to TAPS taps
    #[arg(long, value_name = "TAPS", num_args = 0..=1, require_equals = true, default_missing_value = "1", conflicts_with_all = ["neighbours", "filter", "lod_bias"],
        value_parser = clap::value_parser!(u16).range(1..=16))]
    sampler: Option<u16>,
    /// The GPU smooths outlines by four samples a pixel, as applications do, in place of 4 x 4 parts
    #[arg(long)]
    multisample: bool,
    #[arg(long, value_parser = Storage::from_str, default_value_t, help = STORAGE_HELP)]
    precision: Storage,
    #[command(flatten)]
    builtin: BuiltinSize,
    #[command(flatten)]
    source: SourceArguments,
}

/// Displacement of the meshes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Displacement")]
pub(super) struct DisplaceArguments {
    /// Height maps displace what they lie on, by SCALE times what keeps their slopes; lobes become
    /// microfacets, and the truth is that of the displaced surface
    #[arg(long, value_name = "SCALE", num_args = 0..=1, require_equals = true, default_missing_value = "1", value_parser = scale,
        allow_negative_numbers = true, requires = "scene")]
    displace: Option<f64>,
    /// Facets of displaced surfaces shade each other. The truth has every shadow; methods, those that facets
    /// cast nearby
    #[arg(long, requires = "displace")]
    shadows: bool,
}

impl DisplaceArguments {
    pub(super) fn displacement(&self) -> Option<DisplacementOptions> {
        self.displace.map(|scale| DisplacementOptions { scale, shadows: self.shadows })
    }
}

fn scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v != 0.0 && v.abs() <= 1000.0 => Ok(v),
        _ => Err(format!("`{text}` is no number from -1000 to 1000, and not 0")),
    }
}

/// Look-up of maps.
#[derive(Debug, Args)]
#[command(next_help_heading = "Look-up of maps")]
pub(super) struct FilterArguments {
    /// `trilinear`; `anisotropic:N`, with up to N taps along the longer axis, as texture units do; or
    /// `fine:N`, the same in four times the taps at a level one finer, nearer to the pixel's square
    #[arg(long, value_name = "FILTER", default_value = "fine:16", value_parser = filter, requires = "scene")]
    filter: Filtering,
    /// Levels to add to what the filter asks for; negative is sharper
    #[arg(long, value_name = "LEVELS", default_value_t = 0.0, value_parser = finite, allow_negative_numbers = true, requires = "scene")]
    lod_bias: f64,
    /// Shade every texel that the filter reads and mix the results, for lobes that are not aligned
    #[arg(long, requires = "scene")]
    neighbours: bool,
    /// Shade as the papers print it: cosines at the lobes' means, environments by Han et al.'s equation 26
    #[arg(long, requires = "scene")]
    at_means: bool,
}

impl FilterArguments {
    pub(super) fn lookups(&self) -> Lookups {
        Lookups {
            sampling: Sampling::Taps(Filtering { lod_bias: self.lod_bias, ..self.filter }),
            neighbours: self.neighbours,
            at_means: self.at_means,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Device {
    /// A GPU, where there is one that is not software; else the processor
    Auto,
    /// The processor
    Cpu,
    /// A GPU, be it software
    Gpu,
}

#[cfg(feature = "gpu")]
impl Device {
    /// Opens the GPU to render on; `None` for the processor.
    pub(super) fn open(self) -> Result<Option<ndfmap::gpu::Device>, Error> {
        let opened = match self {
            Self::Cpu => return Ok(None),
            Self::Gpu => return Ok(Some(hushed(ndfmap::gpu::Device::open)?)),
            Self::Auto => hushed(ndfmap::gpu::Device::open),
        };
        let said = match opened {
            Ok(device) if !device.is_software() => return Ok(Some(device)),
            Ok(device) => format!("the only GPU is {}", device.description()),
            Err(e) => e.to_string(),
        };
        say(format_args!("{said}: rendering on the processor"));
        Ok(None)
    }
}

#[cfg(not(feature = "gpu"))]
impl Device {
    /// Refuses a GPU, which this program was built without.
    pub(super) fn refuse_gpu(self) -> Result<(), Error> {
        if self == Self::Gpu {
            let why = "this program was built without its feature `gpu`";
            return Err(Error::Request(format!("--device gpu: {why}")));
        }
        Ok(())
    }
}

fn scenes_help() -> String {
    let rows =
        scene::TABLE.iter().map(|r| format!("  {:13} {}; over time, {}", r.name, r.summary, r.animation));
    format!("Scenes:\n{}", rows.collect::<Vec<_>>().join("\n"))
}

fn time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(t) if (0.0..=1.0).contains(&t) => Ok(t),
        _ => Err("must be a number from 0 to 1".to_owned()),
    }
}

fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if v.abs() <= 1e9 => Ok(v),
        _ => Err(format!("`{text}` is no number between -1e9 and 1e9")),
    }
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    text.split(',').map(finite).collect()
}

fn three(text: &str) -> Result<DVec3, String> {
    match numbers(text)?[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("`{text}` is not three numbers")),
    }
}

fn colour(text: &str) -> Result<DVec3, String> {
    let all = numbers(text)?;
    let colour = match all[..] {
        [grey] => DVec3::splat(grey),
        [r, g, b] => DVec3::new(r, g, b),
        _ => return Err("a colour is one number or three".to_owned()),
    };
    if colour.min_element() < 0.0 { Err("a colour must not be below 0".to_owned()) } else { Ok(colour) }
}

fn camera(text: &str) -> Result<CameraSpec, String> {
    let all = numbers(text)?;
    let (eye, target, degrees) = match all[..] {
        [a, b, c, d, e, f] => (DVec3::new(a, b, c), DVec3::new(d, e, f), None),
        [a, b, c, d, e, f, degrees] if degrees > 0.1 && degrees < 179.0 => {
            (DVec3::new(a, b, c), DVec3::new(d, e, f), Some(degrees))
        }
        _ => {
            return Err(
                "needs six numbers, the eye and what it looks at, or a seventh: degrees from 0.1 to 179"
                    .to_owned(),
            );
        }
    };
    if eye.distance(target) < 1e-9 {
        return Err("the eye must be somewhere else than what it looks at".to_owned());
    }
    Ok(CameraSpec { eye, target, degrees })
}

fn light(text: &str) -> Result<Light, String> {
    let (point, rest) = text.strip_prefix("point:").map_or((false, text), |rest| (true, rest));
    let (place, colour) = rest.split_once(':').unwrap_or((rest, "3,3,3"));
    let (place, colour) = (three(place)?, self::colour(colour)?);
    if point {
        return Ok(Light::Point { at: place, intensity: colour });
    }
    let towards = place.try_normalize().ok_or("a direction must not be zero")?;
    Ok(Light::Directional { towards, irradiance: colour })
}

pub(super) fn filter(text: &str) -> Result<Filtering, String> {
    let known = match text.split_once(':') {
        None if text == "trilinear" => Some(Filtering::TRILINEAR),
        Some((name, taps)) => match (name, taps.parse().ok().filter(|n| (1..=64).contains(n))) {
            ("anisotropic", Some(taps)) => Some(Filtering::anisotropic(taps)),
            ("fine", Some(taps)) => Some(Filtering::fine(taps)),
            _ => None,
        },
        None => None,
    };
    known.ok_or_else(|| "must be `trilinear`, or `anisotropic:N` or `fine:N` with N from 1 to 64".to_owned())
}

/// Most pixels of a contact sheet.
const MAX_SHEET: usize = 1 << 27;

/// Most pixels of a picture whose sparkle is measured: some ninety pictures of it are in memory at once.
const MAX_DRIFT: usize = 1 << 21;

/// Checks that sparkle can be measured at a size.
pub(super) fn check_drift(size: Size) -> Result<(), Error> {
    if size.area() > MAX_DRIFT {
        return Err(Error::Request(format!("sparkle is measured in pictures of at most {MAX_DRIFT} pixels")));
    }
    Ok(())
}

impl Render {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let start = Instant::now();
        for path in self.output.iter().chain(&self.truth_output) {
            picture_writer(path).map_err(|e| Error::Request(e.to_string()))?;
        }
        if let Some(sheet) = &self.compare
            && !sheet.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"))
        {
            return Err(Error::Request(format!("{}: contact sheets are written as .png", sheet.display())));
        }
        let linear = |path: &PathBuf| matches!(picture_writer(path), Ok(WritePicture::Linear(_)));
        if let Some(path) = self.output.as_ref().filter(|path| self.tone != Tone::Clip && linear(path)) {
            warn(path, "holds linear light: `--tone` does nothing");
        }
        let outputs = || self.output.iter().chain(&self.truth_output).chain(&self.compare);
        check_apart(outputs())?;
        outputs().try_for_each(|path| check_kept(path))?;
        let baked = self.read_baked()?;
        let usual = if self.displace.displace.is_some() { "slopes" } else { DEFAULT_METHOD };
        let own = baked.as_ref().map_or_else(|| usual.to_owned(), |map| map.method.to_string());
        let asked = if self.method.is_empty() { std::slice::from_ref(&own) } else { &self.method[..] };
        let mut methods: Vec<AnyMethod> = Vec::new();
        for spelling in asked {
            let method: AnyMethod = spelling.parse()?;
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        if self.sparkle {
            check_drift(self.size)?;
        }
        if self.sampler.is_some()
            && let Some(method) = methods.iter().find(|m| !m.filterable())
        {
            let why = "cannot be filtered, and has no use for `--sampler`";
            return Err(Error::Request(format!("{} {why}", method)));
        }
        let terminal = Terminal::default();
        let scene = self.scene_spec(baked)?;
        let times = match self.frames {
            Some(1) => vec![0.0],
            Some(frames) => (0..frames).map(|i| f64::from(i) / f64::from(frames - 1)).collect(),
            None => self.time.clone(),
        };
        let job = RenderJob {
            scene: &scene,
            times: &times,
            methods: &methods,
            size: self.size,
            storage: self.precision,
            lookups: self.filter.lookups(),
            truth: self.truth.map(|rays| Effort {
                rays: rays as usize,
                noise: self.truth_noise.unwrap_or(0.0),
                seed: 0,
            }),
            sparkle: self.sparkle,
            keep: self.compare.is_some(),
            keep_drift: false,
        };
        if job.keep {
            let sheet = SheetPlan::new(self.size, self.truth.is_some(), methods.len(), times.len()).size();
            if sheet.area() > MAX_SHEET {
                let why = "make `--size` smaller, or the frames or methods fewer";
                let (width, height) = (sheet.width, sheet.height);
                return Err(Error::Request(format!("the contact sheet would be {width} × {height}: {why}")));
            }
        }
        let mut written = Vec::new();
        let write = &mut |at, frame: &Frame| self.write(at, times.len(), frame, &mut written);
        let report = self.render(&job, &terminal, write)?;
        if let Some(sheet) = &self.compare {
            let theme = if self.dark { Theme::Dark } else { Theme::Light };
            let title = format!("{}, {} × {}", self.scene, self.size.width, self.size.height);
            make_way(sheet)?;
            atomic::write(sheet, &contact_sheet(&report, &title, theme)?)?;
            written.push(sheet.clone());
        }
        say_written(&written);
        if json {
            let environment = scene.environment.as_ref().map(|e| self.environment.to_json(e));
            print_json(&self.to_json(&report, &written, environment, start.elapsed().as_secs_f64())?)
        } else {
            print(&tables::rendering(&report))
        }
    }

    /// Renders on the device that was asked for.
    fn render(
        &self,
        job: &RenderJob<'_>,
        terminal: &Terminal,
        each: &mut dyn FnMut(usize, &Frame) -> Result<(), Error>,
    ) -> Result<RenderReport, Error> {
        #[cfg(feature = "gpu")]
        if let Some(device) = self.device.open()? {
            let gpu = render::Device::Gpu { device, sampler: self.sampler, multisample: self.multisample };
            match render::render(job, &gpu, terminal, each) {
                // The processor can do all that this GPU cannot; `auto` asked for no more than a picture.
                Err(Error::Gpu(why)) if self.device == Device::Auto => {
                    terminal.note(&format!("{why}: rendering on the processor"));
                }
                done => return done,
            }
        }
        #[cfg(not(feature = "gpu"))]
        self.device.refuse_gpu()?;
        if self.sampler.is_some() || self.multisample {
            let why = "`--sampler` and `--multisample` are a GPU's";
            return Err(Error::Request(format!("{why}: name it with `--device gpu`")));
        }
        render::render(job, &render::Device::Cpu, terminal, each)
    }

    /// Reads the map, where it is a baked one.
    fn read_baked(&self) -> Result<Option<BakedSurface>, Error> {
        let file = |path: &&Path| !path.to_str().is_some_and(|p| p.starts_with(BUILTIN_PREFIX));
        let Some(path) = self.map.as_deref().filter(file) else { return Ok(None) };
        let Some(map) = read_ndf(path, &read_file(path)?)? else { return Ok(None) };
        self.source.warn_if_given(path, "a baked map");
        if !map.header.attributes.is_empty() {
            warn(path, "the attributes that its lobes carry are not used: scenes bring their own colours");
        }
        warn_of_missing_levels(path, &map);
        Ok(Some(BakedSurface { method: map.method(path)?, pyramid: map.pyramid }))
    }

    fn scene_spec(&self, baked: Option<BakedSurface>) -> Result<SceneSpec, Error> {
        let map = match (baked, &self.map) {
            (Some(baked), _) => Some(baked.into()),
            (None, Some(path)) => {
                let map = self.source.read(path, &self.builtin)?;
                Some(map.surface.into())
            }
            (None, None) => None,
        };
        Ok(SceneSpec {
            scene: self.scene.clone(),
            map,
            material: self.material.clone(),
            map_size: self.builtin.map_size,
            lobe: self.brdf.as_deref().map(read_brdf).transpose()?,
            shading: self.model,
            camera: self.camera,
            distance: self.distance,
            lights: self.light.clone(),
            diffuse: self.diffuse,
            specular: self.specular,
            exposure: self.exposure,
            displacement: self.displace.displacement(),
            environment: self.environment.read()?,
        })
    }

    /// Writes the pictures of a frame.
    fn write(
        &self,
        at: usize,
        frames: usize,
        frame: &Frame,
        written: &mut Vec<PathBuf>,
    ) -> Result<(), Error> {
        let truth = frame.truth.and(frame.pictures.first());
        let picture = frame.pictures.get(usize::from(truth.is_some()));
        for (path, picture) in [(&self.output, picture), (&self.truth_output, truth)] {
            let (Some(path), Some(picture)) = (path, picture) else { continue };
            let path = if frames > 1 { numbered(path, at) } else { path.clone() };
            make_way(&path)?;
            if self.tone != Tone::Clip && matches!(picture_writer(&path)?, WritePicture::Display(_)) {
                let shown = |x, y| self.tone.map(picture.row(y)[x] * frame.exposure);
                write_picture(&path, &Grid::from_fn(picture.size(), shown), 1.0)?;
            } else {
                write_picture(&path, picture, frame.exposure)?;
            }
            written.push(path);
        }
        Ok(())
    }

    fn to_json(
        &self,
        report: &RenderReport,
        written: &[PathBuf],
        environment: Option<Value>,
        seconds: f64,
    ) -> Result<Value, Error> {
        let methods = report.methods().map(|(name, said)| Ok((name.to_owned(), to_value(&said)?)));
        let methods = methods.collect::<Result<Map<String, Value>, Error>>()?;
        let device = to_value(&report.device)?;
        let first = &methods[&report.methods[0]];
        let mut value = json!({
            "scene": self.scene,
            "files": written,
            "method": report.methods[0],
            "device": device["device"],
            "cameras": report.frames.iter().map(|f| tables::numbers_of(&f.camera)).collect::<Vec<_>>(),
            "width": self.size.width,
            "height": self.size.height,
            "seconds": seconds,
            "frame_ms": first["frame_ms"],
        });
        if let Some(error) = first.get("error") {
            value["error"] = error.clone();
        }
        if let Some(truth) = report.truth() {
            value["truth"] = to_value(&truth)?;
        }
        value["methods"] = methods.into();
        if let Some(environment) = environment {
            value["environment"] = environment;
        }
        if let Value::Object(device) = device {
            device.into_iter().for_each(|(key, said)| value[key] = said);
        }
        Ok(value)
    }
}

/// Path of a numbered frame: `name.png` becomes `name-0007.png`.
fn numbered(path: &Path, at: usize) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let extension = path.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!("{stem}-{at:04}.{extension}"))
}
