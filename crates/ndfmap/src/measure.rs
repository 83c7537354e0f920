//! Bakes a surface with several methods and measures each against the truth, level by level.

use std::time::Instant;

use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::Lobe;
use ndfmap_core::grid::Size;
use ndfmap_core::measure::{
    FilteringError, TexelTruth, filtering_error, lattice_for, level_error, true_corners, true_levels,
};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::pyramid::{Precision, Pyramid, level_sizes};
use ndfmap_core::surface::Surface;
use serde_json::{Map, Value, json};

use crate::progress::Progress;
use ndfmap_core::ndf::AnyMethod;

/// What is compared.
pub(crate) struct Subject<'a> {
    pub(crate) surface: &'a dyn Surface,
    pub(crate) lobe: &'a dyn Lobe,
    pub(crate) methods: &'a [AnyMethod],
    pub(crate) precision: Precision,
    /// Measure between texels too.
    pub(crate) filtering: bool,
}

/// One method's map and its errors.
pub(crate) struct Row {
    pub(crate) method: String,
    pub(crate) bytes_per_texel: usize,
    pub(crate) bake_seconds: f64,
    pub(crate) pyramid: Pyramid,
    /// One a level, finest first.
    pub(crate) errors: Vec<f64>,
    /// Between texels, where asked for.
    pub(crate) filtering: Vec<FilteringError>,
}

/// Everything that was measured.
pub(crate) struct Comparison {
    pub(crate) lobe: String,
    pub(crate) sizes: Vec<Size>,
    pub(crate) rows: Vec<Row>,
}

/// Bakes and measures.
pub(crate) fn compare(subject: &Subject<'_>) -> Result<Comparison, Cancelled> {
    let lattice = lattice_for(subject.lobe);
    let sizes = level_sizes(subject.surface.size());
    let (truths, corners) = {
        let progress = Progress::new("truth");
        let truth = TexelTruth::new(subject.surface, subject.lobe, &lattice);
        let whole: &dyn Observer = &progress;
        let part = if subject.filtering { 0.5 } else { 1.0 };
        let truths = true_levels(&truth, &whole.part(0.0, part))?;
        // Level 0 is the map itself, filtered as it has always been.
        let levels: Vec<usize> = if subject.filtering { (1..sizes.len()).collect() } else { Vec::new() };
        (truths, true_corners(&truth, subject.surface.wraps(), &levels, &whole.part(part, 1.0))?)
    };
    let mut rows = Vec::new();
    for method in subject.methods {
        let progress = Progress::new(&method.to_string());
        let start = Instant::now();
        let bake = Bake::new(subject.surface, &**method).precision(subject.precision).observer(&progress);
        let (pyramid, _) = bake.to_pyramid()?;
        let bake_seconds = start.elapsed().as_secs_f64();
        let error = |truth| level_error(&pyramid, &**method, subject.lobe, &lattice, truth);
        let errors = truths.iter().map(error).collect();
        let between = |truth| filtering_error(&pyramid, &**method, subject.lobe, &lattice, truth);
        let filtering = corners.iter().map(between).collect();
        let bytes_per_texel = method.layers() * subject.precision.texel_bytes();
        rows.push(Row {
            method: method.to_string(),
            bytes_per_texel,
            bake_seconds,
            pyramid,
            errors,
            filtering,
        });
    }
    Ok(Comparison { lobe: subject.lobe.to_string(), sizes, rows })
}

impl Comparison {
    /// The JSON of `compare --json`.
    pub(crate) fn to_json(&self, map: &str) -> Value {
        let methods: Map<String, Value> = self
            .rows
            .iter()
            .map(|row| {
                let level = |(level, error): (usize, &f64)| json!({ "level": level, "error": error });
                let levels: Vec<Value> = row.errors.iter().enumerate().map(level).collect();
                let mut value = json!({
                    "bytes_per_texel": row.bytes_per_texel,
                    "bake_seconds": row.bake_seconds,
                    "levels": levels,
                });
                if !row.filtering.is_empty() {
                    let level = |e: &FilteringError| {
                        json!({ "level": e.level, "texels": e.texels, "between": e.filtered, "reference": e.reference })
                    };
                    value["filtering"] = row.filtering.iter().map(level).collect();
                }
                (row.method.clone(), value)
            })
            .collect();
        json!({
            "map": map,
            "width": self.sizes[0].width,
            "height": self.sizes[0].height,
            "brdf": self.lobe,
            "methods": methods,
        })
    }

    /// The table for a terminal: a row a method, a column a level.
    pub(crate) fn to_table(&self) -> String {
        let name = self.rows.iter().map(|r| r.method.len()).max().unwrap_or(0).max("level".len());
        let mut text =
            format!("relative L2 error of the effective lobe against the truth, {}\n\n", self.lobe);
        text += &format!("{:name$}  bytes  bake ms", "level");
        for (level, _) in self.sizes.iter().enumerate() {
            text += &format!(" {level:>6}");
        }
        text += &format!("\n{:name$}               ", "size");
        for size in &self.sizes {
            text += &format!(
                " {:>6}",
                if size.width == size.height {
                    size.width.to_string()
                } else {
                    format!("{}x{}", size.width, size.height)
                }
            );
        }
        text.push('\n');
        for row in &self.rows {
            text +=
                &format!("{:name$} {:>6} {:>8.1}", row.method, row.bytes_per_texel, row.bake_seconds * 1e3);
            for error in &row.errors {
                text += &format!(" {:>6}", three_digits(*error));
            }
            text.push('\n');
        }
        if self.rows.iter().any(|row| !row.filtering.is_empty()) {
            text += "\nbetween texels (edges and corners): filtered, then by the reference path that shades every neighbour\n\n";
            for row in &self.rows {
                for (what, error) in [
                    ("filtered", (|e| e.filtered) as fn(&FilteringError) -> f64),
                    ("reference", |e| e.reference),
                ] {
                    text += &format!("{:name$} {what:>15}       -", row.method);
                    for e in &row.filtering {
                        text += &format!(" {:>6}", three_digits(error(e)));
                    }
                    text.push('\n');
                }
            }
        }
        text
    }
}

/// A number in six columns, three significant digits where it matters.
pub(crate) fn three_digits(value: f64) -> String {
    match value {
        v if v < 0.0005 => format!("{v:.0e}"),
        v if v < 10.0 => format!("{v:.3}"),
        v => format!("{v:.1}"),
    }
}
