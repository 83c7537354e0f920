//! Pictures and the HTML page of a comparison.

mod between;
mod canvas;
mod disks;
pub(crate) mod pictures;
mod plot;
mod sheet;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, context};
use ndfmap_core::measure::FilteringError;
use ndfmap_maps::Source;

use crate::Failure;
use crate::imaging::RenderReport;
use crate::measure::{Comparison, Subject, three_digits};

/// What a report is drawn from.
pub(crate) struct Pages<'a> {
    pub(crate) subject: &'a Subject<'a>,
    pub(crate) comparison: &'a Comparison,
    /// Pictures of a scene, where asked for.
    pub(crate) reel: Option<&'a RenderReport>,
    pub(crate) source: &'a Source,
    pub(crate) warnings: &'a [String],
}

/// Draws every file of a report: names and bytes.
pub(crate) fn draw(pages: &Pages<'_>) -> Result<Vec<(&'static str, Vec<u8>)>, Failure> {
    let sheet = sheet::draw(pages.subject, pages.comparison).to_png()?;
    let disks = disks::draw(pages.subject, pages.comparison)?.to_png()?;
    // It bakes every mixture once more, unaligned: seconds that only those who ask about filtering should wait for.
    let asked = pages.subject.filtering;
    let between = if asked { between::draw(pages.subject, pages.comparison)? } else { None };
    let between = between.map(|canvas| canvas.to_png()).transpose()?;
    let plot = plot::errors_by_level(pages.comparison)?;
    let scene = pages.reel.map(|reel| pictures::draw(reel, &pages.source.file)).transpose()?;
    let figures = Figures {
        sheet: &sheet,
        disks: &disks,
        between: between.as_deref(),
        scene: scene.as_deref(),
        plot: &plot,
    };
    let html = page(pages, &figures)?;
    let json = format!("{:#}\n", pages.comparison.to_json(&pages.source.file));
    let mut files = vec![
        ("report.html", html.into_bytes()),
        ("contact-sheet.png", sheet),
        ("ndf.png", disks),
        ("compare.json", json.into_bytes()),
    ];
    files.extend(between.map(|between| ("alignment.png", between)));
    files.extend(scene.map(|scene| ("scene.png", scene)));
    Ok(files)
}

/// What a page shows, drawn.
struct Figures<'a> {
    sheet: &'a [u8],
    disks: &'a [u8],
    between: Option<&'a [u8]>,
    scene: Option<&'a [u8]>,
    plot: &'a str,
}

fn page(pages: &Pages<'_>, figures: &Figures<'_>) -> Result<String, Failure> {
    let failed = |e: minijinja::Error| Failure::Failed(format!("cannot write the report: {e}"));
    let mut environment = Environment::new();
    environment.add_template("report.html", include_str!("../../templates/report.html")).map_err(failed)?;
    let comparison = pages.comparison;
    let best: Vec<f64> = (0..comparison.sizes.len())
        .map(|level| comparison.rows.iter().map(|r| r.errors[level]).fold(f64::INFINITY, f64::min))
        .collect();
    let rows: Vec<minijinja::Value> = comparison
        .rows
        .iter()
        .map(|row| {
            let cells: Vec<minijinja::Value> = row
                .errors
                .iter()
                .zip(&best)
                .map(|(error, best)| context! { text => three_digits(*error), best => *error <= best * 1.0005 })
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
            let cell = |e: &FilteringError| format!("{} / {}", three_digits(e.filtered), three_digits(e.reference));
            context! { method => row.method.clone(), cells => row.filtering.iter().map(cell).collect::<Vec<_>>() }
        })
        .collect();
    let sizes: Vec<String> = comparison.sizes.iter().map(|s| format!("{}×{}", s.width, s.height)).collect();
    let template = environment.get_template("report.html").map_err(failed)?;
    template
        .render(context! {
            map => pages.source.file.clone(),
            lobe => comparison.lobe.clone(),
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
