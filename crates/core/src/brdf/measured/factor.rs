//! Factoring a table of measurements: `M(theta_h, theta_d) ~ kd + f(theta_h) g(theta_d)`, then f into kernels
//! and g into a polynomial over a cosine.
//!
//! Alternating least squares, none of the factors negative, over the means of `phi_d`. Errors count relative
//! to the reflectance around them, so that the tail counts beside a peak a thousand times as high, and by
//! what a pair of directions exchanges: solid angle and both cosines, without which grazing angles would
//! decide everything. The residual is measured over the table as it is, with no such weight.

use std::f64::consts::PI;

use glam::DVec3;
use nalgebra::{SMatrix, SVector};

use super::{LobeFactors, kernel};

/// Bins of `theta_h` and of `theta_d` in a MERL table, to 90 degrees.
pub const BINS: usize = 90;

/// Error that a fit leaves of a table: the root of its sum of squares over that of the table itself. Each
/// square counts by solid angle, and times both cosines: by what is exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Error of `kd + f g`, as tabulated.
    pub factored: f64,
    /// Error of the lobe in the end: kernels and polynomial.
    pub fitted: f64,
}

/// The half angle at a place in the table, in bins: MERL tables are finer towards the peak, `theta_h =
/// (i/90)² 90°`.
#[must_use]
pub fn half_angle(i: f64) -> f64 {
    let part = i / BINS as f64;
    part * part * PI / 2.0
}

/// The difference angle at a place in the table, in bins, evenly.
fn difference_angle(i: f64) -> f64 {
    i / BINS as f64 * PI / 2.0
}

/// Directions to the light and to the eye, from Rusinkiewicz' angles.
fn directions(theta_h: f64, theta_d: f64, phi_d: f64) -> (DVec3, DVec3) {
    let (sin, cos) = theta_h.sin_cos();
    let wh = DVec3::new(sin, 0.0, cos);
    let (sin_d, cos_d) = theta_d.sin_cos();
    let (sin_phi, cos_phi) = phi_d.sin_cos();
    let d = DVec3::new(sin_d * cos_phi, sin_d * sin_phi, cos_d);
    let wi = DVec3::new(cos * d.x + sin * d.z, d.y, cos * d.z - sin * d.x);
    (wi, 2.0 * wi.dot(wh) * wh - wi)
}

/// Number of kernels. Their variances go from a fiftieth of a degree to half the hemisphere, each 1.23 times
/// the one before, so that two of them make any other between them to 1 %.
const KERNELS: usize = 75;

/// Sweeps of the descent over the kernels.
const SWEEPS: usize = 4000;

fn variance(k: usize) -> f64 {
    1e-7 * (0.4_f64 / 1e-7).powf(k as f64 / (KERNELS - 1) as f64)
}

/// Means over `phi_d` of the measurements at a pair of angles.
#[derive(Clone, Copy, Default)]
struct Cell {
    mean: DVec3,
    /// Solid angle times both cosines.
    weight: f64,
}

