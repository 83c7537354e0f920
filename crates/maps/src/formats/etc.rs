//! Hints of UASTC for phones that know ETC alone: how a block is to be cut in two halves of one colour each,
//! and how far its texels lie from them. Without them a flat block turns black there.
//!
//! Bits and order are those of the UASTC specification; halves, bases and modifiers are those of ETC1
//! (Khronos Data Format 1.3, section 21).

use super::uastc::TEXELS;

/// Distances of texels from their half's base, by table.
const MODIFIERS: [[i32; 2]; 8] =
    [[2, 8], [5, 17], [9, 29], [13, 42], [18, 60], [24, 80], [33, 106], [47, 183]];

/// Least and largest step from the first half's base to the second's, where one is stored by the other.
const STEPS: std::ops::RangeInclusive<i32> = -4..=3;

/// Bias of halves' bases that changes none: three digits to the base 3, each one more than its change.
const NO_BIAS: u32 = 1 + 3 + 9;

/// A way of cutting a block, and the tables of its halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Halves {
    /// True for an upper and a lower half, false for a left and a right one.
    flip: bool,
    /// True for bases of five bits, the second by its step from the first; false for four bits each.
    differential: bool,
    tables: [u32; 2],
}

impl Halves {
    /// Way whose texels lie nearest.
    pub(super) fn of(texels: &[[u8; 3]; TEXELS]) -> Self {
        let ways = [false, true].into_iter().flat_map(|flip| [false, true].map(|five| (flip, five)));
        let tried = ways.filter_map(|(flip, differential)| {
            let halves = [0, 1].map(|half| half_of(texels, flip, half));
            let bases = halves.map(|half| base(&half, differential));
            let near = (0..3).all(|c| STEPS.contains(&(bases[1][c] - bases[0][c])));
            if differential && !near {
                return None;
            }
            let found = [0, 1].map(|i| table(&halves[i], bases[i].map(|v| widened(v, differential))));
            let way = Self { flip, differential, tables: found.map(|(table, _)| table) };
            Some((found[0].1 + found[1].1, way))
        });
        tried
            .min_by_key(|(error, _)| *error)
            .map_or(Self { flip: false, differential: false, tables: [0; 2] }, |(_, way)| way)
    }

    /// Bits of the hints and their number, each after the one before it: of BC1 none, flip, kind of bases,
    /// tables, bias.
    pub(super) fn fields(self) -> [(u32, u32); 6] {
        let [first, second] = self.tables;
        [(0, 2), (self.flip.into(), 1), (self.differential.into(), 1), (first, 3), (second, 3), (NO_BIAS, 5)]
    }
}

/// Texels of a half.
fn half_of(texels: &[[u8; 3]; TEXELS], flip: bool, half: usize) -> [[i32; 3]; TEXELS / 2] {
    std::array::from_fn(|i| {
        let (x, y) = if flip { (i % 4, i / 4 + 2 * half) } else { (i % 2 + 2 * half, i / 2) };
        texels[y * 4 + x].map(i32::from)
    })
}

/// Largest value of a base.
fn limit(differential: bool) -> i32 {
    if differential { 31 } else { 15 }
}

/// Mean of a half, rounded to a base.
fn base(half: &[[i32; 3]; TEXELS / 2], differential: bool) -> [i32; 3] {
    [0, 1, 2].map(|c| {
        let sum: i32 = half.iter().map(|texel| texel[c]).sum();
        (sum * limit(differential) + 1020) / 2040
    })
}

/// Byte that a base stands for.
fn widened(base: i32, differential: bool) -> i32 {
    if differential { base << 3 | base >> 2 } else { base << 4 | base }
}

/// Table that comes nearest to a half's texels, and its squared error, three times as large: modifiers move
/// all channels alike, so that a texel's mean distance from the base is what they can meet.
fn table(half: &[[i32; 3]; TEXELS / 2], base: [i32; 3]) -> (u32, i32) {
    let apart = half.map(|texel| [0, 1, 2].map(|c| texel[c] - base[c]));
    // Sums of three distances: of their squares, the mean's part is the square of the sum over three.
    let sums = apart.map(|d| d[0] + d[1] + d[2]);
    let rest: i32 = apart
        .iter()
        .zip(&sums)
        .map(|(d, sum)| 3 * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - sum * sum)
        .sum();
    let error = |[small, large]: [i32; 2]| -> i32 {
        let off = |sum: &i32, by: i32| (sum.abs() - 3 * by).pow(2);
        sums.iter().map(|sum| off(sum, small).min(off(sum, large))).sum()
    };
    let best = (0_u32..).zip(MODIFIERS.map(error)).min_by_key(|(_, error)| *error);
    best.map_or((0, rest), |(table, error)| (table, rest + error))
}

/// Squared distance of a texel from a base that was moved.
fn off(texel: [i32; 3], base: [i32; 3], by: i32) -> i32 {
    (0..3).map(|c| ((base[c] + by).clamp(0, 255) - texel[c]).pow(2)).sum()
}

/// Hints of a block of one colour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    differential: bool,
    table: u32,
    /// Place of the distance among the table's, from the least.
    selector: u32,
    base: [u32; 3],
}

impl Flat {
    /// Hints that come nearest to a colour.
    pub(super) fn of(colour: [u8; 3]) -> Self {
        let colour = colour.map(i32::from);
        let mut best = (i32::MAX, Self { differential: true, table: 0, selector: 0, base: [0; 3] });
        for differential in [true, false] {
            for (table, [small, large]) in (0_u32..).zip(MODIFIERS) {
                for (selector, by) in (0_u32..).zip([-large, -small, small, large]) {
                    let limit = limit(differential);
                    let base = colour.map(|c| (((c - by) * limit + 127) / 255).clamp(0, limit));
                    let error = off(colour, base.map(|v| widened(v, differential)), by);
                    if error < best.0 {
                        best = (error, Self { differential, table, selector, base: base.map(|v| v as u32) });
                    }
                }
            }
        }
        best.1
    }

    /// Bits of the hints and their number, each after the one before it.
    pub(super) fn fields(self) -> [(u32, u32); 6] {
        let [r, g, b] = self.base;
        [(self.differential.into(), 1), (self.table, 3), (self.selector, 2), (r, 5), (g, 5), (b, 5)]
    }
}
