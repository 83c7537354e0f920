//! Reports: pictures and an HTML page of a comparison, and contact sheets of renderings.

mod between;
mod disks;
mod pictures;
mod plot;
mod sheet;

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, context};
use ndfmap_core::measure::FilteringError;
use ndfmap_maps::Source;

use crate::Error;
use crate::compare::{Comparison, LevelError, Row, Subject, three_digits};
use crate::draw::{Sheet, Theme};
use crate::render::RenderReport;

pub use between::corner_sheet;
pub use pictures::{DifferenceColours, SheetPlan, contact_sheet, drift_film, rendering_sheet};
pub use plot::error_plot;

/// Contents of a report, to be drawn.
pub struct Pages<'a> {
    /// Subject of the comparison.
    pub subject: &'a Subject<'a>,
    /// Results of the comparison.
    pub comparison: &'a Comparison,
    /// Pictures of a scene with the same methods, if any.
    pub pictures: Option<&'a RenderReport>,
    /// Source that the map was read from.
    pub source: &'a Source,
    /// Warnings of its reader.
    pub warnings: &'a [String],
    /// Circumstances of the report, each a line at its end: command, date, machine.
    pub circumstances: &'a [String],
}

/// File of a report.
pub struct ReportFile {
    /// Name, without a folder.
    pub name: &'static str,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// Draws every file of a report: the page, its figures, and the numbers as JSON.
///
/// # Errors
/// [`Error::Failed`] for what cannot be drawn, and [`Error::Cancelled`].
pub fn draw(pages: &Pages<'_>) -> Result<Vec<ReportFile>, Error> {
    let (subject, comparison) = (pages.subject, pages.comparison);
    let mut figures = vec![
        Figure::of("contact-sheet.png", &sheet::draw(subject, comparison))?,
        Figure::of("ndf.png", &disks::draw(subject, comparison)?)?,
    ];
    // This figure bakes every mixture once more, unaligned: only those who ask about filtering should wait
    // for it.
    if let Some(sheet) = if subject.filtering { corner_sheet(subject, comparison)? } else { None } {
        figures.push(Figure::of("alignment.png", &sheet)?);
    }
    if let Some(report) = pages.pictures {
        figures.push(Figure::of("scene.png", &pictures::rendering_sheet(report, &pages.source.file)?)?);
        if let (Some(light), Some(dark)) =
            (drift_film(report, Theme::Light)?, drift_film(report, Theme::Dark)?)
        {
            figures.push(Figure { name: "drift.png", light, dark });
        }
    }
    let html = page(pages, &figures)?;
    let json = serde_json::to_string_pretty(comparison).map_err(|e| Error::Failed(e.to_string()))?;
    let mut files = vec![
        ReportFile { name: PAGE, bytes: html.into_bytes() },
        ReportFile { name: "compare.json", bytes: (json + "\n").into_bytes() },
    ];
    files.extend(figures.into_iter().map(|figure| ReportFile { name: figure.name, bytes: figure.light }));
    Ok(files)
}

/// Figure of a page, drawn on light and on dark paper, as PNG.
struct Figure {
    name: &'static str,
    light: Vec<u8>,
    dark: Vec<u8>,
}

impl Figure {
    fn of(name: &'static str, sheet: &Sheet) -> Result<Self, Error> {
        let [light, dark] = Theme::ALL.map(|theme| sheet.draw(theme).to_png());
        Ok(Self { name, light: light?, dark: dark? })
    }
}

/// Name of the report's page, which holds its pictures.
pub const PAGE: &str = "report.html";

/// Levels that a verdict is about: those of distances at which maps are seen.
const JUDGED: std::ops::RangeInclusive<usize> = 2..=7;

/// Rows that a verdict measures the best against, where they were compared: what renderers do today.
const USUAL: [&str; 2] = ["naive", "toksvig"];

/// Sentence that says which method is nearest to the truth, and by how much.
fn verdict(comparison: &Comparison) -> Option<String> {
    let mean = |row: &Row| {
        let judged: Vec<f64> =
            row.levels.iter().filter(|l| JUDGED.contains(&l.level)).map(|l| l.error).collect();
        // A map that leaves some of them out cannot be set beside the others.
        (!judged.is_empty() && row.from_level <= *JUDGED.start())
            .then(|| judged.iter().sum::<f64>() / judged.len() as f64)
    };
    let all: Vec<(&Row, f64)> = comparison.rows.iter().filter_map(|row| Some((row, mean(row)?))).collect();
    let (best, least) = all.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let others = all.iter().filter(|(row, _)| row.method != best.method);
    let beside = |(row, error): &(&Row, f64)| {
        format!("{:.2} of the error of {}", least / error.max(f64::MIN_POSITIVE), row.method)
    };
    let usual: Vec<String> =
        others.clone().filter(|(row, _)| USUAL.contains(&row.method.as_str())).map(beside).collect();
    let beside = if usual.is_empty() {
        others.max_by(|a, b| a.1.total_cmp(&b.1)).map(beside).into_iter().collect()
    } else {
        usual
    };
    let (method, error) = (&best.method, three_digits(*least));
    let judged = format!("{} to {}", JUDGED.start(), JUDGED.end().min(&(comparison.sizes.len() - 1)));
    let tail = if beside.is_empty() { String::new() } else { format!(": {}", beside.join(", ")) };
    Some(format!("Over levels {judged}, {method} is nearest to the truth, at a mean error of {error}{tail}."))
}

fn page(pages: &Pages<'_>, figures: &[Figure]) -> Result<String, Error> {
    let failed = |e: minijinja::Error| Error::Failed(format!("cannot write the report: {e}"));
    let mut environment = Environment::new();
    environment.add_template(PAGE, include_str!("../../templates/report.html")).map_err(failed)?;
    let comparison = pages.comparison;
    let best: Vec<f64> = (0..comparison.sizes.len())
        .map(|level| {
            let errors = comparison.rows.iter().flat_map(|row| &row.levels).filter(|e| e.level == level);
            errors.map(|e| e.error).fold(f64::INFINITY, f64::min)
        })
        .collect();
    let rows: Vec<minijinja::Value> = comparison
        .rows
        .iter()
        .map(|row| {
            let cell = |LevelError { error, level, .. }: &LevelError| {
                context! { text => three_digits(*error), best => *error <= best[*level] * 1.0005 }
            };
            // A level that a map leaves out has no number.
            let missing = (0..row.from_level).map(|_| context! { text => "-", best => false });
            let cells: Vec<minijinja::Value> = missing.chain(row.levels.iter().map(cell)).collect();
            let bake = format!("{:.1}", row.bake_seconds * 1e3);
            context! { method => row.method.clone(), bytes => row.bytes_per_texel, bake => bake, cells => cells }
        })
        .collect();
    let filtering: Vec<minijinja::Value> = comparison
        .rows
        .iter()
        .filter(|row| !row.filtering.is_empty())
        .map(|row| {
            let both = |e: &FilteringError| [e.filtered, e.reference].map(|e| three_digits(e.error));
            let cell = |e: &FilteringError| both(e).join(" / ");
            // Level 0 has no column.
            let missing = (1..row.from_level).map(|_| "-".to_owned());
            context! { method => row.method.clone(), cells => missing.chain(row.filtering.iter().map(cell)).collect::<Vec<_>>() }
        })
        .collect();
    let sizes: Vec<String> = comparison.sizes.iter().map(|s| format!("{}×{}", s.width, s.height)).collect();
    let plots = Theme::ALL.map(|theme| error_plot(comparison).to_svg(theme));
    let plots = plots.into_iter().collect::<Result<Vec<String>, Error>>()?;
    let encode = |f: &Figure| (f.name, [&f.light, &f.dark].map(|png| STANDARD.encode(png)));
    let encoded: BTreeMap<&str, [String; 2]> = figures.iter().map(encode).collect();
    let template = environment.get_template(PAGE).map_err(failed)?;
    template
        .render(context! {
            map => pages.source.file.clone(),
            brdf => comparison.brdf.clone(),
            size => sizes.first(),
            sizes => sizes,
            rows => rows,
            warnings => pages.warnings.to_vec(),
            verdict => verdict(comparison),
            plot => plots,
            figures => encoded,
            circumstances => pages.circumstances.to_vec(),
            filtering => filtering,
            version => env!("CARGO_PKG_VERSION"),
        })
        .map_err(failed)
}
