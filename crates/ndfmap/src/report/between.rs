//! Lobes that a filter has mixed at a corner between four texels, as in Tan et al. 2005, figure 5: the
//! histogram of the normals, lobes that were not aligned, aligned ones, and the reference path that shades
//! each texel by itself.

use glam::DVec2;
use ndfmap_core::bake::Bake;
use ndfmap_core::fit::{Alignment, LobeKind};
use ndfmap_core::lookup::{Tap, Texels};
use ndfmap_core::measure::{TexelTruth, evaluate_neighbours};
use ndfmap_core::ndf::{AnyMethod, Gmm, Method, Vmf};
use ndfmap_core::pyramid::Pyramid;

use super::disks::{SCALE, SIDE, busiest, pen};
use crate::Error;
use crate::compare::{Comparison, Row, Subject};
use crate::draw::{Disk, Panel, Sheet, SheetRow};

/// Level drawn, where the map has it.
const LEVEL: usize = 4;

/// Titles of the columns.
const COLUMNS: [&str; 4] = ["histogram", "unaligned", "as baked", "each texel shaded"];

/// Sheet with a row for every mixture that was compared: a corner between four texels, by the histogram of
/// its normals, by lobes that were fitted apart, by those of the comparison, and texel by texel. `None`
/// without a mixture, or without a corner to look at.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn corner_sheet(subject: &Subject<'_>, comparison: &Comparison) -> Result<Option<Sheet>, Error> {
    let rows: Vec<Mixture<'_>> = comparison.rows.iter().filter_map(mixture).collect();
    let sizes = &comparison.sizes;
    let level = (0..sizes.len()).rev().find(|l| *l <= LEVEL && sizes[*l].area() > 1);
    let Some(level) = level.filter(|_| !rows.is_empty()) else { return Ok(None) };
    let size = sizes[level];
    let (pen, disk) = (pen(), Disk::new(SIDE, SCALE));
    let lattice = &disk.lattice;
    let truth = TexelTruth::new(subject.surface, &*pen, lattice);
    let (x, y) = busiest(subject, size)?;
    let place = DVec2::new((x + 1) as f64 / size.width as f64, (y + 1) as f64 / size.height as f64);
    let mut histogram = vec![0.0; lattice.len()];
    for n in rows[0].row.pyramid.neighbours(Tap { uv: place, lod: level as f64 }) {
        let lobe = truth.texel(size, n.x, n.y);
        histogram.iter_mut().zip(lobe).for_each(|(sum, f)| *sum += n.weight * f);
    }
    let peak = histogram.iter().copied().fold(1e-12, f64::max);
    let mut drawn = Vec::new();
    for Mixture { row, method, unaligned } in &rows {
        let bake = Bake::new(subject.surface, &**unaligned).precision(subject.storage.baked());
        let apart = subject.storage.stored(bake.to_pyramid()?.0, unaligned.encoding());
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
            [&histogram, &filtered(&apart, &**unaligned), &filtered(&row.pyramid, &**method), &shaded];
        let panels = columns.into_iter().map(|lobe| Some(Panel::of(disk.draw(lobe, peak)))).collect();
        drawn.push(SheetRow { head: vec![row.method.clone()], panels });
    }
    Ok(Some(Sheet {
        title: format!("Normals at a corner between four texels of level {level}"),
        columns: COLUMNS.map(str::to_owned).to_vec(),
        rows: drawn,
        scale: None,
    }))
}

/// Mixture in the comparison: its row, its method, and as many lobes of the kind fitted apart.
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
