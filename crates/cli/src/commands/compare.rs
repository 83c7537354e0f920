//! `ndfmap compare`: the error of each method against the truth, level by level.

use std::path::{Path, PathBuf};
use std::str::FromStr as _;
use std::sync::Arc;

use clap::Args;
use ndfmap::compare::{BakedFile, Comparison, Subject, compare};
use ndfmap::core::brdf::{AnyLobe, Lobe};
use ndfmap::core::compact::Storage;
use ndfmap::core::grid::Size;
use ndfmap::core::lookup::Lookups;
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::roughness;
use ndfmap::maps::atomic;
use ndfmap::maps::formats::{read_file, read_ndf};
use ndfmap::maps::source::SourceMap;
use ndfmap::render::{Device, RenderJob, RenderReport, render};
use ndfmap::report::{self, Pages, ReportFile};
use ndfmap::roughness::Origin;
use ndfmap::scene::Effort;
use ndfmap::{Error, SceneSpec};

use super::arguments::{
    BuiltinSize, EnvironmentArguments, STORAGE_HELP, SourceArguments, brdf_spelling, brdfs_help,
    method_spelling, methods_help, read_brdf, scene_name, size,
};
use super::render::{DisplaceArguments, FilterArguments, check_drift};
use super::{check_kept, circumstances, make_folder, make_way, print, print_json, say_written, to_value};
use crate::tables;
use crate::terminal::Terminal;
use crate::voice::warn;

/// Methods of every comparison unless told otherwise: the baselines, each linear method, and mixtures.
pub(super) const DEFAULT_METHODS: &str =
    "fixed,naive,toksvig,ndm,ndm:plane,slopes,sh:4,sh:7,gmm:4,vmf:2,vmf:4,vmf:6";

/// Measure methods against the truth, level by level
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}\n\n{}", methods_help(), brdfs_help()))]
pub(super) struct Compare {
    /// The map: a picture file, or `builtin:NAME`
    map: PathBuf,
    /// Methods, separated by commas
    #[arg(short, long, alias = "methods", value_delimiter = ',', value_parser = method_spelling,
        help = format!("Methods, separated by commas [default: {DEFAULT_METHODS}]"))]
    method: Vec<String>,
    /// Measure these files too, which were baked from the map, as they are; without `--method`, them alone
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    baked: Vec<PathBuf>,
    /// Measure what an engine's own material makes of the map too: formulas that engines ship and fits, as in
    /// `ndfmap roughness`, or `all` formulas; the lobe's width is the roughness
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    rule: Vec<String>,
    /// The reflectance lobe they are measured with
    #[arg(long, default_value = "blinn-phong:50", value_parser = brdf_spelling)]
    brdf: String,
    #[arg(long, value_parser = Storage::from_str, default_value_t, help = STORAGE_HELP)]
    precision: Storage,
    /// Also measure between texels, where a filter mixes lobes: filtered, and by shading every neighbour
    #[arg(long)]
    filtering: bool,
    /// Also write a report with pictures and plots into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Also render the map in a scene, and measure pictures: a built-in scene, or a model file
    #[arg(long, value_name = "NAME|FILE", value_parser = scene_name)]
    scene: Option<String>,
    /// Rays a pixel of the true picture
    #[arg(long, value_name = "RAYS", default_value_t = 256, requires = "scene",
        value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    truth: u32,
    /// Size of the pictures, as in 256 or 640x480
    #[arg(long, value_name = "SIZE", default_value = "256", value_parser = size, requires = "scene")]
    size: Size,
    /// Material of a model that the map is laid on [default: that of its first mesh]
    #[arg(long, value_name = "NAME", requires = "scene")]
    material: Option<String>,
    /// Also measure how each method sparkles as the camera drifts by a pixel
    #[arg(long, requires = "scene")]
    sparkle: bool,
    #[command(flatten)]
    displace: DisplaceArguments,
    #[command(flatten)]
    environment: EnvironmentArguments,
    #[command(flatten)]
    filter: FilterArguments,
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    builtin: BuiltinSize,
}

