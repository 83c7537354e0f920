//! The normals under a texel as weighted sufficient statistics, and fewer of them where many lie close
//! together.

use std::ops::Range;

use rayon::prelude::*;

use super::assign::LANES;
use super::family::Family;
use crate::grid::Size;
use crate::pyramid::footprint;
use crate::surface::{Surface, SurfaceRow};

/// Samples of N statistics, the first of them one; padded to a multiple of [`LANES`] with weight 0.
#[derive(Clone, Debug)]
pub(crate) struct Samples<const N: usize> {
    /// The weight of each sample in the place of the first statistic, then the others.
    pub(crate) planes: [Vec<f32>; N],
}

impl<const N: usize> Default for Samples<N> {
    fn default() -> Self {
        Self { planes: [(); N].map(|()| Vec::new()) }
    }
}

impl<const N: usize> Samples<N> {
    /// Number of samples, padding included.
    pub(crate) fn len(&self) -> usize {
        self.planes[0].len()
    }

    /// Weight of each sample.
    pub(crate) fn weights(&self) -> &[f32] {
        &self.planes[0]
    }

    /// Statistics of a sample.
    pub(crate) fn statistics(&self, i: usize) -> [f32; N] {
        let mut t = [1.0; N];
        (1..N).for_each(|s| t[s] = self.planes[s][i]);
        t
    }

    /// Adds a sample.
    pub(crate) fn push(&mut self, weight: f32, statistics: [f32; N]) {
        self.planes[0].push(weight);
        for (plane, t) in self.planes.iter_mut().zip(statistics).skip(1) {
            plane.push(t);
        }
    }

    /// Removes all samples.
    pub(crate) fn clear(&mut self) {
        self.planes.iter_mut().for_each(Vec::clear);
    }

    /// Fills up to a multiple of [`LANES`].
    pub(crate) fn pad(&mut self) {
        let padded = self.len().next_multiple_of(LANES);
        self.planes.iter_mut().for_each(|plane| plane.resize(padded, 0.0));
    }
}

/// Samples of a whole map: the same number in every cell of a grid, whose weights sum to one in each.
pub(crate) struct SampleGrid<const N: usize> {
    /// Cells, and samples in each.
    cells: Size,
    per_cell: usize,
    /// Planes as in [`Samples`]; the first one is empty when every sample weighs 1.
    planes: [Vec<f32>; N],
}

impl<const N: usize> SampleGrid<N> {
    /// Grid with one sample for each fine texel.
    pub(crate) fn finest(family: impl Family<N>, surface: &dyn Surface) -> Self {
        let cells = surface.size();
        let row = |y: usize, row: &mut SurfaceRow| {
            surface.read_row(y, row);
            (0..cells.width).map(|i| family.statistics(row.normal(i))).collect::<Vec<[f32; N]>>()
        };
        let mut planes: [Vec<f32>; N] =
            std::array::from_fn(|p| Vec::with_capacity(if p == 0 { 0 } else { cells.area() }));
        let ys: Vec<usize> = (0..cells.height).collect();
        for band in ys.chunks(ROWS) {
            let rows: Vec<Vec<[f32; N]>> = band
                .par_iter()
                .map_init(|| SurfaceRow::flat(cells.width), |scratch, y| row(*y, scratch))
                .collect();
            for (s, plane) in planes.iter_mut().enumerate().skip(1) {
                plane.extend(rows.iter().flatten().map(|t| t[s]));
            }
        }
        Self { cells, per_cell: 1, planes }
    }

    /// True when the cells of this grid fill texels of `level` exactly.
    pub(crate) fn nests(&self, level: Size) -> bool {
        self.cells.width.is_multiple_of(level.width) && self.cells.height.is_multiple_of(level.height)
    }

