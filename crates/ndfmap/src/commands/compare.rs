//! `ndfmap compare`: the error of each method against the truth, level by level.

use std::path::{Path, PathBuf};

use clap::Args;
use ndfmap_core::brdf;
use ndfmap_core::ndf::Method;
use ndfmap_core::pyramid;
use ndfmap_maps::source::{SourceMap, read_source};

use super::arguments::{
    BuiltinSize, Precision, SourceArguments, brdf_spelling, brdfs_help, method, method_spelling, methods_help,
};
use super::{print, print_json, say_if_replaced, warn};
use crate::Failure;
use crate::measure::{self, Comparison, Subject};
use crate::report::{self, Pages};

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
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    builtin: BuiltinSize,
}

impl Compare {
    pub(super) fn run(self, json: bool) -> Result<(), Failure> {
        let mut methods: Vec<Box<dyn Method>> = Vec::new();
        for spelling in &self.methods {
            let method = method(spelling)?;
            // Two spellings of one method would share a key in the JSON.
            if methods.iter().all(|m| m.spelling() != method.spelling()) {
                methods.push(method);
            }
        }
        let map = read_source(&self.map, &self.source.options(self.builtin.size))?;
        for warning in &map.warnings {
            warn(&self.map, warning);
        }
        let run = Run {
            map: &map,
            methods: &methods,
            brdf: &self.brdf,
            precision: self.precision.into(),
            filtering: self.filtering,
        };
        let (comparison, written) = run.measure(self.report.as_deref())?;
        for file in written {
            eprintln!("ndfmap: wrote {}", file.display());
        }
        if json { print_json(&comparison.to_json(&map.source.file)) } else { print(&comparison.to_table()) }
    }
}

/// A comparison of a source, perhaps with a report.
pub(super) struct Run<'a> {
    pub(super) map: &'a SourceMap,
    pub(super) methods: &'a [Box<dyn Method>],
    pub(super) brdf: &'a str,
    pub(super) precision: pyramid::Precision,
    pub(super) filtering: bool,
}

impl Run<'_> {
    /// Measures; with a folder, writes the report and returns the files written.
    pub(super) fn measure(&self, folder: Option<&Path>) -> Result<(Comparison, Vec<PathBuf>), Failure> {
        // A folder that cannot be made should be known before the minutes of measuring, not after.
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(|e| ndfmap_maps::MapError::io(folder, e))?;
        }
        let brdf = brdf::parse(self.brdf).map_err(|e| Failure::Usage(e.to_string()))?;
        let subject = Subject {
            surface: &*self.map.surface,
            brdf: &*brdf,
            methods: self.methods,
            precision: self.precision,
            filtering: self.filtering,
        };
        let comparison = measure::compare(&subject);
        let Some(folder) = folder else { return Ok((comparison, Vec::new())) };
        let pages = Pages {
            subject: &subject,
            comparison: &comparison,
            source: &self.map.source,
            warnings: &self.map.warnings,
        };
        let mut written = Vec::new();
        for (name, bytes) in report::draw(&pages)? {
            let path = folder.join(name);
            say_if_replaced(&path);
            ndfmap_maps::atomic::write(&path, &bytes)?;
            written.push(path);
        }
        Ok((comparison, written))
    }
}
