//! Factoring a table of measurements: `M(theta_h, theta_d) ~ kd + f(theta_h) g(theta_d)` channel by channel,
//! then f into kernels and g into a polynomial over a cosine.
//!
//! Both steps are least squares, none of the factors negative, in the measure that [`Residual`] prints: by
//! solid angle, and by both cosines, which is what a pair of directions exchanges. Channels share nothing: of
//! chrome one f for all leaves 12 %, and three leave 2 %.

use glam::DVec3;

use super::kernels::{self, KERNELS};
use super::table::{BINS, Cell, MeasuredTable, difference_angle, half_angle};
use super::{ChannelFactors, LobeFactors, TINT, tint_at, tint_basis};

/// Error that a fit leaves of a table: the root of its sum of squares over that of the table itself. Each
/// square counts by solid angle, and times both cosines: by what is exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Error of `kd + f g`, as tabulated.
    pub factored: f64,
    /// Error of the lobe in the end: kernels and polynomial.
    pub fitted: f64,
}

/// Factors a material.
pub(super) fn factor(table: &MeasuredTable) -> LobeFactors {
    let cells = table.cells();
    let (mut all, mut factored, mut fitted) = (0.0, 0.0, 0.0);
    let mut diffuse = DVec3::ZERO;
    let channels = std::array::from_fn(|c| {
        let channel = Channel::new(&cells, c);
        let tabulated = channel.factored();
        let Fitted { diffuse: own, factors } = channel.fitted(&tabulated);
        diffuse[c] = own * std::f64::consts::PI;
        let f: Vec<f64> = (0..BINS).map(|h| factors.value(half_angle(h as f64 + 0.5).cos())).collect();
        let g: Vec<f64> =
            (0..BINS).map(|d| tint_at(&factors.tint, difference_angle(d as f64 + 0.5).cos())).collect();
        for (i, cell) in cells.iter().enumerate() {
            let (h, d) = (i / BINS, i % BINS);
            let left = |value: f64| cell.weight * (cell.mean[c] - value).powi(2) + cell.scatter[c];
            all += cell.weight * cell.mean[c].powi(2) + cell.scatter[c];
            factored += left(tabulated.diffuse + tabulated.f[h] * tabulated.g[d]);
            fitted += left(own + f[h] * g[d]);
        }
        factors
    });
    let relative = |left: f64| if all > 0.0 { (left / all).sqrt() } else { 0.0 };
    let residual = Residual { factored: relative(factored), fitted: relative(fitted) };
    LobeFactors { diffuse, channels, residual }
}

/// Means of one channel of a table, and what each counts.
struct Channel {
    mean: Vec<f64>,
    weight: Vec<f64>,
}

/// Factors as tables.
struct Tabulated {
    diffuse: f64,
    f: Vec<f64>,
    g: Vec<f64>,
}

/// Factors of the lobe in the end.
struct Fitted {
    diffuse: f64,
    factors: ChannelFactors,
}

/// Most rounds of the alternating fit, and the part of the error by which a round must lower it to be
/// followed by another.
const ROUNDS: usize = 1000;
const GAIN: f64 = 1e-6;

/// Rounds in which the constant is held.
const HELD: usize = 10;

impl Channel {
    fn new(cells: &[Cell], channel: usize) -> Self {
        Self {
            mean: cells.iter().map(|c| c.mean[channel]).collect(),
            weight: cells.iter().map(|c| c.weight).collect(),
        }
    }