    /// Collects the samples under texel `(x, y)` of a level; their weights sum to one.
    pub(crate) fn gather(&self, level: Size, (x, y): (usize, usize), out: &mut Samples<N>) {
        out.clear();
        let (columns, column_weight) = footprint(self.cells.width, level.width, x);
        let (rows, row_weight) = footprint(self.cells.height, level.height, y);
        let n = self.per_cell;
        let own_weights = &self.planes[0];
        let [weights, statistics @ ..] = out.planes.as_mut_slice() else {
            unreachable!("the first is the weight")
        };
        // Cells that fill the texel weigh the same, so no weight is worked out for each.
        let even = self.nests(level).then(|| 1.0 / (columns.len() * rows.len()) as f32);
        for j in rows {
            let start = (j * self.cells.width + columns.start) * n;
            let range = start..start + columns.len() * n;
            for (out, plane) in statistics.iter_mut().zip(&self.planes[1..]) {
                out.extend_from_slice(&plane[range.clone()]);
            }
            if let Some(cell) = even {
                if own_weights.is_empty() {
                    weights.resize(weights.len() + range.len(), cell);
                } else {
                    weights.extend(own_weights[range].iter().map(|w| w * cell));
                }
                continue;
            }
            let row_weight = row_weight(j) as f32;
            if own_weights.is_empty() {
                weights.extend(columns.clone().map(|i| row_weight * column_weight(i) as f32));
            } else {
                let cells = own_weights[range].chunks_exact(n).zip(columns.clone());
                weights.extend(cells.flat_map(|(w, i)| {
                    let cell = row_weight * column_weight(i) as f32;
                    w.iter().map(move |w| w * cell)
                }));
            }
        }
        out.pad();
    }

    /// A grid of `level`, whose texels must be nested, with at most `per_cell` samples in each cell.
    ///
    /// The cell's samples are cut in two across their widest spread, and the widest part again, until there
    /// are enough parts; each is replaced by its weighted mean, so sums over all samples do not change.
    pub(crate) fn merge(&self, level: Size, per_cell: usize) -> Self {
        let step = level.width * per_cell;
        let row = |y: usize, (samples, points, parts): &mut (Samples<N>, Vec<[f32; N]>, Vec<Part>)| {
            let mut merged = vec![[0.0_f32; N]; step];
            for x in 0..level.width {
                self.gather(level, (x, y), samples);
                points.clear();
                let alive = (0..samples.len()).filter(|i| samples.weights()[*i] > 0.0);
                points.extend(alive.map(|i| std::array::from_fn::<f32, N, _>(|p| samples.planes[p][i])));
                cut(points, per_cell, parts);
                for (at, part) in (x * per_cell..).zip(parts.iter()) {
                    merged[at] = mean(&points[part.range.clone()]);
                }
            }
            merged
        };
        let rows: Vec<Vec<[f32; N]>> = (0..level.height)
            .into_par_iter()
            .map_init(|| (Samples::default(), Vec::new(), Vec::new()), |scratch, y| row(y, scratch))
            .collect();
        let plane = |p: usize| rows.iter().flatten().map(|t| t[p]).collect();
        Self { cells: level, per_cell, planes: std::array::from_fn(plane) }
    }
}

/// Rows of statistics that are in memory as such, before they are parted into planes.
const ROWS: usize = 64;

/// A run of points.
struct Part {
    range: Range<usize>,
    /// Weight times the square of the widest extent.
    spread: f32,
    /// Axis of the widest extent, and the middle of that extent.
    axis: usize,
    middle: f32,
}

