//! Lobes that a filter has mixed at a corner between four texels, as in Tan et al. 2005, figure 5: the
//! histogram of the normals, lobes that were not aligned, aligned ones, and the reference path that shades
//! each texel by itself.

use glam::DVec2;
use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::fit::{Alignment, LobeKind};
use ndfmap_core::lookup::{Tap, Texels};
use ndfmap_core::measure::{TexelTruth, evaluate_neighbours};
use ndfmap_core::ndf::{AnyMethod, Gmm, Method, Vmf};
use ndfmap_core::observe::Cancelled;
use ndfmap_core::pyramid::Pyramid;
use ndfmap_core::sphere::DiskLattice;

use super::canvas::{Canvas, LETTER, LINE};
use super::disks::{PEN, SCALE, SIDE, busiest, plot};
use crate::compare::{Comparison, Row, Subject};

/// Level drawn, where the map has it.
const LEVEL: usize = 4;

/// Titles of the columns.
const COLUMNS: [&str; 4] = ["histogram", "unaligned", "as baked", "each texel shaded"];

/// Draws a row for every mixture that was compared; `None` without a mixture, or without a corner to look at.
pub(super) fn draw(subject: &Subject<'_>, comparison: &Comparison) -> Result<Option<Canvas>, Cancelled> {
    let rows: Vec<Mixture<'_>> = comparison.rows.iter().filter_map(mixture).collect();
    let sizes = &comparison.sizes;
    let level = (0..sizes.len()).rev().find(|l| *l <= LEVEL && sizes[*l].area() > 1);
    let Some(level) = level.filter(|_| !rows.is_empty()) else { return Ok(None) };
    let size = sizes[level];
    let pen = PEN.parse::<AnyLobe>().unwrap_or_else(|e| unreachable!("the pen is a constant: {e}"));
    let lattice = DiskLattice::new(SIDE, 0.99);
    let truth = TexelTruth::new(subject.surface, &*pen, &lattice);
    let (x, y) = busiest(subject, size)?;
    let place = DVec2::new((x + 1) as f64 / size.width as f64, (y + 1) as f64 / size.height as f64);
    let disk = SIDE * SCALE;
    let (label, step_x, step_y) = (20 * LETTER, disk.max(18 * LETTER) + 8, disk + LINE);
    let mut canvas = Canvas::new(label + COLUMNS.len() * step_x, 2 * LINE + rows.len() * step_y);
    for (column, title) in COLUMNS.iter().enumerate() {
        canvas.text(label + column * step_x, 8, title);
    }
    let mut histogram = vec![0.0; lattice.len()];
    for n in rows[0].row.pyramid.neighbours(Tap { uv: place, lod: level as f64 }) {
        let lobe = truth.texel(size, n.x, n.y);
        histogram.iter_mut().zip(lobe).for_each(|(sum, f)| *sum += n.weight * f);
    }
    let peak = histogram.iter().copied().fold(1e-12, f64::max);
    for (at, Mixture { row, method, unaligned }) in rows.iter().enumerate() {
        let y = 2 * LINE + at * step_y;
        canvas.text(8, y + 8, &row.method);
        canvas.text(8, y + 8 + LINE, &format!("level {level}, corner"));
        let bake = Bake::new(subject.surface, &**unaligned).precision(subject.precision);
        let (apart, _) = bake.to_pyramid()?;
        let filtered = |pyramid: &Pyramid, method: &dyn Method| {
            let mut out = vec![0.0; lattice.len()];
            let mut channels = vec![0.0; pyramid.channels()];
            pyramid.bilinear(level, place, 1.0, &mut channels);
            method.evaluator(&*pen, &lattice.directions).evaluate(&channels, &mut out);
            out
        };
        let mut shaded = vec![0.0; lattice.len()];
        let evaluator = method.evaluator(&*pen, &lattice.directions);
        evaluate_neighbours(&row.pyramid, &*evaluator, (place, level as f64), &mut shaded);
        let columns =
            [histogram.clone(), filtered(&apart, &**unaligned), filtered(&row.pyramid, &**method), shaded];
        for (column, lobe) in columns.iter().enumerate() {
            plot(&mut canvas, &lattice, (label + column * step_x, y), lobe, peak);
        }
    }
    Ok(Some(canvas))
}

/// Mixture in the comparison: its row, its method, and the same method unaligned.
struct Mixture<'a> {
    row: &'a Row,
    method: AnyMethod,
    unaligned: AnyMethod,
}

fn mixture(row: &Row) -> Option<Mixture<'_>> {
    let method = row.method.parse::<AnyMethod>().ok()?;
    let fit = method.fit().filter(|f| f.lobes > 1 && f.alignment != Alignment::Unaligned)?;
    let unaligned = match fit.kind {
        LobeKind::Spherical => Vmf::new(fit.lobes).ok()?.alignment(Alignment::Unaligned).into(),
        LobeKind::Planar => Gmm::new(fit.lobes).ok()?.alignment(Alignment::Unaligned).into(),
        LobeKind::Peaks => return None,
    };
    Some(Mixture { row, method, unaligned })
}