pub(super) fn factor(
    turns: usize,
    reflectance: impl Fn(DVec3, DVec3, usize) -> Option<DVec3>,
) -> LobeFactors {
    let samples = |h: usize, d: usize| {
        let (theta_h, theta_d) = (half_angle(h as f64 + 0.5), difference_angle(d as f64 + 0.5));
        let reflectance = &reflectance;
        (0..turns).filter_map(move |p| {
            let (wi, wo) = directions(theta_h, theta_d, PI * (p as f64 + 0.5) / turns as f64);
            let above = wi.z > 0.0 && wo.z > 0.0;
            let value = above.then(|| reflectance(wi, wo, (h * BINS + d) * turns + p)).flatten()?;
            Some((value, wi.z * wo.z))
        })
    };
    let solid_angle = |h: usize, d: usize| {
        let step = half_angle(h as f64 + 1.0) - half_angle(h as f64);
        half_angle(h as f64 + 0.5).sin() * step * difference_angle(d as f64 + 0.5).sin()
    };
    let cell = |i: usize| {
        let (h, d) = (i / BINS, i % BINS);
        let mut cell = Cell::default();
        for (value, cosine) in samples(h, d) {
            cell.mean += value * cosine;
            cell.weight += cosine;
        }
        if cell.weight > 0.0 {
            cell.mean /= cell.weight;
            cell.weight *= solid_angle(h, d) / turns as f64;
        }
        cell
    };
    let cells: Vec<Cell> = (0..BINS * BINS).map(cell).collect();
    let tables = Tables::fit(&cells);
    let kernels = tables.kernels();
    let tint = tables.tint(&cells);
    let lobe = |theta: f64| kernels.iter().map(|(w, v)| w * kernel(*v, theta.cos())).sum::<f64>();
    let colour = |d: usize| super::colour(&tint, difference_angle(d as f64 + 0.5).cos());
    let (mut all, mut factored, mut fitted) = (0.0, 0.0, 0.0);
    for i in 0..BINS * BINS {
        let (h, d) = (i / BINS, i % BINS);
        let by_tables = tables.diffuse + tables.f[h] * tables.g[d];
        let by_lobe = tables.diffuse + lobe(half_angle(h as f64 + 0.5)) * colour(d);
        for (value, cosine) in samples(h, d) {
            let weight = solid_angle(h, d) * cosine * cosine;
            all += weight * value.length_squared();
            factored += weight * (value - by_tables).length_squared();
            fitted += weight * (value - by_lobe).length_squared();
        }
    }
    let relative = |left: f64| if all > 0.0 { (left / all).sqrt() } else { 0.0 };
    let residual = Residual { factored: relative(factored), fitted: relative(fitted) };
    LobeFactors { diffuse: tables.diffuse * PI, kernels, tint, residual }
}

/// The factors as tables.
struct Tables {
    diffuse: DVec3,
    f: Vec<f64>,
    g: Vec<DVec3>,
    /// Reflectance below which f does not matter.
    floor: f64,
}

/// Rounds of the alternating fit; after forty nothing moves by more than 1e-4.
const ROUNDS: usize = 60;

impl Tables {
    fn fit(cells: &[Cell]) -> Self {
        let at = |h: usize, d: usize| cells[h * BINS + d];
        let mut diffuse = dim(cells);
        let floor = 0.05 * diffuse.element_sum() / 3.0 + 1e-4;
        // Errors count relative to the reflectance around: the mean over a row, and the floor.
        let around = |h: usize| {
            let (sum, weight) = (0..BINS).map(|d| at(h, d)).fold((0.0, 0.0), |(sum, weight), cell| {
                (sum + cell.weight * cell.mean.element_sum() / 3.0, weight + cell.weight)
            });
            (if weight > 0.0 { sum / weight } else { 0.0 }) + floor
        };
        let scale: Vec<f64> = (0..BINS).map(|h| around(h).powi(-2)).collect();
        let weight = |h: usize, d: usize| at(h, d).weight * scale[h];
        let (mut f, mut g) = (vec![0.0; BINS], vec![DVec3::ONE; BINS]);
        for _ in 0..ROUNDS {
            for (h, f) in f.iter_mut().enumerate() {
                let (mut sum, mut square) = (0.0, 0.0);
                for (d, &g) in g.iter().enumerate() {
                    let w = weight(h, d);
                    sum += w * (at(h, d).mean - diffuse).dot(g);
                    square += w * g.length_squared();
                }
                *f = if square > 0.0 { (sum / square).max(0.0) } else { 0.0 };
            }
            for (d, g) in g.iter_mut().enumerate() {
                let (mut sum, mut square) = (DVec3::ZERO, 0.0);
                for (h, &f) in f.iter().enumerate() {
                    let w = weight(h, d);
                    sum += (at(h, d).mean - diffuse) * (w * f);
                    square += w * f * f;
                }
                *g = if square > 0.0 { (sum / square).max(DVec3::ZERO) } else { DVec3::ZERO };
            }
            // g is scaled to a mean of one, so that f is the lobe.
            let (mut sum, mut all) = (0.0, 0.0);
            for (cell, g) in cells.iter().zip(g.iter().cycle()) {
                sum += cell.weight * g.element_sum() / 3.0;
                all += cell.weight;
            }
            if sum > 0.0 {
                let mean = sum / all;
                g.iter_mut().for_each(|g| *g /= mean);
                f.iter_mut().for_each(|f| *f *= mean);
            }
            let (mut sum, mut all) = (DVec3::ZERO, 0.0);
            for (h, &f) in f.iter().enumerate() {
                for (d, &g) in g.iter().enumerate() {
                    let w = weight(h, d);
                    sum += (at(h, d).mean - f * g) * w;
                    all += w;
                }
            }
            if all > 0.0 {
                diffuse = (sum / all).max(DVec3::ZERO);
            }
        }
        Self { diffuse, f, g, floor }
    }