impl Part {
    fn new<const N: usize>(points: &[[f32; N]], range: Range<usize>) -> Self {
        let (mut low, mut high, mut weight) = ([f32::MAX; N], [f32::MIN; N], 0.0);
        for p in &points[range.clone()] {
            weight += p[0];
            for k in 1..N {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
        }
        let extent = |k: usize| high[k] - low[k];
        let axis = (2..N).fold(1, |widest, k| if extent(k) > extent(widest) { k } else { widest });
        let spread = weight * extent(axis) * extent(axis);
        Self { range, spread, axis, middle: 0.5 * (low[axis] + high[axis]) }
    }
}

/// Sorts points into at most `most` parts, each a run.
fn cut<const N: usize>(points: &mut [[f32; N]], most: usize, parts: &mut Vec<Part>) {
    parts.clear();
    if points.is_empty() {
        return;
    }
    parts.push(Part::new(points, 0..points.len()));
    while parts.len() < most {
        let widest = (1..parts.len()).fold(0, |w, i| if parts[i].spread > parts[w].spread { i } else { w });
        let Part { range, spread, axis, middle } = &parts[widest];
        if *spread <= 0.0 {
            return;
        }
        let (range, axis, middle) = (range.clone(), *axis, *middle);
        let mut split = range.start;
        for i in range.clone() {
            if points[i][axis] < middle {
                points.swap(i, split);
                split += 1;
            }
        }
        if split == range.start {
            // The middle of two neighbouring floats is one of them: as close together as can be told.
            parts[widest].spread = 0.0;
            continue;
        }
        parts[widest] = Part::new(points, range.start..split);
        parts.push(Part::new(points, split..range.end));
    }
}

/// Weighted mean of points, each a weight and its statistics.
fn mean<const N: usize>(points: &[[f32; N]]) -> [f32; N] {
    let mut sums = [0.0_f32; N];
    for p in points {
        sums[0] += p[0];
        for k in 1..N {
            sums[k] += p[0] * p[k];
        }
    }
    let weight = sums[0];
    sums[1..].iter_mut().for_each(|sum| *sum /= weight);
    sums
}

/// Samples of a whole map for every level: the fine normals, and merged ones where that pays.
pub(crate) struct Samplings<const N: usize> {
    finest: SampleGrid<N>,
    merged: Vec<SampleGrid<N>>,
}

/// First level that is merged, and samples kept in each of its cells and of every coarser level's.
///
/// A level looks at the cells of the level before, so from level 5 on a texel has at most four times this
/// many samples, whatever is under it. 64 begins to cost accuracy; 128 costs none that could be measured.
const MERGED_FROM: usize = 4;
const MERGED_SAMPLES: usize = 128;

impl<const N: usize> Samplings<N> {
    /// Reads the surface and merges as far as levels nest; `sizes` are those of all levels.
    pub(crate) fn new(family: impl Family<N>, surface: &dyn Surface, sizes: &[Size]) -> Self {
        let finest = SampleGrid::finest(family, surface);
        let mut merged: Vec<SampleGrid<N>> = Vec::new();
        for size in sizes.iter().skip(MERGED_FROM) {
            let from = merged.last().unwrap_or(&finest);
            if !from.nests(*size) {
                break;
            }
            let next = from.merge(*size, MERGED_SAMPLES);
            merged.push(next);
        }
        Self { finest, merged }
    }

    /// The fine normals.
    pub(crate) fn finest(&self) -> &SampleGrid<N> {
        &self.finest
    }

    /// The coarsest grid whose cells are smaller than the texels of this level and fill them.
    pub(crate) fn for_level(&self, size: Size) -> &SampleGrid<N> {
        self.merged.iter().rev().find(|g| g.cells != size && g.nests(size)).unwrap_or(&self.finest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::family::Spherical;
    use crate::procedural;

    #[test]
    fn merging_keeps_the_sums() {
        let surface = (procedural::find("foil").unwrap().build)(Size::new(64, 64).unwrap());
        let sizes = crate::pyramid::level_sizes(surface.size());
        let all = Samplings::new(Spherical::<false>, &*surface, &sizes);
        let sums = |grid: &SampleGrid<4>, size: Size| {
            let mut samples = Samples::default();
            grid.gather(size, (0, 0), &mut samples);
            let term = |i: usize, s: usize| f64::from(samples.weights()[i] * samples.statistics(i)[s]);
            [0, 1, 2, 3].map(|s| (0..samples.len()).map(|i| term(i, s)).sum::<f64>())
        };
        for size in &sizes[5..] {
            let merged = all.for_level(*size);
            assert!(merged.per_cell == MERGED_SAMPLES);
            for (a, b) in sums(merged, *size).iter().zip(sums(all.finest(), *size)) {
                // Thousands of single floats added in another order.
                assert!((a - b).abs() < 1e-5, "{a} {b}");
            }
        }
    }

    #[test]
    fn odd_sizes_weigh_by_area() {
        let surface = (procedural::find("foil").unwrap().build)(Size::new(5, 3).unwrap());
        let grid = SampleGrid::finest(Spherical::<false>, &*surface);
        let mut samples = Samples::default();
        grid.gather(Size::new(2, 1).unwrap(), (0, 0), &mut samples);
        let weights: Vec<f32> = samples.weights()[..9].to_vec();
        for (w, expected) in weights.iter().zip([0.4, 0.4, 0.2].repeat(3)) {
            assert!((w - expected / 3.0).abs() < 1e-7);
        }
        assert!(samples.weights()[9..].iter().all(|w| *w == 0.0) && samples.len() == LANES);
    }

    #[test]
    fn equal_points_are_one_part() {
        let mut parts = Vec::new();
        cut(&mut [[0.25, 0.1, 0.2, 0.3]; 4], 3, &mut parts);
        assert_eq!(parts.len(), 1);
        let mut points = [[0.5, 0.0, 0.0, 0.0], [0.5, f32::MIN_POSITIVE, 0.0, 0.0]];
        cut(&mut points, 8, &mut parts);
        assert!(parts.len() <= 2);
    }
}
