//! Refinement: moves a level's lobes towards the least squared error of the *effective lobe*, at texels and
//! between.
//!
//! Likelihood is not what a viewer sees. For a BRDF lobe of variance `v0`, the squared error of a mixture
//! against the normals themselves, both convolved with it, is
//!
//! `E = Σ_ij alpha_i alpha_j k(v_i + v_j + 2 v0, mu_i, mu_j) - 2 Σ_i alpha_i mean_n k(v_i + 2 v0, mu_i, n) +
//! constant`, `k(V, a, b) = exp(-gap(a, b)/V)/(2 pi V)`, gap half the squared distance: Gaussians, whose
//! products integrate in closed form (on the sphere, to first order in V).
//!
//! A filter between texels shows the mean of four texels' sums, against the normals of all four. So `E` is
//! taken of each texel and of every 2 × 2 *window* of neighbours, whose sums are that mean: lobes that do not
//! belong together make a bad window, and move. No texel waits for another: a round takes the windows of one
//! of four offsets, which cover every texel once, so windows are independent and the result does not depend
//! on the number of threads.
//!
//! Descent is by `(ln alpha, mu, v)` with momentum, each step divided by a bound on the curvature: that of
//! the lobe alone, times how crowded its place is. This objective is ours, not the papers' (`docs/methods.md`
//! has what it gains).
//!
//! Diffuse light asks for little but the mean normal, which EM keeps: a texel's sums together are the means
//! of its normals' statistics. So the mean is *kept*: each step is brought back to it, by the least increase
//! of `E`. Without that the lobes of a foil are ten times worse under Lambert, and in the median of ten maps
//! highlights gain nothing by it.

use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

use super::assign::{LANES, MAX_LOBES, exp};
use super::family::{DEAD, Isotropic, Shape, ShapeSlope, gap};
use super::samples::{SampleGrid, Samples};
use crate::grid::Size;

/// Variance `v0` of the BRDF lobe that errors are seen through: Blinn-Phong of exponent 140, the geometric
/// mean of the two that the benchmark `lobes` measures with. Less favours sharp lobes and costs wide ones,
/// more the other way round.
const LOBE_VARIANCE: f32 = 0.007;

/// Weight of windows, against 1 - this for texels.
const WINDOW_WEIGHT: f32 = 0.2;

/// Step taken, in units of one that a bound on the curvature makes safe (the bound is loose), and the share
/// of the last step that is taken again.
const STEP: f32 = 1.4;
const MOMENTUM: f32 = 0.5;

/// No step moves a lobe by more than this part of its own width.
const LONGEST: f32 = 0.3;

/// Newton's steps that bring the last lobes back to the sums that are kept.
const LAST_STEPS: usize = 3;

/// A lobe and its last step, by `(ln alpha, mu, v)`.
#[derive(Clone, Copy)]
struct Moving {
    shape: Shape,
    step: [f32; 5],
}

/// Refines the sums of a level for a number of rounds (whole turns of the four offsets are best).
pub(crate) fn refine(
    family: impl Isotropic,
    grid: &SampleGrid<4>,
    level: &mut LevelLobes<'_, 4>,
    rounds: usize,
) {
    let (lobes, width) = (level.lobes, level.size.width);
    let moving = |sums: &[f32; 4]| Moving { shape: family.decode(sums), step: [0.0; 5] };
    let mut all: Vec<Moving> = level.sums.par_iter().map(moving).collect();
    let kept: Vec<[f32; 4]> = level.sums.chunks(lobes).map(total).collect();
    for round in 0..rounds {
        // The last turns settle.
        let stride = if 3 * round >= 2 * rounds { 0.5 * STEP } else { STEP };
        let columns = pairs(width, round & 1);
        let rows = pairs(level.size.height, round >> 1 & 1);
        // Rows of windows share no texel, so each is a task of its own.
        let mut lines: Vec<Option<&mut [Moving]>> = all.chunks_mut(width * lobes).map(Some).collect();
        let mut take = |rows: &Vec<usize>| rows.iter().filter_map(|y| lines[*y].take()).collect::<Vec<_>>();
        let tasks: Vec<(&Vec<usize>, Vec<&mut [Moving]>)> =
            rows.iter().map(|rows| (rows, take(rows))).collect();
        tasks.into_par_iter().for_each_init(Samples::<4>::default, |samples, (rows, mut lines)| {
            for columns in &columns {
                let window =
                    Window { family, grid, size: level.size, lobes, stride, columns, rows, kept: &kept };
                window.step(&mut lines, samples);
            }
        });
    }
    let settled = level.sums.par_chunks_mut(lobes).zip(all.par_chunks_mut(lobes)).zip(&kept);
    settled.for_each(|((sums, moving), kept)| settle(family, moving, kept, sums));
}

