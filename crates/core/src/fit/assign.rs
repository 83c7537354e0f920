//! The E-step and the sums of the M-step in one: each sample is shared out among the lobes, and the shares of
//! every lobe are added up. With the look-ups of `refine.rs`, this is the inner loop of everything that is
//! fitted.

use std::ops::Range;

use fearless_simd::{Level, dispatch};

use super::family::log_density;
use super::samples::Samples;

/// Lobes a texel may have.
pub const MAX_LOBES: usize = 8;

/// Samples handled at a time. Fixed, whatever the processor's width, so that sums have one order.
pub(crate) const LANES: usize = 16;

/// Samples whose sums are kept in single floats before they go into the total.
const RUN: usize = 1024;

/// Sets `sums` to the weighted sums of each lobe, sharing samples out in proportion to `exp(theta · (1, T))`.
pub(crate) fn assign<const N: usize>(theta: &[[f32; N]], samples: &Samples<N>, sums: &mut [[f32; N]]) {
    match theta.len() {
        1 => assign_fixed::<1, N>(theta, samples, sums),
        2 => assign_fixed::<2, N>(theta, samples, sums),
        3 => assign_fixed::<3, N>(theta, samples, sums),
        4 => assign_fixed::<4, N>(theta, samples, sums),
        5 => assign_fixed::<5, N>(theta, samples, sums),
        6 => assign_fixed::<6, N>(theta, samples, sums),
        7 => assign_fixed::<7, N>(theta, samples, sums),
        _ => assign_fixed::<MAX_LOBES, N>(theta, samples, sums),
    }
}

fn assign_fixed<const J: usize, const N: usize>(
    theta: &[[f32; N]],
    samples: &Samples<N>,
    sums: &mut [[f32; N]],
) {
    let theta: &[[f32; N]; J] = theta.first_chunk().expect("as many lobes as were matched");
    let mut total = [[0.0_f64; N]; J];
    for start in (0..samples.len()).step_by(RUN) {
        let range = start..(start + RUN).min(samples.len());
        let part = dispatch!(Level::new(), _simd => assign_run::<J, N>(theta, samples, range));
        for (total, part) in total.iter_mut().flatten().zip(part.iter().flatten()) {
            *total += f64::from(*part);
        }
    }
    for (sums, total) in sums.iter_mut().zip(&total) {
        *sums = total.map(|t| t as f32);
    }
}

/// `exp(x)` for x up to 80, to about 2e-7 relative; below -87 it stays at exp(-87).
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    // Adding and taking away 1.5 · 2^23 rounds to a whole number, whose low bits then are the exponent.
    const MAGIC: f32 = 12_582_912.0;
    let shifted = x.max(-87.0) * std::f32::consts::LOG2_E + MAGIC;
    let f = x.max(-87.0) - (shifted - MAGIC) * std::f32::consts::LN_2;
    // Taylor to degree 6 on |f| ≤ ln 2 / 2: the next term is below 1.2e-7.
    let high = 1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0)));
    let p = 1.0 + f * (1.0 + f * (0.5 + f * high));
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

// Loops over lanes by number, one operation each: the form that becomes SIMD at every level, in the same
// order.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "all planes are walked together, not the first alone")]
fn assign_run<const J: usize, const N: usize>(
    theta: &[[f32; N]; J],
    samples: &Samples<N>,
    range: Range<usize>,
) -> [[f32; N]; J] {
    let mut sums = [[[0.0_f32; LANES]; N]; J];
    let planes: [&[[f32; LANES]]; N] =
        std::array::from_fn(|p| samples.planes[p][range.clone()].as_chunks::<LANES>().0);
    for i in 0..planes[0].len() {
        // The first plane is the weight, whose statistic is one.
        let t: [&[f32; LANES]; N] = std::array::from_fn(|p| &planes[p][i]);
        let mut log = [[0.0_f32; LANES]; J];
        let mut most = [f32::MIN; LANES];
        for j in 0..J {
            log[j] = [theta[j][0]; LANES];
            for s in 1..N {
                for k in 0..LANES {
                    log[j][k] += theta[j][s] * t[s][k];
                }
            }
            for k in 0..LANES {
                most[k] = most[k].max(log[j][k]);
            }
        }
        let mut share = [0.0_f32; LANES];
        for log in &mut log {
            for k in 0..LANES {
                log[k] = exp(log[k] - most[k]);
            }
            for k in 0..LANES {
                share[k] += log[k];
            }
        }
        for k in 0..LANES {
            share[k] = t[0][k] / share[k];
        }
        for (log, sums) in log.iter().zip(&mut sums) {
            for k in 0..LANES {
                let z = log[k] * share[k];
                sums[0][k] += z;
                for s in 1..N {
                    sums[s][k] += z * t[s][k];
                }
            }
        }
    }
    sums.map(|statistics| statistics.map(|lanes| lanes.iter().sum()))
}

/// The shares of one sample, one a lobe, and the logarithm of its density.
pub(crate) fn shares<const N: usize>(theta: &[[f32; N]], t: &[f32; N], shares: &mut [f32]) -> f32 {
    for (share, theta) in shares.iter_mut().zip(theta) {
        *share = log_density(theta, t);
    }
    let most = shares.iter().copied().fold(f32::MIN, f32::max);
    shares.iter_mut().for_each(|s| *s = (*s - most).exp());
    let total: f32 = shares.iter().sum();
    shares.iter_mut().for_each(|s| *s /= total);
    most + total.ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_one() {
        for i in -8700..=4000 {
            let x = i as f32 * 0.01;
            let expected = f64::from(x).exp();
            // 2e-7 from the series, and the argument times log2(e) rounded to 2^-23 of up to 2^23.6 magic
            // steps: 8e-6.
            assert!((f64::from(exp(x)) / expected - 1.0).abs() < 1e-5, "{x}: {} {expected}", exp(x));
        }
        assert!(exp(-1e9) > 0.0 && exp(-1e9) < 2e-38);
    }

    #[test]
    fn samples_are_shared_out_like_one_by_one() {
        let theta = [[0.3, 1.0, -2.0, 0.5], [0.0, -3.0, 1.0, -4.0], [-60.0, 0.0, 0.0, 0.0]];
        let mut samples = Samples::default();
        for i in 0..2500 {
            let x = (i as f32 * 0.37).sin();
            samples.push(1.0 / 2500.0, [1.0, x, 0.5 * x * x - 0.2, (i as f32 * 0.11).cos()]);
        }
        samples.pad();
        let mut sums = [[0.0; 4]; 3];
        assign(&theta, &samples, &mut sums);
        let mut expected = [[0.0_f64; 4]; 3];
        let mut z = [0.0; 3];
        for i in 0..2500 {
            let t = samples.statistics(i);
            shares(&theta, &t, &mut z);
            for j in 0..3 {
                let w = f64::from(samples.weights()[i] * z[j]);
                for (sum, value) in expected[j].iter_mut().zip(t) {
                    *sum += w * f64::from(value);
                }
            }
        }
        for (got, expected) in sums.iter().flatten().zip(expected.iter().flatten()) {
            // 2500 terms of 4e-4 in single floats.
            assert!((f64::from(*got) - expected).abs() < 1e-6, "{got} {expected}");
        }
        assert!((sums.iter().map(|s| s[0]).sum::<f32>() - 1.0).abs() < 1e-6);
    }
}
