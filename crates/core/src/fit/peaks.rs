//! Peaks: a few Phong lobes by non-linear least squares. Fournier 1992, "Normal Distribution Functions and
//! Multiple Surfaces", as Tan et al. 2005 and Han et al. 2007 compare with it.
//!
//! The fit is to the texel's effective lobe under Blinn-Phong of exponent [`PROBE_EXPONENT`], a sharp enough
//! look at its normals that is still smooth. It compares the sum of peaks, each
//! `weight (s'+1)/(2 pi) (w·d)^{s'}`, `s' = s PROBE_EXPONENT/(s + PROBE_EXPONENT)`, with the mean over the
//! normals, at a grid of directions around them. It starts from EM's lobes, and weights are brought to sum
//! to one at the end, so that energy is kept.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::assign::MAX_LOBES;
use super::em::{iterate, start_from_furthest};
use super::family::{Isotropic, Spherical};
use super::samples::{Samples, Samplings};
use super::{FitJob, FittedRows, PARENT_ROUNDS, at};
use crate::observe::Cancelled;
use crate::pyramid::level_sizes;

/// Exponent of the lobe through which normals are seen.
const PROBE_EXPONENT: f64 = 100.0;

/// The sharpest peak that a half float holds; it stands for no width at all.
pub const SHARPEST: f32 = 6e4;

/// Directions a side of the grid on which a texel is fitted.
const SIDE: usize = 12;

/// Reach of the grid beyond the normals, in `w.xy`: two deviations of the lobe they are seen through.
const MARGIN: f32 = 0.2;

/// Spread `1 - |r|²` below which a texel is one direction.
const ONE_DIRECTION: f32 = 1e-5;