/// The sums of a level while they are being made: `lobes` after `lobes`, texel after texel.
pub(crate) struct LevelLobes<'a, const N: usize> {
    pub(crate) size: Size,
    pub(crate) lobes: usize,
    pub(crate) sums: &'a mut [[f32; N]],
}

/// `0..n` in twos, beginning at `offset`; pairs go across the edge where that leaves none alone, else the odd
/// ones stay alone.
fn pairs(n: usize, offset: usize) -> Vec<Vec<usize>> {
    if n == 1 {
        return vec![vec![0]];
    }
    if n.is_multiple_of(2) {
        return (0..n / 2).map(|i| vec![(2 * i + offset) % n, (2 * i + 1 + offset) % n]).collect();
    }
    let first: Vec<Vec<usize>> = (0..offset).map(|i| vec![i]).collect();
    let rest = (offset..n).step_by(2).map(|i| (i..(i + 2).min(n)).collect());
    first.into_iter().chain(rest).collect()
}

struct Window<'a, F> {
    family: F,
    grid: &'a SampleGrid<4>,
    size: Size,
    lobes: usize,
    stride: f32,
    columns: &'a [usize],
    rows: &'a [usize],
    /// Sums of all lobes together, of every texel of the level.
    kept: &'a [[f32; 4]],
}

impl<F: Isotropic> Window<'_, F> {
    /// Moves the texels of this window, whose rows are `lines`, by one step.
    fn step(&self, lines: &mut [&mut [Moving]], samples: &mut Samples<4>) {
        let (family, lobes) = (self.family, self.lobes);
        let members = self.columns.len() * self.rows.len();
        let share = 1.0 / members as f32;
        let places = || (0..self.rows.len()).flat_map(|r| self.columns.iter().map(move |x| (r, *x)));
        let mut sums = [[0.0_f32; 4]; MAX_LOBES];
        for (r, x) in places() {
            for (sum, moving) in sums.iter_mut().zip(&lines[r][x * lobes..][..lobes]) {
                let own = family.encode(&moving.shape);
                (0..4).for_each(|k| sum[k] += share * own[k]);
            }
        }
        let window = sums.map(|sums| family.decode(&sums));
        let window = &window[..lobes];
        let mut seen = [[0.0_f32; 4]; MAX_LOBES];
        let mut slopes = [[[0.0_f32; 4]; MAX_LOBES]; 4];
        for ((r, x), slopes) in places().zip(&mut slopes) {
            self.grid.gather(self.size, (x, self.rows[r]), samples);
            let mut shapes = [Shape::default(); MAX_LOBES];
            for (shape, moving) in shapes.iter_mut().zip(&lines[r][x * lobes..][..lobes]) {
                *shape = moving.shape;
            }
            let mut own = [[0.0_f32; 4]; MAX_LOBES];
            look(family, &shapes[..lobes], samples, &mut own[..lobes]);
            slope(family, &shapes[..lobes], &own[..lobes], &mut slopes[..lobes]);
            if members > 1 {
                look(family, window, samples, &mut seen[..lobes]);
            }
        }
        let mut shared = [[0.0_f32; 4]; MAX_LOBES];
        let of_window = if members > 1 { WINDOW_WEIGHT } else { 0.0 };
        seen.iter_mut().flatten().for_each(|s| *s *= share);
        slope(family, window, &seen[..lobes], &mut shared[..lobes]);
        for ((r, x), slopes) in places().zip(&mut slopes) {
            for (own, shared) in slopes.iter_mut().zip(&shared) {
                (0..4).for_each(|k| own[k] = (1.0 - of_window) * own[k] + of_window * shared[k]);
            }
            let moving = &mut lines[r][x * lobes..][..lobes];
            let kept = &self.kept[self.rows[r] * self.size.width + x];
            move_lobes(family, moving, &slopes[..lobes], self.stride, kept);
        }
    }
}