impl Compare {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let mut methods: Vec<AnyMethod> = Vec::new();
        let usual: Vec<String> = DEFAULT_METHODS.split(',').map(str::to_owned).collect();
        let asked = match (&self.method[..], &self.baked[..]) {
            ([], []) => &usual[..],
            (asked, _) => asked,
        };
        for spelling in asked {
            let method: AnyMethod = spelling.parse()?;
            // Two spellings of one method would share a key in the JSON.
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        if methods.is_empty() && self.scene.is_some() {
            let why = "`--scene` renders methods: name them with `--method` beside `--baked`";
            return Err(Error::Request(why.to_owned()));
        }
        if self.sparkle {
            check_drift(self.size)?;
        }
        let mut engines: Vec<Origin> = Vec::new();
        for name in &self.rule {
            let named = if name.eq_ignore_ascii_case("all") {
                roughness::TABLE.iter().map(|row| Origin::Rule(row.name)).collect()
            } else {
                vec![name.parse::<Origin>().map_err(|e| Error::Request(format!("--rule {name}: {e}")))?]
            };
            for origin in named {
                if !engines.contains(&origin) {
                    engines.push(origin);
                }
            }
        }
        let map = self.source.read(&self.map, &self.builtin)?;
        let baked = self.baked.iter().map(|path| open_baked(path, &map)).collect::<Result<Vec<_>, _>>()?;
        let environment = self.environment.read()?;
        let brdf: AnyLobe = read_brdf(&self.brdf)?;
        let run = Run {
            map: &map,
            methods: &methods,
            baked: &baked,
            engines: &engines,
            brdf: &*brdf,
            storage: self.precision,
            filtering: self.filtering,
            pictures: self.scene.as_ref().map(|scene| Pictures {
                scene: SceneSpec {
                    scene: scene.clone(),
                    map: Some(Arc::clone(&map.surface).into()),
                    material: self.material.clone(),
                    lobe: Some(brdf.clone()),
                    displacement: self.displace.displacement(),
                    environment: environment.clone(),
                    ..SceneSpec::default()
                },
                times: vec![0.0],
                size: self.size,
                lookups: self.filter.lookups(),
                truth: Effort { rays: self.truth as usize, noise: 0.0, seed: 0 },
                sparkle: self.sparkle,
            }),
        };
        let terminal = Terminal::default();
        let Measured { comparison, pictures, written } = run.measure(self.report.as_deref(), &terminal)?;
        say_written(&written);
        if !json {
            let said = |pictures: &RenderReport| format!("\npictures\n\n{}", tables::rendering(pictures));
            let pictures = pictures.as_ref().map_or_else(String::new, said);
            return print(&(tables::comparison(&comparison) + &pictures));
        }
        let mut value = to_value(&comparison)?;
        if !written.is_empty() {
            value["files"] = written.iter().map(|f| f.display().to_string()).collect();
        }
        if let (Some(pictures), Some(scene)) = (pictures, self.scene) {
            value["scene"] = scene.into();
            value["truth"] = to_value(&pictures.truth())?;
            if let Some(read) = &environment {
                value["environment"] = self.environment.to_json(read);
            }
            for (method, measured) in pictures.methods() {
                value["methods"][method]["picture"] = to_value(&measured)?;
            }
        }
        print_json(&value)
    }
}

/// Opens a file that was baked from the source before; warns where its header says that it was baked from
/// another, or otherwise.
fn open_baked(path: &Path, source: &SourceMap) -> Result<BakedFile, Error> {
    let map = read_ndf(path, &read_file(path)?)?.ok_or_else(|| {
        let why = "is no baked map: the map to compare comes first, and `--baked` names what was baked of it";
        Error::Request(format!("{}: {why}", path.display()))
    })?;
    let (own, due) = (&map.header.source, &source.source);
    if own.sha256 != due.sha256 || own.sha256.is_empty() && own.file != due.file {
        let file = &own.file;
        warn(path, &format!("was baked from another picture, `{file}`: its errors are those of a stranger"));
    } else if own.convention != due.convention || own.height_scale != due.height_scale {
        warn(path, "was baked from this picture by another convention, or at another height scale");
    }
    Ok(BakedFile { path: path.to_owned(), map })
}

/// Comparison of a source, perhaps with pictures and a report.
pub(super) struct Run<'a> {
    pub(super) map: &'a SourceMap,
    pub(super) methods: &'a [AnyMethod],
    pub(super) baked: &'a [BakedFile],
    pub(super) engines: &'a [Origin],
    pub(super) brdf: &'a dyn Lobe,
    pub(super) storage: Storage,
    pub(super) filtering: bool,
    pub(super) pictures: Option<Pictures>,
}

/// Pictures to be measured.
pub(super) struct Pictures {
    pub(super) scene: SceneSpec,
    pub(super) times: Vec<f64>,
    pub(super) size: Size,
    pub(super) lookups: Lookups,
    pub(super) truth: Effort,
    pub(super) sparkle: bool,
}

/// Results of a comparison.
pub(super) struct Measured {
    pub(super) comparison: Comparison,
    pub(super) pictures: Option<RenderReport>,
    pub(super) written: Vec<PathBuf>,
}

impl Run<'_> {
    /// Measures; with a folder, writes the report.
    pub(super) fn measure(&self, folder: Option<&Path>, terminal: &Terminal) -> Result<Measured, Error> {
        // A folder that cannot be made, or a missing scene, should fail before the minutes of measuring.
        if let Some(folder) = folder {
            make_folder(folder)?;
            check_kept(&folder.join(report::PAGE))?;
        }
        let pictures = self.pictures.as_ref().map(|pictures| self.render(pictures, terminal)).transpose()?;
        let subject = Subject {
            name: &self.map.source.file,
            surface: &*self.map.surface,
            lobe: self.brdf,
            methods: self.methods,
            baked: self.baked,
            engines: self.engines,
            storage: self.storage,
            filtering: self.filtering,
        };
        let comparison = compare(&subject, terminal)?;
        let mut written = Vec::new();
        if let Some(folder) = folder {
            let pages = Pages {
                subject: &subject,
                comparison: &comparison,
                pictures: pictures.as_ref(),
                source: &self.map.source,
                warnings: &self.map.warnings,
                circumstances: &circumstances(),
            };
            for ReportFile { name, bytes } in report::draw(&pages)? {
                let path = folder.join(name);
                make_way(&path)?;
                atomic::write(&path, &bytes)?;
                written.push(path);
            }
        }
        Ok(Measured { comparison, pictures, written })
    }

    fn render(&self, pictures: &Pictures, terminal: &Terminal) -> Result<RenderReport, Error> {
        let job = RenderJob {
            scene: &pictures.scene,
            times: &pictures.times,
            methods: self.methods,
            size: pictures.size,
            storage: self.storage,
            lookups: pictures.lookups,
            truth: Some(pictures.truth),
            sparkle: pictures.sparkle,
            keep: true,
            keep_drift: pictures.sparkle,
        };
        render(&job, &Device::Cpu, terminal, &mut |_, _| Ok(()))
    }
}
