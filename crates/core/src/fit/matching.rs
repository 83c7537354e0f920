//! Optimal assignment: which lobe of a texel goes on with which lobe of its parent.
//!
//! With at most eight lobes, dynamic programming over subsets is exact and short: the cheapest way to give
//! the lobes in a subset to the parent's first lobes, one after another.

use super::assign::MAX_LOBES;
use super::family::Family;

/// Reorders a texel's lobes to lie closest to its parent's, by weight times squared distance of means.
pub(crate) fn match_lobes<const N: usize>(
    family: impl Family<N>,
    parent: &[[f32; N]],
    sums: &mut [[f32; N]],
) {
    let n = sums.len();
    let means = |sums: &[[f32; N]]| {
        let mut means = [[0.0; 3]; MAX_LOBES];
        for (mean, sums) in means.iter_mut().zip(sums) {
            *mean = family.mean(sums);
        }
        means
    };
    let (own, parent) = (means(sums), means(parent));
    let weights: [f32; MAX_LOBES] = std::array::from_fn(|i| sums.get(i).map_or(0.0, |s| s[0].max(0.0)));
    let gap =
        |i: usize, place: usize| 0.5 * (0..3).map(|k| (own[i][k] - parent[place][k]).powi(2)).sum::<f32>();
    let cost = |i: usize, place: usize| weights[i] * gap(i, place);
    // best[set] is the least cost of giving the lobes in `set` to the parent's first |set|; last[set] the
    // lobe given last.
    let mut best = [f32::INFINITY; 1 << MAX_LOBES];
    let mut last = [0; 1 << MAX_LOBES];
    best[0] = 0.0;
    for set in 0..1_usize << n {
        let place = set.count_ones() as usize;
        for i in (0..n).filter(|i| set >> i & 1 == 0) {
            let with = set | 1 << i;
            let total = best[set] + cost(i, place);
            if total < best[with] {
                (best[with], last[with]) = (total, i);
            }
        }
    }
    let before: [[f32; N]; MAX_LOBES] = std::array::from_fn(|i| sums.get(i).copied().unwrap_or([0.0; N]));
    let mut set = (1 << n) - 1;
    for place in (0..n).rev() {
        sums[place] = before[last[set]];
        set &= !(1 << last[set]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::family::{Isotropic, Planar};

    #[test]
    fn a_shuffled_texel_is_put_back_in_order() {
        let lobe = |x: f32, y: f32, alpha: f32| Planar.encode(&Planar.shape(alpha, [x, y, 0.0], 0.01));
        let parent = [lobe(0.0, 0.0, 0.4), lobe(0.5, 0.0, 0.3), lobe(0.0, 0.5, 0.2), lobe(-0.5, 0.0, 0.1)];
        let moved = parent.map(|p| [p[0], p[1] + 0.05 * p[0], p[2], p[3]]);
        for order in [[0, 1, 2, 3], [3, 2, 1, 0], [1, 3, 0, 2]] {
            let mut shuffled = order.map(|i| moved[i]);
            match_lobes(Planar, &parent, &mut shuffled);
            assert_eq!(shuffled, moved);
        }
    }
}
