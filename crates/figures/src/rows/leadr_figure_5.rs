//! Dupuy et al., supplemental, figure 5: the filter that a grid of slopes reconstructs, and one that is
//! drawn.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use ndfmap::Error;
use ndfmap::core::ndf::{SlopeGaussian, SlopeGrid};
use ndfmap::draw::{Disk, Panel, Sheet, SheetRow};

use super::texels::{apart, peak};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "leadr-figure-5",
    paper: Paper::Leadr,
    place: "Figure 5",
    summary: "filters over an environment that slopes in a grid and slopes drawn at random reconstruct",
    draw,
};

/// Slopes on a side.
const SLOPES: [usize; 4] = [5, 9, 32, 128];

/// Points of the disk on a side.
const POINTS: usize = 66;

/// Deviation of the slopes.
const DEVIATION: f64 = 0.3;

/// Side of the cube map.
const SIDE: usize = 256;

/// Angles of the eye from the vertical, in degrees.
const VIEWS: [f64; 2] = [10.0, 55.0];

/// The filter at each direction: every facet spreads its share by a tent as wide as the texels that are mixed
/// for it.
fn filter(disk: &Disk, g: &SlopeGaussian, grid: &SlopeGrid, wo: DVec3) -> Vec<f64> {
    let mut values = vec![0.0; disk.lattice.len()];
    for facet in g.mirrored(grid, wo, SIDE) {
        // A texel of a cube of `side` spans pi/(2 side), as the paper counts; a point of the disk is wider
        // than the finest.
        let width = (PI / (2.0 * SIDE as f64) * facet.lod.max(0.0).exp2()).clamp(3.0 / POINTS as f64, PI);
        // The tent's integral over the sphere.
        let whole = 2.0 * PI * (1.0 - width.sin() / width);
        for (value, w) in values.iter_mut().zip(&disk.lattice.directions) {
            let angle = w.dot(facet.towards).clamp(-1.0, 1.0).acos();
            *value += facet.share * (1.0 - angle / width).max(0.0) / whole;
        }
    }
    values
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let disk = Disk::new(POINTS, 3);
    let square = DEVIATION * DEVIATION;
    let g = SlopeGaussian { height: 0.0, mean: DVec2::ZERO, covariance: [square, square, 0.0] };
    let (mut rows, mut claims) = (Vec::new(), Vec::new());
    for degrees in VIEWS {
        plan.observer.check()?;
        let (sin, cos) = f64::to_radians(degrees).sin_cos();
        let wo = DVec3::new(-sin, 0.0, cos);
        let converged = filter(&disk, &g, &SlopeGrid::new(128), wo);
        let white = peak(&converged);
        let row = |head: &str, of: fn(usize) -> SlopeGrid| {
            let filters: Vec<Vec<f64>> = SLOPES.iter().map(|n| filter(&disk, &g, &of(*n), wo)).collect();
            let errors: Vec<f64> = filters.iter().map(|f| apart(f, &converged)).collect();
            let panel = |(values, error): (&Vec<f64>, &f64)| {
                Some(Panel::of(disk.draw(values, white)).said([format!("L2 {error:.3}")]))
            };
            let panels = filters.iter().zip(&errors).map(panel).collect();
            (SheetRow { head: vec![head.to_owned(), format!("eye at {degrees}°")], panels }, errors)
        };
        let (grid, of_grid) = row("grid", SlopeGrid::new);
        let (drawn, of_drawn) = row("drawn", SlopeGrid::drawn);
        rows.extend([grid, drawn]);
        for (at, n) in SLOPES[..2].iter().enumerate() {
            let says =
                format!("eye at {degrees}°, {n} × {n}: error of the grid over that of drawn slopes, below 1");
            let ratio = of_grid[at] / of_drawn[at];
            claims.push(Claim::number(says, ratio).holds(ratio < 1.0));
        }
    }
    let columns = SLOPES.map(|n| format!("{n} × {n}")).to_vec();
    let title = format!("Filters of slopes of deviation {DEVIATION}, seen from above");
    Ok(Drawing {
        sheets: vec![Sheet { title, columns, rows, scale: None }],
        claims,
        why: "Errors are against the grid of 128 × 128. The paper shows two views and their pictures of a cube map, \
              and says that the grid is better for few slopes.",
    })
}