/// Sums of a texel's lobes as they are stored; what Newton's steps leave is shared out by weight.
fn settle<F: Isotropic>(family: F, lobes: &mut [Moving], kept: &[f32; 4], sums: &mut [[f32; 4]]) {
    let crowded = crowdings(lobes);
    (0..LAST_STEPS).for_each(|_| keep(family, lobes, &crowded, kept));
    for (sums, lobe) in sums.iter_mut().zip(lobes.iter()) {
        *sums = family.settle(&lobe.shape);
    }
    let made = total(sums);
    for sums in sums.iter_mut() {
        let share = sums[0] / made[0];
        (0..F::OF_MEAN).for_each(|k| sums[k] += share * (kept[k] - made[k]));
    }
}

/// Sums of all lobes of a texel together: the mean of the statistics of its normals.
fn total(sums: &[[f32; 4]]) -> [f32; 4] {
    let mut out = [0.0; 4];
    for sums in sums {
        (0..4).for_each(|k| out[k] += sums[k]);
    }
    out
}

/// Compliance of a lobe: the inverse of half the curvature of `E` by each of `(ln alpha, mu, v)`. The
/// curvature is that of the lobe by itself, `alpha²/(4 pi v)` by `ln alpha`, over `2v` by mu, over `2v²` by
/// v, times how crowded its place is.
fn compliance(shape: &Shape, crowded: f32) -> [f32; 5] {
    let v = shape.variance + LOBE_VARIANCE;
    let curvature = crowded * shape.alpha * shape.alpha / (2.0 * std::f32::consts::TAU * v);
    let by_mean = 2.0 * v / curvature;
    [curvature.recip(), by_mean, by_mean, by_mean, v * by_mean]
}

/// Moves the lobes of a texel so that their mean normal is the one that is kept, by the least increase of `E`
/// in the measure of its curvature: Newton's step for the constraint, `H⁻¹ Jᵀ (J H⁻¹ Jᵀ)⁻¹`.
fn keep<F: Isotropic>(family: F, lobes: &mut [Moving], crowded: &[f32; MAX_LOBES], kept: &[f32; 4]) {
    let mut rows = [[[0.0_f32; 5]; 4]; MAX_LOBES];
    let mut matrix = [[0.0_f64; 4]; 4];
    let mut off = kept.map(f64::from);
    for ((lobe, rows), crowded) in lobes.iter().zip(&mut rows).zip(crowded) {
        if lobe.shape.alpha <= DEAD {
            continue;
        }
        let sums = family.encode(&lobe.shape);
        let soft = compliance(&lobe.shape, *crowded);
        for (k, row) in rows.iter_mut().enumerate() {
            off[k] -= f64::from(sums[k]);
            let mut unit = [0.0; 4];
            unit[k] = 1.0;
            let ShapeSlope { alpha, mean, variance } = family.slope_of_shape(&lobe.shape, &unit);
            *row = [alpha, mean[0], mean[1], mean[2], variance];
        }
        for k in 0..4 {
            for l in 0..4 {
                matrix[k][l] += (0..5)
                    .map(|p| f64::from(rows[k][p]) * f64::from(soft[p]) * f64::from(rows[l][p]))
                    .sum::<f64>();
            }
        }
    }
    // Other statistics are free.
    for k in F::OF_MEAN..4 {
        matrix[k] = std::array::from_fn(|l| f64::from(u8::from(k == l)));
        (0..4).for_each(|l| matrix[l][k] = matrix[k][l]);
        off[k] = 0.0;
    }
    let pull = glam::DMat4::from_cols_array_2d(&matrix).inverse() * glam::DVec4::from(off);
    if !pull.is_finite() {
        return;
    }
    let pull = pull.to_array();
    for ((lobe, rows), crowded) in lobes.iter_mut().zip(&rows).zip(crowded) {
        if lobe.shape.alpha <= DEAD {
            continue;
        }
        let soft = compliance(&lobe.shape, *crowded);
        let by: [f32; 5] = std::array::from_fn(|p| {
            soft[p] * (0..4).map(|k| f64::from(rows[k][p]) * pull[k]).sum::<f64>() as f32
        });
        lobe.shape = moved(family, &lobe.shape, &by);
        (0..5).for_each(|k| lobe.step[k] += by[k]);
    }
}

