//! Distribution of the normals under one texel, drawn on the unit disk: the truth beside every method.

use glam::Vec3;
use ndfmap_core::bake::Bake;
use ndfmap_core::grid::Size;
use ndfmap_core::measure::TexelTruth;
use ndfmap_core::ndf::{AnyMethod, Toksvig};
use ndfmap_core::observe::Cancelled;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::sphere::DiskLattice;

use super::canvas::{Canvas, LETTER, LINE, heat};
use crate::compare::{Comparison, Subject};
use ndfmap_core::brdf::AnyLobe;

/// Points of the lattice a side, and pixels a point.
pub(super) const SIDE: usize = 72;
pub(super) const SCALE: usize = 2;

/// Sharp lobe through which the normals are drawn, so that all methods draw the same thing.
pub(super) const PEN: &str = "blinn-phong:200";

/// Levels drawn; at each, the texel whose normals stray most.
const LEVELS: [usize; 3] = [3, 5, 7];

/// Draws the disks: a row a level, a column a method.
pub(super) fn draw(subject: &Subject<'_>, comparison: &Comparison) -> Result<Canvas, Cancelled> {
    let pen = PEN.parse::<AnyLobe>().unwrap_or_else(|e| unreachable!("the pen is a constant: {e}"));
    let lattice = DiskLattice::new(SIDE, 0.99);
    let truth = TexelTruth::new(subject.surface, &*pen, &lattice);
    let last = comparison.sizes.len() - 1;
    let mut levels: Vec<usize> = LEVELS.iter().map(|l| *l.min(&last)).collect();
    levels.dedup();
    let disk = SIDE * SCALE;
    let (label, step_x, step_y) = (11 * LETTER, disk.max(23 * LETTER) + 8, disk + LINE);
    let mut canvas =
        Canvas::new(label + (comparison.rows.len() + 1) * step_x, 2 * LINE + levels.len() * step_y);
    canvas.text(label, 8, "truth");
    for (column, row) in comparison.rows.iter().enumerate() {
        canvas.text(label + (column + 1) * step_x, 8, &row.method);
    }
    for (at, level) in levels.iter().enumerate() {
        let y = 2 * LINE + at * step_y;
        let size = comparison.sizes[*level];
        let texel = busiest(subject, size)?;
        canvas.text(8, y + 8, &format!("level {level}"));
        canvas.text(8, y + 8 + LINE, &format!("({},{})", texel.0, texel.1));
        let true_lobe = truth.texel(size, texel.0, texel.1);
        // The square root spreads the dark end; the truth's peak is white, and so are higher values.
        let peak = true_lobe.iter().copied().fold(1e-12, f64::max);
        plot(&mut canvas, &lattice, (label, y), &true_lobe, peak);
        for (column, row) in comparison.rows.iter().enumerate() {
            let Ok(method) = row.method.parse::<AnyMethod>() else { continue };
            let mut lobe = vec![0.0; lattice.len()];
            method
                .evaluator(&*pen, &lattice.directions)
                .evaluate(&row.pyramid.texel(*level, texel.0, texel.1), &mut lobe);
            plot(&mut canvas, &lattice, (label + (column + 1) * step_x, y), &lobe, peak);
        }
    }
    Ok(canvas)
}

/// Texel of a level whose mean normal is shortest.
pub(super) fn busiest(subject: &Subject<'_>, size: Size) -> Result<(usize, usize), Cancelled> {
    let bake = Bake::new(subject.surface, &Toksvig).precision(Precision::Single);
    let (pyramid, _) = bake.to_pyramid()?;
    let level = pyramid.sizes().iter().position(|s| *s == size).unwrap_or(0);
    let length = |(x, y): &(usize, usize)| Vec3::from_slice(&pyramid.texel(level, *x, *y)).length();
    let texels = (0..size.area()).map(|i| (i % size.width, i / size.width));
    Ok(texels.min_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or((0, 0)))
}

pub(super) fn plot(
    canvas: &mut Canvas,
    lattice: &DiskLattice,
    (x0, y0): (usize, usize),
    lobe: &[f64],
    peak: f64,
) {
    let pixel = |c: f64| ((c + 1.0) / 2.0 * SIDE as f64) as usize;
    for (w, value) in lattice.directions.iter().zip(lobe) {
        let colour = heat((value / peak).clamp(0.0, 1.0).sqrt());
        // y runs up the disk, and down the picture.
        let (i, j) = (pixel(w.x), SIDE - 1 - pixel(w.y));
        for dy in 0..SCALE {
            for dx in 0..SCALE {
                canvas.set(x0 + i * SCALE + dx, y0 + j * SCALE + dy, colour);
            }
        }
    }
}
