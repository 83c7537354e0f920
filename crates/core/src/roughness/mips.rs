//! Plain mips of values, as an engine makes them, and their enlargement.

use rayon::prelude::*;

use crate::grid::{Grid, Size};
use crate::lookup::area_mean;
use crate::pyramid::level_sizes;
use crate::surface::Wraps;

/// Every level of a map of values, finest first: exact area means.
#[must_use]
pub fn mips(finest: Grid<[f32; 4]>) -> Vec<Grid<[f32; 4]>> {
    let mut levels = vec![finest];
    for size in level_sizes(levels[0].size()).into_iter().skip(1) {
        // Texels that fill those of the next level hold all that it needs.
        let above = &levels[levels.len() - 1];
        let nests =
            above.size().width.is_multiple_of(size.width) && above.size().height.is_multiple_of(size.height);
        let from = if nests { above } else { &levels[0] };
        let level = filled(size, |x, y| area_mean(from, size, x, y));
        levels.push(level);
    }
    levels
}

/// Values at a larger size, bilinearly between texels.
#[must_use]
pub fn enlarged(values: &Grid<[f32; 4]>, size: Size, wraps: Wraps) -> Grid<[f32; 4]> {
    let from = values.size();
    let place = |i: usize, fine: usize, coarse: usize| {
        let x = (i as f64 + 0.5) * coarse as f64 / fine as f64 - 0.5;
        (x.floor() as isize, (x - x.floor()) as f32)
    };
    filled(size, |x, y| {
        let ((i, u), (j, v)) = (place(x, size.width, from.width), place(y, size.height, from.height));
        let at = |i, j| values.row(wraps.y.index(j, from.height))[wraps.x.index(i, from.width)];
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
        std::array::from_fn(|k| (a[k] * (1.0 - u) + b[k] * u) * (1.0 - v) + (c[k] * (1.0 - u) + d[k] * u) * v)
    })
}

/// Grid whose rows are worked out in parallel, each by itself.
pub(super) fn filled<T: Send>(size: Size, texel: impl Fn(usize, usize) -> T + Sync) -> Grid<T> {
    let row = |y: usize| (0..size.width).map(|x| texel(x, y)).collect::<Vec<T>>();
    let rows: Vec<Vec<T>> = (0..size.height).into_par_iter().map(row).collect();
    let texels = rows.into_iter().flatten().collect();
    Grid::from_vec(size, texels).unwrap_or_else(|| unreachable!("row by row"))
}