    /// Least squares of the tables, by turns.
    ///
    /// At first the constant is held: beside a g that is constant too, least squares do not tell it from f.
    /// Then it is freed together with each factor, which is fast; but entries that would be negative are held
    /// at zero, and where there are some only turns of all three come to rest.
    fn factored(&self) -> Tabulated {
        let mut fit = Tabulated { diffuse: self.dim(), f: vec![0.0; BINS], g: vec![1.0; BINS] };
        let turn = |fit: &mut Tabulated, held: bool| {
            let constant = |fit: &Tabulated| held.then_some(fit.diffuse);
            (fit.diffuse, fit.f) = self.factor_given(&fit.g, constant(fit), |h, d| h * BINS + d);
            (fit.diffuse, fit.g) = self.factor_given(&fit.f, constant(fit), |d, h| h * BINS + d);
        };
        (0..HELD).for_each(|_| turn(&mut fit, true));
        self.settle(&mut fit, |fit| turn(fit, false));
        self.settle(&mut fit, |fit| {
            turn(fit, true);
            fit.diffuse = self.constant_given(&fit.f, &fit.g);
        });
        fit
    }

    /// Mean of a function of `theta_d` over the table.
    fn mean_of(&self, g: &[f64]) -> f64 {
        let sum: f64 = self.weight.iter().zip(g.iter().cycle()).map(|(weight, g)| weight * g).sum();
        sum / self.weight.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Turns until they gain no more.
    fn settle(&self, fit: &mut Tabulated, turn: impl Fn(&mut Tabulated)) {
        let mut before = self.left(fit.diffuse, &fit.f, &fit.g);
        for _ in 0..ROUNDS {
            turn(fit);
            let left = self.left(fit.diffuse, &fit.f, &fit.g);
            if left >= before * (1.0 - GAIN) {
                break;
            }
            before = left;
        }
    }

    /// The best constant beside two factors.
    fn constant_given(&self, f: &[f64], g: &[f64]) -> f64 {
        let of = |i: usize| self.weight[i] * (self.mean[i] - f[i / BINS] * g[i % BINS]);
        let all: f64 = self.weight.iter().sum();
        if all > 0.0 { ((0..BINS * BINS).map(of).sum::<f64>() / all).max(0.0) } else { 0.0 }
    }

    /// The best factor beside a `known` one, and the best constant with both, unless it is `held`. `at(i, k)`
    /// is the cell of entry i of the one that is sought and entry k of the known one.
    ///
    /// The best entry is linear in the constant, `(S_i - kd G_i)/Q_i`; put in, least squares have one unknown
    /// left.
    fn factor_given(
        &self,
        known: &[f64],
        held: Option<f64>,
        at: impl Fn(usize, usize) -> usize,
    ) -> (f64, Vec<f64>) {
        let sums: Vec<[f64; 3]> = (0..BINS)
            .map(|i| {
                known.iter().enumerate().fold([0.0; 3], |[s, g, q], (k, value)| {
                    let (mean, weight) = (self.mean[at(i, k)], self.weight[at(i, k)]);
                    [s + weight * mean * value, g + weight * value, q + weight * value * value]
                })
            })
            .collect();
        let (mut right, mut square) = (0.0, 0.0);
        for (i, [s, g, q]) in sums.iter().enumerate() {
            for (k, value) in known.iter().enumerate() {
                let (mean, weight) = (self.mean[at(i, k)], self.weight[at(i, k)]);
                let share = if *q > 0.0 { value / q } else { 0.0 };
                let (a, b) = (mean - share * s, 1.0 - share * g);
                right += weight * a * b;
                square += weight * b * b;
            }
        }
        let free = if square > 0.0 { (right / square).max(0.0) } else { 0.0 };
        let diffuse = held.unwrap_or(free);
        let entry = |[s, g, q]: &[f64; 3]| if *q > 0.0 { ((s - diffuse * g) / q).max(0.0) } else { 0.0 };
        (diffuse, sums.iter().map(entry).collect())
    }

    /// Sum of squares that is left of the means.
    fn left(&self, diffuse: f64, f: &[f64], g: &[f64]) -> f64 {
        let of = |i: usize| self.weight[i] * (self.mean[i] - diffuse - f[i / BINS] * g[i % BINS]).powi(2);
        (0..BINS * BINS).map(of).sum()
    }

    /// Least squares of kernels and polynomial, by turns, from the tables. Where a highlight lowers the error
    /// by nothing, there is none.
    fn fitted(&self, tabulated: &Tabulated) -> Fitted {
        let column = |k: usize| -> Vec<f64> {
            let at = |h: usize| kernels::kernel(kernels::variance(k), half_angle(h as f64 + 0.5).cos());
            (0..BINS).map(at).collect()
        };
        let columns: Vec<Vec<f64>> = (0..KERNELS).map(column).collect();
        let cosines: Vec<f64> = (0..BINS).map(|d| difference_angle(d as f64 + 0.5).cos()).collect();
        let (mut diffuse, mut g) = (tabulated.diffuse, tabulated.g.clone());
        let mut best = (f64::INFINITY, Fitted { diffuse, factors: ChannelFactors::default() });
        for _ in 0..TURNS {
            let weights = self.kernel_weights(&columns, diffuse, &g);
            let f: Vec<f64> =
                (0..BINS).map(|h| weights.iter().zip(&columns).map(|(w, c)| w * c[h]).sum()).collect();
            let tint;
            (diffuse, tint) = self.tint_given(&f, &cosines);
            g = cosines.iter().map(|u| tint_at(&tint, *u)).collect();
            let left = self.left(diffuse, &f, &g);
            let enough = left >= best.0 * (1.0 - GAIN);
            if left < best.0 {
                // g is scaled to a mean of one, so that f is the lobe.
                let mean = self.mean_of(&g).max(f64::MIN_POSITIVE);
                let factors = ChannelFactors::new(
                    &weights.iter().map(|w| w * mean).collect::<Vec<_>>(),
                    tint.map(|c| c / mean),
                );
                best = (left, Fitted { diffuse, factors });
            }
            if enough {
                break;
            }
        }
        let flat = self.constant_given(&[0.0; BINS], &[0.0; BINS]);
        if self.left(flat, &[0.0; BINS], &[0.0; BINS]) <= best.0 * (1.0 + GAIN) {
            return Fitted { diffuse: flat, factors: ChannelFactors::default() };
        }
        best.1
    }

    /// Weights of the kernels beside a known g.
    fn kernel_weights(&self, columns: &[Vec<f64>], diffuse: f64, g: &[f64]) -> Vec<f64> {
        let (mut scale, mut right) = (vec![0.0; BINS], vec![0.0; BINS]);
        for h in 0..BINS {
            for (d, g) in g.iter().enumerate() {
                let weight = self.weight[h * BINS + d];
                scale[h] += weight * g * g;
                right[h] += weight * g * (self.mean[h * BINS + d] - diffuse);
            }
        }
        kernels::nonnegative_least_squares(columns, &scale, &right)
    }

    /// g and the constant, beside a known f.
    fn tint_given(&self, f: &[f64], cosines: &[f64]) -> (f64, [f64; TINT]) {
        let mut columns = vec![vec![1.0; BINS * BINS]; TINT + 1];
        for (d, u) in cosines.iter().enumerate() {
            for (column, b) in columns.iter_mut().zip(tint_basis(*u)) {
                f.iter().enumerate().for_each(|(h, f)| column[h * BINS + d] = f * b);
            }
        }
        let right: Vec<f64> =
            self.mean.iter().zip(&self.weight).map(|(mean, weight)| mean * weight).collect();
        let weights = kernels::nonnegative_least_squares(&columns, &self.weight, &right);
        (weights[TINT], std::array::from_fn(|i| weights[i]))
    }

    /// Reflectance away from the highlight: a tenth of the table, by weight, is darker.
    fn dim(&self) -> f64 {
        let tenth = 0.1 * self.weight.iter().sum::<f64>();
        let mut all: Vec<(f64, f64)> =
            self.mean.iter().copied().zip(self.weight.iter().copied()).filter(|(_, w)| *w > 0.0).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut sum = 0.0;
        let darker = all.iter().find(|(_, weight)| {
            sum += weight;
            sum >= tenth
        });
        darker.map_or(0.0, |(value, _)| *value)
    }
}

/// Most turns between kernels and polynomial.
const TURNS: usize = 40;