/// Shape after a step by `(ln alpha, mu, v)`, held to a part of its own width.
fn moved(family: impl Isotropic, shape: &Shape, step: &[f32; 5]) -> Shape {
    let v = shape.variance + LOBE_VARIANCE;
    let length = (step[1] * step[1] + step[2] * step[2] + step[3] * step[3]).sqrt();
    let longest = LONGEST * v.sqrt();
    let held = if length > longest { longest / length } else { 1.0 };
    let mean = [0, 1, 2].map(|c| shape.mean[c] + held * step[c + 1]);
    let variance = shape.variance + step[4].clamp(-LONGEST * v, LONGEST * v);
    let alpha = shape.alpha * step[0].clamp(-LONGEST, LONGEST).exp();
    family.shape(alpha, mean, variance)
}

/// Adds to `seen`, for each lobe, the samples' `Σ w k (1, T)`, k between the lobe and the sample.
fn look(family: impl Isotropic, shapes: &[Shape], samples: &Samples<4>, seen: &mut [[f32; 4]]) {
    let mut theta = [[0.0; 4]; MAX_LOBES];
    for (theta, shape) in theta.iter_mut().zip(shapes) {
        let variance = shape.variance + 2.0 * LOBE_VARIANCE;
        *theta = family.unit_natural(&shape.mean, variance);
    }
    match shapes.len() {
        1 => look_fixed::<1>(&theta, samples, seen),
        2 => look_fixed::<2>(&theta, samples, seen),
        3 => look_fixed::<3>(&theta, samples, seen),
        4 => look_fixed::<4>(&theta, samples, seen),
        5 => look_fixed::<5>(&theta, samples, seen),
        6 => look_fixed::<6>(&theta, samples, seen),
        7 => look_fixed::<7>(&theta, samples, seen),
        _ => look_fixed::<MAX_LOBES>(&theta, samples, seen),
    }
}

fn look_fixed<const J: usize>(theta: &[[f32; 4]; MAX_LOBES], samples: &Samples<4>, seen: &mut [[f32; 4]]) {
    let theta: &[[f32; 4]; J] = theta.first_chunk().expect("J is at most MAX_LOBES");
    let sums = dispatch!(Level::new(), _simd => look_lanes::<J>(theta, samples));
    for (seen, sums) in seen.iter_mut().flatten().zip(sums.iter().flatten()) {
        *seen += sums;
    }
}

#[inline(always)]
fn look_lanes<const J: usize>(theta: &[[f32; 4]; J], samples: &Samples<4>) -> [[f32; 4]; J] {
    let mut sums = [[[0.0_f32; LANES]; 4]; J];
    let [w, a, b, c] = samples.planes.each_ref().map(|plane| plane.as_chunks::<LANES>().0);
    for (((a, b), c), w) in a.iter().zip(b).zip(c).zip(w) {
        for j in 0..J {
            let [t0, t1, t2, t3] = theta[j];
            for k in 0..LANES {
                let z = w[k] * exp(t0 + t1 * a[k] + t2 * b[k] + t3 * c[k]);
                sums[j][0][k] += z;
                sums[j][1][k] += z * a[k];
                sums[j][2][k] += z * b[k];
                sums[j][3][k] += z * c[k];
            }
        }
    }
    sums.map(|four| four.map(|lanes| lanes.iter().sum()))
}

