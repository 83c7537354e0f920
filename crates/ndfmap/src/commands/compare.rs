//! `ndfmap compare`: the error of each method against the truth, level by level.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use ndfmap_core::brdf::{AnyLobe, Lobe};
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::pyramid;
use ndfmap_core::scene::Effort;
use ndfmap_maps::source::{SourceMap, read_source};

use super::arguments::{
    BuiltinSize, EnvironmentArguments, Precision, SourceArguments, brdf_spelling, brdfs_help, method,
    method_spelling, methods_help, read_brdf, scene_name, size,
};
use super::render::{DisplaceArguments, FilterArguments, check_drift};
use super::{print, print_json, say_if_replaced, warn};
use crate::Failure;
use crate::engine::Cpu;
use crate::imaging::{RenderJob, RenderReport, shoot};
use crate::measure::{self, Comparison, Subject};
use crate::report::{self, Pages};
use crate::staging::SceneSpec;
use ndfmap_core::ndf::AnyMethod;

/// What every comparison carries unless told otherwise: the baselines, each linear method, and mixtures.
pub(super) const DEFAULT_METHODS: &str =
    "fixed,naive,toksvig,ndm,ndm:plane,slopes,sh:4,sh:7,gmm:4,vmf:2,vmf:4,vmf:6";

/// Measure methods against the truth, level by level
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}\n\n{}", methods_help(), brdfs_help()))]
pub(super) struct Compare {
    /// The map: a picture file, or `builtin:NAME`
    map: PathBuf,
    /// Methods, separated by commas
    #[arg(long, value_delimiter = ',', default_value = DEFAULT_METHODS, value_parser = method_spelling)]
    methods: Vec<String>,
    /// The reflectance lobe they are measured with
    #[arg(long, default_value = "blinn-phong:50", value_parser = brdf_spelling)]
    brdf: String,
    /// Bits of a stored channel; errors are those of the stored map
    #[arg(long, value_enum, default_value_t = Precision::Half)]
    precision: Precision,
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
    /// Size of the pictures
    #[arg(long, value_name = "SIZE", default_value = "256", value_parser = size, requires = "scene")]
    picture: Size,
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
    pub(super) fn run(self, json: bool) -> Result<(), Failure> {
        let mut methods: Vec<AnyMethod> = Vec::new();
        for spelling in &self.methods {
            let method = method(spelling)?;
            // Two spellings of one method would share a key in the JSON.
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        if self.sparkle {
            check_drift(self.picture)?;
        }
        let map = read_source(&self.map, &self.source.options(self.builtin.size))?;
        for warning in &map.warnings {
            warn(&self.map, warning);
        }
        let environment = self.environment.read()?;
        let brdf: AnyLobe = read_brdf(&self.brdf)?;
        let run = Run {
            map: &map,
            methods: &methods,
            brdf: &*brdf,
            precision: self.precision.into(),
            filtering: self.filtering,
            pictures: self.scene.as_ref().map(|scene| Pictures {
                stage: SceneSpec {
                    scene: scene.clone(),
                    map: Some(Arc::clone(&map.surface)),
                    lobe: Some(brdf.clone()),
                    displacement: self.displace.displacement(),
                    environment: environment.clone(),
                    ..SceneSpec::default()
                },
                times: vec![0.0],
                size: self.picture,
                lookups: self.filter.lookups(),
                truth: Effort { rays: self.truth as usize, noise: 0.0, seed: 0 },
                sparkle: self.sparkle,
            }),
        };
        let Measured { comparison, reel, written } = run.measure(self.report.as_deref())?;
        for file in written {
            eprintln!("ndfmap: wrote {}", file.display());
        }
        if !json {
            let pictures = reel.map_or_else(String::new, |reel| format!("\npictures\n\n{}", reel.to_table()));
            return print(&(comparison.to_table() + &pictures));
        }
        let mut value = comparison.to_json(&map.source.file);
        if let (Some(reel), Some(scene)) = (reel, self.scene) {
            value["scene"] = scene.into();
            value["truth"] = reel.truth_json().unwrap_or_default();
            if let Some(read) = &environment {
                value["environment"] = self.environment.to_json(read);
            }
            for (method, measured) in reel.to_json() {
                value["methods"][method]["picture"] = measured;
            }
        }
        print_json(&value)
    }
}

/// A comparison of a source, perhaps with pictures and a report.
pub(super) struct Run<'a> {
    pub(super) map: &'a SourceMap,
    pub(super) methods: &'a [AnyMethod],
    pub(super) brdf: &'a dyn Lobe,
    pub(super) precision: pyramid::Precision,
    pub(super) filtering: bool,
    pub(super) pictures: Option<Pictures>,
}

/// Pictures to be measured.
pub(super) struct Pictures {
    pub(super) stage: SceneSpec,
    pub(super) times: Vec<f64>,
    pub(super) size: Size,
    pub(super) lookups: Lookups,
    pub(super) truth: Effort,
    pub(super) sparkle: bool,
}

/// What came of it.
pub(super) struct Measured {
    pub(super) comparison: Comparison,
    pub(super) reel: Option<RenderReport>,
    pub(super) written: Vec<PathBuf>,
}

impl Run<'_> {
    /// Measures; with a folder, writes the report.
    pub(super) fn measure(&self, folder: Option<&Path>) -> Result<Measured, Failure> {
        // A folder that cannot be made, or a scene that is not there, should be known before the minutes of measuring.
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(|e| ndfmap_maps::MapError::io(folder, e))?;
        }
        let reel = self.pictures.as_ref().map(|pictures| self.shoot(pictures)).transpose()?;
        let subject = Subject {
            surface: &*self.map.surface,
            lobe: self.brdf,
            methods: self.methods,
            precision: self.precision,
            filtering: self.filtering,
        };
        let comparison = measure::compare(&subject)?;
        let mut written = Vec::new();
        if let Some(folder) = folder {
            let pages = Pages {
                subject: &subject,
                comparison: &comparison,
                reel: reel.as_ref(),
                source: &self.map.source,
                warnings: &self.map.warnings,
            };
            for (name, bytes) in report::draw(&pages)? {
                let path = folder.join(name);
                say_if_replaced(&path);
                ndfmap_maps::atomic::write(&path, &bytes)?;
                written.push(path);
            }
        }
        Ok(Measured { comparison, reel, written })
    }

    fn shoot(&self, pictures: &Pictures) -> Result<RenderReport, Failure> {
        let shot = RenderJob {
            stage: &pictures.stage,
            times: &pictures.times,
            methods: self.methods,
            size: pictures.size,
            precision: self.precision,
            lookups: pictures.lookups,
            truth: Some(pictures.truth),
            sparkle: pictures.sparkle,
            keep: true,
        };
        shoot(&Cpu, &shot, &mut |_, _| Ok(()))
    }
}
