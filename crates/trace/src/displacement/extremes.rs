//! Least and greatest heights under any part of a map, from which boxes around a displaced surface are made.

use glam::DVec2;
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::{Lookup, Texels};
use ndfmap_core::surface::{Wrap, Wraps};

/// Least and greatest heights of squares of texels, 1, 2, 4, ... on a side.
pub(super) struct Extremes {
    size: Size,
    wraps: Wraps,
    /// Levels, each with its size, finest first; cells at the far edges may be cut short.
    levels: Vec<(Size, Vec<[f32; 2]>)>,
}

impl Extremes {
    pub(super) fn new(heights: &Lookup) -> Self {
        let size = heights.sizes()[0];
        let finest = (0..size.area()).map(|i| {
            let height = heights.texel(0, i % size.width, i / size.width)[0];
            [height, height]
        });
        let mut levels = vec![(size, finest.collect::<Vec<_>>())];
        while let Some((fine, values)) = levels.last().filter(|(size, _)| size.area() > 1) {
            let coarse = Size { width: fine.width.div_ceil(2), height: fine.height.div_ceil(2) };
            let cell = |i: usize| {
                let (x, y) = (2 * (i % coarse.width), 2 * (i / coarse.width));
                let rows = y..(y + 2).min(fine.height);
                let columns = x..(x + 2).min(fine.width);
                let all = rows.flat_map(|y| columns.clone().map(move |x| y * fine.width + x));
                all.fold(EMPTY, |sum, i| joined(sum, values[i]))
            };
            let cells = (0..coarse.area()).map(cell).collect();
            levels.push((coarse, cells));
        }
        Self { size, wraps: heights.wraps(), levels }
    }

    /// Bounds of the bilinear surface between two places of the map, the lesser and the greater on each axis.
    pub(super) fn between(&self, low: DVec2, high: DVec2) -> [f64; 2] {
        let spans = [
            span((low.x, high.x), self.size.width, self.wraps.x),
            span((low.y, high.y), self.size.height, self.wraps.y),
        ];
        let longest = spans.iter().map(|s| s.length).max().unwrap_or(1);
        let level = longest.next_power_of_two().trailing_zeros() as usize;
        let (size, cells) = &self.levels[level.min(self.levels.len() - 1)];
        let level = level.min(self.levels.len() - 1);
        let (columns, rows) = (spans[0].cells(level, size.width), spans[1].cells(level, size.height));
        let mut sum = EMPTY;
        for y in rows.iter().flatten() {
            for x in columns.iter().flatten() {
                sum = joined(sum, cells[y * size.width + x]);
            }
        }
        sum.map(f64::from)
    }

    pub(super) fn bytes(&self) -> usize {
        self.levels.iter().map(|(_, cells)| std::mem::size_of_val(cells.as_slice())).sum()
    }
}

const EMPTY: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

fn joined(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Run of texels on an axis; beyond the axis's last texel it goes on with the first.
struct Span {
    first: usize,
    /// Number of texels, at least one and at most all.
    length: usize,
    texels: usize,
}

/// Texels between whose centres the places from `low` to `high` lie.
fn span((low, high): (f64, f64), texels: usize, wrap: Wrap) -> Span {
    let at = |t: f64| (t * texels as f64 - 0.5).clamp(-1e15, 1e15);
    // One more texel on a side where floats may have rounded across its border.
    let (first, last) = ((at(low) - 1e-6).floor() as i64, (at(high) + 1e-6).floor() as i64 + 1);
    match wrap {
        Wrap::Clamp => {
            let (first, last) = (first.clamp(0, texels as i64 - 1), last.clamp(0, texels as i64 - 1));
            Span { first: first as usize, length: (last - first + 1) as usize, texels }
        }
        Wrap::Repeat => {
            let length = ((last - first + 1).max(1) as usize).min(texels);
            Span { first: first.rem_euclid(texels as i64) as usize, length, texels }
        }
    }
}

impl Span {
    /// The cells of a level that hold the texels, if that level is coarse enough for two to do; also those
    /// round the end.
    fn cells(&self, level: usize, count: usize) -> [Option<usize>; 4] {
        let last = self.first + self.length - 1;
        let cell = |texel: usize| Some((texel >> level).min(count - 1));
        if last < self.texels {
            [cell(self.first), cell(last), None, None]
        } else {
            [cell(self.first), Some(count - 1), Some(0), cell(last - self.texels)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndfmap_core::grid::Grid;
    use ndfmap_core::lookup::Tap;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn bounds_hold_what_the_surface_does() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        for (width, height) in [(1, 1), (5, 3), (16, 16), (33, 20)] {
            for wrap in [Wrap::Repeat, Wrap::Clamp] {
                let size = Size { width, height };
                let values = Grid::from_fn(size, |_, _| [random.random::<f32>(), 0.0, 0.0, 1.0]);
                let lookup = Lookup::of_values(&values, Wraps { x: wrap, y: wrap });
                let extremes = Extremes::new(&lookup);
                for _ in 0..400 {
                    let [x, y, w, h]: [f64; 4] = random.random();
                    let low = DVec2::new(3.0 * x - 1.0, 3.0 * y - 1.0);
                    let extent = DVec2::new(w, h) * random.random::<f64>().powi(4);
                    let [least, greatest] = extremes.between(low, low + extent);
                    for _ in 0..20 {
                        let [s, t]: [f64; 2] = random.random();
                        let mut sums = [0.0; 4];
                        let tap = Tap { uv: low + extent * DVec2::new(s, t), lod: 0.0 };
                        lookup.trilinear(tap, 1.0, &mut sums);
                        let height = f64::from(sums[0]);
                        // Single floats mix to their last digit.
                        assert!(
                            height > least - 1e-6 && height < greatest + 1e-6,
                            "{size:?} {wrap:?} {tap:?}"
                        );
                    }
                }
            }
        }
    }
}