/// Half the derivative of `E` by each lobe's sums; `seen` as [`look`] makes it.
fn slope(family: impl Isotropic, shapes: &[Shape], seen: &[[f32; 4]], out: &mut [[f32; 4]]) {
    for ((shape, seen), out) in shapes.iter().zip(seen).zip(out) {
        if shape.alpha <= DEAD {
            continue;
        }
        let v = shape.variance + 2.0 * LOBE_VARIANCE;
        let spread = family.spread(seen, &shape.mean);
        let mut s = ShapeSlope {
            alpha: -seen[0],
            mean: family.first_moment(seen).map(|m| -m / v),
            variance: seen[0] / v - spread / (v * v),
        };
        // On the sphere the part along the mean drops out later; in the plane n - mu is what pulls.
        let mut held = -seen[0] / v;
        for other in shapes.iter().filter(|o| o.alpha > DEAD) {
            let v = shape.variance + other.variance + 2.0 * LOBE_VARIANCE;
            let gap = gap(shape, other);
            let k = other.alpha * (-gap / v).exp() / (std::f32::consts::TAU * v);
            s.alpha += k;
            (0..3).for_each(|c| s.mean[c] += k * other.mean[c] / v);
            held += k / v;
            s.variance += k * (gap / v - 1.0) / v;
        }
        (0..3).for_each(|c| s.mean[c] = shape.alpha * (s.mean[c] - held * shape.mean[c]));
        s.variance *= shape.alpha;
        *out = family.slope_of_sums(shape, &s);
    }
}

/// Curvature of the squared error at a lobe, from all lobes over from itself alone: at least 1.
fn crowding(lobes: &[Moving], shape: &Shape) -> f32 {
    let near = |other: &Moving| {
        let v = shape.variance + other.shape.variance + 2.0 * LOBE_VARIANCE;
        other.shape.alpha * (-gap(shape, &other.shape) / v).exp() / v
    };
    let own = shape.alpha / (2.0 * (shape.variance + LOBE_VARIANCE));
    lobes.iter().map(near).sum::<f32>() / own
}

/// [`crowding`] of all lobes of a texel; 1 for dead ones.
fn crowdings(lobes: &[Moving]) -> [f32; MAX_LOBES] {
    let mut crowded = [1.0; MAX_LOBES];
    for (crowded, lobe) in crowded.iter_mut().zip(lobes.iter()).filter(|(_, l)| l.shape.alpha > DEAD) {
        *crowded = crowding(lobes, &lobe.shape);
    }
    crowded
}

/// Takes one step down `slopes` (by sums) for every lobe of a texel, whose mean normal stays as it is.
fn move_lobes(
    family: impl Isotropic,
    lobes: &mut [Moving],
    slopes: &[[f32; 4]],
    stride: f32,
    kept: &[f32; 4],
) {
    let crowded = crowdings(lobes);
    for ((Moving { shape, step }, slope), crowded) in lobes.iter_mut().zip(slopes).zip(crowded) {
        if shape.alpha <= DEAD {
            shape.alpha = 0.0;
            continue;
        }
        let s = family.slope_of_shape(shape, slope);
        let [x, y, z] = s.mean;
        let soft = compliance(shape, crowded);
        for (k, slope) in [s.alpha, x, y, z, s.variance].into_iter().enumerate() {
            step[k] = MOMENTUM * step[k] - stride * soft[k] * slope;
        }
        *shape = moved(family, shape, step);
    }
    keep(family, lobes, &crowded, kept);
    let total: f32 = lobes.iter().map(|lobe| lobe.shape.alpha).sum();
    lobes.iter_mut().for_each(|lobe| lobe.shape.alpha /= total);
}
