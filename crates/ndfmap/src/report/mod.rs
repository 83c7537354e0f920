//! Reports: pictures and an HTML page of a comparison, and contact sheets of renderings.

mod between;
mod canvas;
mod disks;
mod pictures;
mod plot;
mod sheet;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, context};
use ndfmap_core::measure::FilteringError;
use ndfmap_maps::Source;

use crate::Error;
use crate::compare::{Comparison, LevelError, Subject, three_digits};
use crate::render::RenderReport;

pub use pictures::{SheetPlan, contact_sheet};

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
    let sheet = sheet::draw(pages.subject, pages.comparison).to_png()?;
    let disks = disks::draw(pages.subject, pages.comparison)?.to_png()?;
    // This figure bakes every mixture once more, unaligned: only those who ask about filtering should wait
    // for it.
    let asked = pages.subject.filtering;
    let between = if asked { between::draw(pages.subject, pages.comparison)? } else { None };
    let between = between.map(|canvas| canvas.to_png()).transpose()?;
    let plot = plot::errors_by_level(pages.comparison)?;
    let scene = pages.pictures.map(|report| contact_sheet(report, &pages.source.file)).transpose()?;
    let figures = Figures {
        sheet: &sheet,
        disks: &disks,
        between: between.as_deref(),
        scene: scene.as_deref(),
        plot: &plot,
    };
    let html = page(pages, &figures)?;
    let json = serde_json::to_string_pretty(pages.comparison).map_err(|e| Error::Failed(e.to_string()))?;
    let file = |name, bytes| ReportFile { name, bytes };
    let mut files = vec![
        file(PAGE, html.into_bytes()),
        file("contact-sheet.png", sheet),
        file("ndf.png", disks),
        file("compare.json", (json + "\n").into_bytes()),
    ];
    files.extend(between.map(|between| file("alignment.png", between)));
    files.extend(scene.map(|scene| file("scene.png", scene)));
    Ok(files)
}

/// Figures of a page, drawn.
struct Figures<'a> {
    sheet: &'a [u8],
    disks: &'a [u8],
    between: Option<&'a [u8]>,
    scene: Option<&'a [u8]>,
    plot: &'a str,
}

/// Name of the report's page, which holds its pictures.
pub const PAGE: &str = "report.html";

fn page(pages: &Pages<'_>, figures: &Figures<'_>) -> Result<String, Error> {
    let failed = |e: minijinja::Error| Error::Failed(format!("cannot write the report: {e}"));
    let mut environment = Environment::new();
    environment.add_template(PAGE, include_str!("../../templates/report.html")).map_err(failed)?;
    let comparison = pages.comparison;
    let best: Vec<f64> = (0..comparison.sizes.len())
        .map(|level| comparison.rows.iter().map(|r| r.levels[level].error).fold(f64::INFINITY, f64::min))
        .collect();
    let rows: Vec<minijinja::Value> = comparison
        .rows
        .iter()
        .map(|row| {
            let cells: Vec<minijinja::Value> = row
                .levels
                .iter()
                .zip(&best)
                .map(|(LevelError { error, .. }, best)| {
                    context! { text => three_digits(*error), best => *error <= best * 1.0005 }
                })
                .collect();
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
            context! { method => row.method.clone(), cells => row.filtering.iter().map(cell).collect::<Vec<_>>() }
        })
        .collect();
    let sizes: Vec<String> = comparison.sizes.iter().map(|s| format!("{}×{}", s.width, s.height)).collect();
    let template = environment.get_template(PAGE).map_err(failed)?;
    template
        .render(context! {
            map => pages.source.file.clone(),
            brdf => comparison.brdf.clone(),
            size => sizes.first(),
            sizes => sizes,
            rows => rows,
            warnings => pages.warnings.to_vec(),
            plot => figures.plot,
            sheet => STANDARD.encode(figures.sheet),
            disks => STANDARD.encode(figures.disks),
            between => figures.between.map(|b| STANDARD.encode(b)),
            scene => figures.scene.map(|s| STANDARD.encode(s)),
            filtering => filtering,
            version => env!("CARGO_PKG_VERSION"),
        })
        .map_err(failed)
}
