//! Pictures and the HTML page of a comparison.

mod canvas;
mod disks;
mod plot;
mod sheet;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, context};
use ndfmap_maps::Source;

use crate::Failure;
use crate::measure::{Comparison, Subject, three_digits};

/// What a report is drawn from.
pub(crate) struct Pages<'a> {
    pub(crate) subject: &'a Subject<'a>,
    pub(crate) comparison: &'a Comparison,
    pub(crate) source: &'a Source,
    pub(crate) warnings: &'a [String],
}

/// Draws every file of a report: names and bytes.
pub(crate) fn draw(pages: &Pages<'_>) -> Result<Vec<(&'static str, Vec<u8>)>, Failure> {
    let sheet = sheet::draw(pages.subject, pages.comparison).to_png()?;
    let disks = disks::draw(pages.subject, pages.comparison).to_png()?;
    let plot = plot::errors_by_level(pages.comparison)?;
    let html = page(pages, &sheet, &disks, &plot)?;
    let json = format!("{:#}\n", pages.comparison.to_json(&pages.source.file));
    Ok(vec![
        ("report.html", html.into_bytes()),
        ("contact-sheet.png", sheet),
        ("ndf.png", disks),
        ("compare.json", json.into_bytes()),
    ])
}

fn page(pages: &Pages<'_>, sheet: &[u8], disks: &[u8], plot: &str) -> Result<String, Failure> {
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
    let sizes: Vec<String> = comparison.sizes.iter().map(|s| format!("{}×{}", s.width, s.height)).collect();
    let template = environment.get_template("report.html").map_err(failed)?;
    template
        .render(context! {
            map => pages.source.file.clone(),
            brdf => comparison.brdf.clone(),
            size => sizes.first(),
            sizes => sizes,
            rows => rows,
            warnings => pages.warnings.to_vec(),
            plot => plot,
            sheet => STANDARD.encode(sheet),
            disks => STANDARD.encode(disks),
            version => env!("CARGO_PKG_VERSION"),
        })
        .map_err(failed)
}
