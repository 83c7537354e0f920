//! The contact sheet: the map under one light at growing distances, the truth beside every method.

use glam::DVec3;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::measure::TexelTruth;
use ndfmap_core::sphere::DiskLattice;
use ndfmap_scene::metrics::display_value;
use rayon::prelude::*;

use crate::compare::{Comparison, Subject, three_digits};
use crate::draw::{Panel, Sheet, SheetRow};
use ndfmap_core::ndf::AnyMethod;

/// Pixels of a cell's longer side.
const CELL: usize = 176;

/// Levels shown, at most.
const ROWS: usize = 6;

/// Half-vector (or light) of the sheet: a little off the vertical, so that slopes show.
fn direction() -> DVec3 {
    DVec3::new(0.22, 0.17, 1.0).normalize()
}

/// Column of cells: the title above it, and the values of each level shown.
struct Column {
    title: String,
    levels: Vec<Vec<f64>>,
    errors: Vec<String>,
}

/// Draws the sheet.
pub(super) fn draw(subject: &Subject<'_>, comparison: &Comparison) -> Sheet {
    // Finest level that fits a cell, and every one below it.
    let first = comparison.sizes.iter().position(|s| s.width.max(s.height) <= CELL).unwrap_or(0);
    let shown: Vec<(usize, Size)> =
        comparison.sizes.iter().copied().enumerate().skip(first).take(ROWS).collect();
    let columns = columns(subject, comparison, &shown);
    // All cells share one exposure: a thousandth of the nearest true texels exceed its white.
    let mut bright = columns[0].levels[0].clone();
    bright.sort_by(f64::total_cmp);
    let white = bright[bright.len() - 1 - bright.len() / 1000].max(1e-9);

    let finest = comparison.sizes[0];
    let side = |n: usize| (n * CELL / finest.width.max(finest.height)).max(1);
    let cell = Size { width: side(finest.width), height: side(finest.height) };
    let row = |(at, (level, size)): (usize, &(usize, Size))| {
        let panel = |column: &Column| {
            let picture = Grid::from_fn(cell, |i, j| {
                let texel = (j * size.height / cell.height) * size.width + i * size.width / cell.width;
                let v = (display_value((column.levels[at][texel] / white) as f32) * 255.0).round() as u8;
                [v; 3]
            });
            Some(Panel::of(picture).said(column.errors.get(at).cloned()))
        };
        let head = vec![format!("level {level}"), format!("{} × {}", size.width, size.height)];
        SheetRow { head, panels: columns.iter().map(panel).collect() }
    };
    Sheet {
        title: "The map under one light, at growing distances".to_owned(),
        columns: columns.iter().map(|c| c.title.clone()).collect(),
        rows: shown.iter().enumerate().map(row).collect(),
        scale: None,
    }
}

fn columns(subject: &Subject<'_>, comparison: &Comparison, shown: &[(usize, Size)]) -> Vec<Column> {
    let w = direction();
    let lattice = DiskLattice { directions: vec![w], rows: vec![(w.y, 0..1)] };
    // Of a measured material, its green lobe.
    let green = subject.lobe.measured().map(|measured| AnyLobe::from(measured.channel(1)));
    let lobe = green.as_deref().unwrap_or(subject.lobe);
    let truth = TexelTruth::new(subject.surface, lobe, &lattice);
    let texels = |size: Size| (0..size.area()).into_par_iter().map(move |i| (i % size.width, i / size.width));
    let true_levels = shown
        .iter()
        .map(|(_, size)| texels(*size).map(|(x, y)| truth.texel(*size, x, y)[0]).collect())
        .collect();
    let mut columns = vec![Column { title: "truth".to_owned(), levels: true_levels, errors: Vec::new() }];
    for row in &comparison.rows {
        let Ok(method) = row.method.parse::<AnyMethod>() else { continue };
        let evaluator = method.evaluator(lobe, &lattice.directions);
        let value = |level: usize, x: usize, y: usize| {
            let mut out = [0.0];
            evaluator.evaluate(&row.pyramid.texel(level, x, y), &mut out);
            out[0]
        };
        let levels = shown
            .iter()
            .map(|(level, size)| texels(*size).map(|(x, y)| value(*level, x, y)).collect())
            .collect();
        let errors = shown
            .iter()
            .map(|(level, _)| format!("error {}", three_digits(row.levels[*level].error)))
            .collect();
        columns.push(Column { title: row.method.clone(), levels, errors });
    }
    columns
}
