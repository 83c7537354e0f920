//! Distribution of the normals under one texel, drawn on the unit disk: the truth beside every method.

use glam::Vec3;
use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::Size;
use ndfmap_core::measure::TexelTruth;
use ndfmap_core::ndf::{AnyMethod, Toksvig};
use ndfmap_core::observe::Cancelled;
use ndfmap_core::pyramid::Precision;

use crate::compare::{Comparison, Subject};
use crate::draw::{Disk, Panel, Sheet, SheetRow};

/// Points of the lattice a side, and pixels a point.
pub(super) const SIDE: usize = 72;
pub(super) const SCALE: usize = 3;

/// Levels drawn; at each, the texel whose normals stray most.
const LEVELS: [usize; 3] = [3, 5, 7];

/// Sharp lobe through which normals are drawn, so that all methods draw the same thing.
pub(super) fn pen() -> AnyLobe {
    "blinn-phong:200".parse().unwrap_or_else(|e| unreachable!("the pen is a constant: {e}"))
}

/// Draws the disks: a row a level, a column a method.
pub(super) fn draw(subject: &Subject<'_>, comparison: &Comparison) -> Result<Sheet, Cancelled> {
    let (pen, disk) = (pen(), Disk::new(SIDE, SCALE));
    let truth = TexelTruth::new(subject.surface, &*pen, &disk.lattice);
    let last = comparison.sizes.len() - 1;
    let mut levels: Vec<usize> = LEVELS.iter().map(|l| *l.min(&last)).collect();
    levels.dedup();
    let names = comparison.rows.iter().map(|row| row.method.clone());
    let columns = std::iter::once("truth".to_owned()).chain(names).collect();
    let mut rows = Vec::new();
    for level in levels {
        let size = comparison.sizes[level];
        let (x, y) = busiest(subject, size)?;
        let true_lobe = truth.texel(size, x, y);
        let peak = true_lobe.iter().copied().fold(1e-12, f64::max);
        let mut panels = vec![Some(Panel::of(disk.draw(&true_lobe, peak)))];
        for row in &comparison.rows {
            let panel = row.method.parse::<AnyMethod>().ok().map(|method| {
                let mut lobe = vec![0.0; disk.lattice.len()];
                let evaluator = method.evaluator(&*pen, &disk.lattice.directions);
                evaluator.evaluate(&row.pyramid.texel(level, x, y), &mut lobe);
                Panel::of(disk.draw(&lobe, peak))
            });
            panels.push(panel);
        }
        rows.push(SheetRow { head: vec![format!("level {level}"), format!("texel {x}, {y}")], panels });
    }
    Ok(Sheet { title: "Normals under one texel, seen from above".to_owned(), columns, rows, scale: None })
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