/// Fits every texel of every level by itself.
pub(super) fn fit_levels<E: From<Cancelled>>(
    peaks: usize,
    job: &FitJob<'_>,
    emit: &mut dyn FnMut(&FittedRows<'_>) -> Result<(), E>,
) -> Result<(), E> {
    assert!(job.attributes.is_empty(), "peaks carry no attributes");
    let sizes = level_sizes(job.surface.size());
    let samplings = Samplings::new(Spherical::<false>, job.surface, &sizes);
    let total: usize = sizes.iter().map(|s| s.area()).sum();
    let mut done = 0;
    for (level, size) in sizes.iter().enumerate() {
        let grid = samplings.for_level(*size);
        // In bands, so that progress shows: a texel takes about a millisecond.
        let band = (4096 / size.width).max(1);
        for start in (0..size.height).step_by(band) {
            job.observer.check()?;
            let rows = start..(start + band).min(size.height);
            let mut sums = vec![[0.0; 4]; rows.len() * size.width * peaks];
            sums.par_chunks_mut(peaks).enumerate().for_each_init(Samples::default, |samples, (i, peaks)| {
                grid.gather(*size, at(*size, start * size.width + i), samples);
                fit_texel(samples, peaks);
            });
            done += rows.len() * size.width;
            let sums = sums.as_flattened();
            emit(&FittedRows { level, size: *size, rows, statistics: 4, sums, attributes: &[] })?;
            job.observer.progress(done as f64 / total as f64);
        }
    }
    Ok(())
}

/// Sets `peaks` to those of a texel; the ones not needed get weight 0.
fn fit_texel(samples: &Samples<4>, peaks: &mut [[f32; 4]]) {
    let alive: Vec<usize> = (0..samples.len()).filter(|i| samples.weights()[*i] > 0.0).collect();
    let mean = |s: usize| alive.iter().map(|i| samples.weights()[*i] * samples.planes[s][*i]).sum::<f32>();
    let (x, y, w) = (mean(1), mean(2), mean(3));
    peaks.fill([0.0; 4]);
    if 2.0 * w - w * w - x * x - y * y < ONE_DIRECTION {
        let z = 1.0 - w;
        let length = (x * x + y * y + z * z).sqrt();
        peaks[0] = [1.0, x / length, y / length, SHARPEST];
        return;
    }
    if alive.len() <= peaks.len() {
        for (peak, i) in peaks.iter_mut().zip(alive) {
            let [_, x, y, _] = samples.statistics(i);
            *peak = [samples.weights()[i], x, y, SHARPEST];
        }
        return;
    }
    let mut sums = [[0.0; 4]; MAX_LOBES];
    let sums = &mut sums[..peaks.len()];
    start_from_furthest(samples, samples, sums);
    iterate(Spherical::<false>, samples, PARENT_ROUNDS, sums);
    let mut problem = Peaks::new(samples, &alive);
    let start = sums.iter().map(|s| Spherical::<false>.decode(s)).filter(|s| s.alpha > 1e-3).flat_map(|s| {
        let [x, y, _] = s.mean.map(f64::from);
        [f64::from(s.alpha).ln(), x, y, f64::from(s.variance.recip()).ln()]
    });
    problem.set_params(&DVector::from_iterator(4 * sums.iter().filter(|s| s[0] > 1e-3).count(), start));
    let solver = LevenbergMarquardt::new().with_tol(1e-5).with_patience(2);
    let (solved, _) = solver.minimize(problem);
    let found: Vec<Peak> = solved.peaks().collect();
    let total: f64 = found.iter().map(|p| p.weight).sum();
    for (peak, found) in peaks.iter_mut().zip(found) {
        let exponent = (found.exponent as f32).clamp(1e-2, SHARPEST);
        *peak = [(found.weight / total) as f32, found.x as f32, found.y as f32, exponent];
    }
}

/// A peak in the solver's numbers.
struct Peak {
    weight: f64,
    x: f64,
    y: f64,
    exponent: f64,
}

/// The residuals: model less truth at every direction.
struct Peaks {
    directions: Vec<[f64; 3]>,
    truth: Vec<f64>,
    /// `ln weight, x, y, ln exponent` of each peak.
    parameters: DVector<f64>,
}

impl Peaks {
    fn new(samples: &Samples<4>, alive: &[usize]) -> Self {
        let mut low = [1.0_f32; 2];
        let mut high = [-1.0_f32; 2];
        for i in alive {
            let [_, x, y, _] = samples.statistics(*i);
            for (axis, v) in [x, y].into_iter().enumerate() {
                low[axis] = low[axis].min(v - MARGIN);
                high[axis] = high[axis].max(v + MARGIN);
            }
        }
        let place = |k: usize, axis: usize| {
            f64::from(low[axis]) + (k as f64 + 0.5) / SIDE as f64 * f64::from(high[axis] - low[axis])
        };
        let grid = (0..SIDE * SIDE).map(|i| (place(i % SIDE, 0), place(i / SIDE, 1)));
        let inside = grid.filter(|(x, y)| x * x + y * y < 0.94);
        let directions: Vec<[f64; 3]> = inside.map(|(x, y)| [x, y, (1.0 - x * x - y * y).sqrt()]).collect();
        let truth = directions.iter().map(|w| {
            let seen = |i: &usize| {
                let [_, x, y, from_pole] = samples.statistics(*i);
                let n = [x, y, 1.0 - from_pole].map(f64::from);
                let length = n.iter().map(|c| c * c).sum::<f64>().sqrt();
                let u = (0..3).map(|k| w[k] * n[k]).sum::<f64>() / length;
                f64::from(samples.weights()[*i]) * u.max(0.0).powi(PROBE_EXPONENT as i32)
            };
            (PROBE_EXPONENT + 1.0) / std::f64::consts::TAU * alive.iter().map(seen).sum::<f64>()
        });
        Self { truth: truth.collect(), directions, parameters: DVector::zeros(0) }
    }

    fn peaks(&self) -> impl Iterator<Item = Peak> {
        self.parameters.as_slice().as_chunks::<4>().0.iter().map(|[weight, x, y, exponent]| {
            // Held to the disk, where a step may leave it.
            let far = x.hypot(*y).max(1e-12);
            let held = far.min(0.999) / far;
            let (weight, exponent) = (weight.min(10.0).exp(), exponent.clamp(-4.0, 12.0).exp());
            Peak { weight, x: x * held, y: y * held, exponent }
        })
    }

    /// Value of a peak at a direction, and its derivatives by `ln weight, x, y, ln exponent`.
    fn value(peak: &Peak, w: &[f64; 3]) -> [f64; 4] {
        let z = (1.0 - peak.x * peak.x - peak.y * peak.y).sqrt();
        let u = w[0] * peak.x + w[1] * peak.y + w[2] * z;
        if u <= 1e-6 {
            return [0.0; 4];
        }
        let share = PROBE_EXPONENT / (peak.exponent + PROBE_EXPONENT);
        let s = peak.exponent * share;
        let f = peak.weight * (s + 1.0) / std::f64::consts::TAU * u.powf(s);
        let by_u = f * s / u;
        [
            f,
            by_u * (w[0] - w[2] * peak.x / z),
            by_u * (w[1] - w[2] * peak.y / z),
            f * (1.0 / (s + 1.0) + u.ln()) * share * s,
        ]
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Peaks {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, parameters: &DVector<f64>) {
        self.parameters.clone_from(parameters);
    }

    fn params(&self) -> DVector<f64> {
        self.parameters.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let peaks: Vec<Peak> = self.peaks().collect();
        let shading = |w: &[f64; 3]| peaks.iter().map(|p| Self::value(p, w)[0]).sum::<f64>();
        let residuals = self.directions.iter().zip(&self.truth).map(|(w, truth)| shading(w) - truth);
        Some(DVector::from_iterator(self.truth.len(), residuals))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let mut jacobian = DMatrix::zeros(self.truth.len(), self.parameters.len());
        for (j, peak) in self.peaks().enumerate() {
            for (i, w) in self.directions.iter().enumerate() {
                for (k, d) in Self::value(&peak, w).into_iter().enumerate() {
                    jacobian[(i, 4 * j + k)] = d;
                }
            }
        }
        Some(jacobian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::family::Family;
    use levenberg_marquardt::differentiate_numerically;

    fn two_groups() -> Samples<4> {
        let mut samples = Samples::default();
        for i in 0..32 {
            let t = i as f32 * 0.7;
            let centre = if i % 2 == 0 { 0.4 } else { -0.3 };
            let n = glam::Vec3::new(centre + 0.05 * t.sin(), 0.05 * t.cos(), 1.0).normalize();
            samples.push(1.0 / 32.0, Spherical::<false>.statistics(n));
        }
        samples.pad();
        samples
    }

    #[test]
    fn derivatives_are_those_of_the_residuals() {
        let samples = two_groups();
        let mut problem = Peaks::new(&samples, &(0..32).collect::<Vec<_>>());
        problem.set_params(&DVector::from_vec(vec![-0.5, 0.3, 0.05, 4.0, -1.0, -0.2, 0.1, 3.0]));
        let numeric = differentiate_numerically(&mut problem).unwrap();
        let exact = problem.jacobian().unwrap();
        let worst = (&exact - &numeric).abs().max() / exact.abs().max();
        // Central differences in double precision.
        assert!(worst < 1e-6, "{worst}");
    }

    #[test]
    fn peaks_stand_where_the_normals_are() {
        let mut peaks = [[0.0; 4]; 2];
        fit_texel(&two_groups(), &mut peaks);
        peaks.sort_by(|a, b| a[1].total_cmp(&b[1]));
        // The groups' own middles, (-0.3, 0, 1) and (0.4, 0, 1) normalised; a ring of 0.05 moves them little.
        assert!((peaks[0][1] + 0.287).abs() < 0.01 && (peaks[1][1] - 0.371).abs() < 0.01, "{peaks:?}");
        assert!(
            (peaks[0][0] - 0.5).abs() < 0.05 && (peaks[0][0] + peaks[1][0] - 1.0).abs() < 1e-6,
            "{peaks:?}"
        );
    }
}