    /// f as kernels, none of negative weight, by coordinate descent.
    fn kernels(&self) -> Vec<(f64, f64)> {
        // Each bin counts relative to its own value: by solid angle, the peak would have no say in its own
        // height.
        let weight = |h: usize| 1.0 / (self.f[h] + self.floor);
        let column = |k: usize| -> Vec<f64> {
            (0..BINS).map(|h| weight(h) * kernel(variance(k), half_angle(h as f64 + 0.5).cos())).collect()
        };
        let columns: Vec<Vec<f64>> = (0..KERNELS).map(column).collect();
        let mut left: Vec<f64> = (0..BINS).map(|h| weight(h) * self.f[h]).collect();
        let mut weights = [0.0_f64; KERNELS];
        for _ in 0..SWEEPS {
            for (w, column) in weights.iter_mut().zip(&columns) {
                let square: f64 = column.iter().map(|a| a * a).sum();
                let step: f64 = column.iter().zip(&left).map(|(a, r)| a * r).sum::<f64>() / square;
                let next = (*w + step).max(0.0);
                left.iter_mut().zip(column).for_each(|(r, a)| *r -= (next - *w) * a);
                *w = next;
            }
        }
        let light: f64 = weights.iter().sum();
        let alive = weights.iter().enumerate().filter(|(_, w)| **w > 1e-6 * light);
        alive.map(|(k, w)| (*w, variance(k))).collect()
    }

    /// g times `cos² theta_d`, as a polynomial in `1 - cos theta_d`: a reflectance is a fraction over the two
    /// cosines to the normal, which at the narrow half angles of a highlight are both `cos theta_d`, and its
    /// numerator is smooth.
    fn tint(&self, cells: &[Cell]) -> [DVec3; 6] {
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut right = SMatrix::<f64, 6, 3>::zeros();
        for d in 0..BINS {
            let weight: f64 = (0..BINS).map(|h| cells[h * BINS + d].weight).sum();
            let u = difference_angle(d as f64 + 0.5).cos();
            let x = 1.0 - u;
            let powers = SVector::<f64, 6>::from_fn(|i, _| x.powi(i as i32));
            normal += powers * powers.transpose() * weight;
            for c in 0..3 {
                for i in 0..6 {
                    right[(i, c)] += powers[i] * weight * self.g[d][c] * u * u;
                }
            }
        }
        let Some(solved) = normal.cholesky().map(|c| c.solve(&right)) else { return [DVec3::ZERO; 6] };
        std::array::from_fn(|i| DVec3::new(solved[(i, 0)], solved[(i, 1)], solved[(i, 2)]))
    }
}

/// Reflectance away from the highlight, channel by channel: a tenth of the table, by weight, is darker.
fn dim(cells: &[Cell]) -> DVec3 {
    let tenth = 0.1 * cells.iter().map(|c| c.weight).sum::<f64>();
    let of = |channel: usize| {
        let mut all: Vec<(f64, f64)> =
            cells.iter().filter(|c| c.weight > 0.0).map(|c| (c.mean[channel], c.weight)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        let darker = all.iter().find(|(_, weight)| {
            sum += weight;
            sum >= tenth
        });
        darker.map_or(0.0, |(value, _)| *value)
    };
    DVec3::from([0, 1, 2].map(of))
}
