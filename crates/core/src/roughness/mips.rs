//! Mips of plain values: means, as an engine makes them, and enlargement.

use std::ops::{Add, Mul};

use rayon::prelude::*;

use crate::grid::{Grid, Size};
use crate::pyramid::footprint;

/// Mean of the texels under one texel of the next level.
#[must_use]
pub fn mean_under<T>(above: &Grid<T>, size: Size, (x, y): (usize, usize)) -> T
where
    T: Copy + Default + Add<Output = T> + Mul<f32, Output = T>,
{
    let (columns, column_weight) = footprint(above.size().width, size.width, x);
    let (rows, row_weight) = footprint(above.size().height, size.height, y);
    let mut mean = T::default();
    for j in rows {
        for i in columns.clone() {
            mean = mean + above.row(j)[i] * (column_weight(i) * row_weight(j)) as f32;
        }
    }
    mean
}

/// Texels of a larger size, bilinearly between those of a smaller one, which `at` gives beyond its edges too.
#[must_use]
pub fn enlarged<T>(from: Size, to: Size, at: impl Fn(isize, isize) -> T + Sync) -> Grid<T>
where
    T: Add<Output = T> + Mul<f32, Output = T> + Send,
{
    let place = |i: usize, fine: usize, coarse: usize| {
        let x = (i as f64 + 0.5) * coarse as f64 / fine as f64 - 0.5;
        (x.floor() as isize, (x - x.floor()) as f32)
    };
    let row = |y: usize| {
        let (j, v) = place(y, to.height, from.height);
        let at = &at;
        (0..to.width).map(move |x| {
            let (i, u) = place(x, to.width, from.width);
            let above = at(i, j) * (1.0 - u) + at(i + 1, j) * u;
            let below = at(i, j + 1) * (1.0 - u) + at(i + 1, j + 1) * u;
            above * (1.0 - v) + below * v
        })
    };
    let rows: Vec<Vec<T>> = (0..to.height).into_par_iter().map(|y| row(y).collect()).collect();
    let texels = rows.into_iter().flatten().collect();
    Grid::from_vec(to, texels).unwrap_or_else(|| unreachable!("row by row"))
}
