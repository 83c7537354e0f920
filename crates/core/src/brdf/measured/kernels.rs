//! Kernels that f is a sum of: von Mises-Fisher lobes of fixed widths, none of negative weight.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

/// Number of kernels. Their variances go from a fiftieth of a degree to half the hemisphere, each 1.23 times
/// the one before, so that two of them make any other between them to 1 %.
pub(super) const KERNELS: usize = 75;

pub(super) fn variance(k: usize) -> f64 {
    1e-7 * (0.4_f64 / 1e-7).powf(k as f64 / (KERNELS - 1) as f64)
}

/// A von Mises-Fisher kernel of this variance, `1/kappa`, at the cosine `u`; it integrates to one over the
/// sphere.
pub(super) fn kernel(variance: f64, u: f64) -> f64 {
    let kappa = 1.0 / variance;
    kappa / (2.0 * PI * -(-2.0 * kappa).exp_m1()) * (kappa * (u - 1.0)).exp()
}

/// Weights `a ≥ 0` that minimise `Σ_h scale_h (Σ_k a_k column_k(h))² - 2 Σ_h right_h Σ_k a_k column_k(h)`, by
/// the active sets of Lawson and Hanson 1974, chapter 23.
pub(super) fn nonnegative_least_squares(columns: &[Vec<f64>], scale: &[f64], right: &[f64]) -> Vec<f64> {
    let n = columns.len();
    // Columns of length one: kernels are up to 1e7 high.
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).zip(scale).map(|((a, b), s)| a * b * s).sum::<f64>();
    let lengths: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt().max(f64::MIN_POSITIVE)).collect();
    let gram = DMatrix::from_fn(n, n, |i, j| dot(&columns[i], &columns[j]) / (lengths[i] * lengths[j]));
    let along = |k: usize| columns[k].iter().zip(right).map(|(c, r)| c * r).sum::<f64>() / lengths[k];
    let target = DVector::from_fn(n, |k, _| along(k));
    let most = target.iter().fold(0.0_f64, |most, t| most.max(t.abs()));
    let mut weights = DVector::zeros(n);
    let mut free: Vec<usize> = Vec::new();
    // Columns that rounding turned back at once, to be tried again when another has moved.
    let mut turned_back: Vec<usize> = Vec::new();
    for _ in 0..10 * n {
        let slope = &target - &gram * &weights;
        let held = |k: &usize| !free.contains(k) && !turned_back.contains(k);
        let next = (0..n).filter(held).max_by(|a, b| slope[*a].total_cmp(&slope[*b]));
        let Some(next) = next.filter(|k| slope[*k] > 1e-10 * most) else { break };
        free.push(next);
        while let Some(solved) = solve(&gram, &target, &free) {
            // As far towards the solution as no weight turns negative; those that end at zero are held there.
            let reach = |(k, to): (&usize, &f64)| {
                if *to > 0.0 { 1.0 } else { weights[*k] / (weights[*k] - to).max(f64::MIN_POSITIVE) }
            };
            let step = free.iter().zip(solved.iter()).map(reach).fold(1.0_f64, f64::min);
            for (k, to) in free.iter().zip(solved.iter()) {
                weights[*k] += step * (to - weights[*k]);
            }
            if step >= 1.0 {
                break;
            }
            free.retain(|k| weights[*k] > 1e-14);
            (0..n).filter(|k| !free.contains(k)).for_each(|k| weights[k] = 0.0);
        }
        if free.contains(&next) {
            turned_back.clear();
        } else {
            turned_back.push(next);
        }
    }
    (0..n).map(|k| weights[k].max(0.0) / lengths[k]).collect()
}

/// Least squares over the free columns alone.
fn solve(gram: &DMatrix<f64>, target: &DVector<f64>, free: &[usize]) -> Option<DVector<f64>> {
    // A trace on the diagonal, for neighbours are nearly alike.
    let own = |i: usize, j: usize| gram[(free[i], free[j])] * if i == j { 1.0 + 1e-11 } else { 1.0 };
    let matrix = DMatrix::from_fn(free.len(), free.len(), own);
    let right = DVector::from_fn(free.len(), |i, _| target[free[i]]);
    matrix.cholesky().map(|c| c.solve(&right))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_found_again_and_none_is_negative() {
        // Orthogonal columns: each weight is its own quotient, held at zero.
        let columns = [vec![1.0, 0.0, 0.0], vec![0.0, 2.0, 0.0], vec![0.0, 0.0, 3.0]];
        let scale = [1.0, 1.0, 2.0];
        let weights = nonnegative_least_squares(&columns, &scale, &[5.0, -4.0, 6.0]);
        // a_k = column·right / column² scale: 5, -2 (held), 18/18.
        assert!((weights[0] - 5.0).abs() < 1e-9 && weights[1] == 0.0 && (weights[2] - 1.0).abs() < 1e-9);
    }
}
