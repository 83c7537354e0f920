//! The normals under a texel as weighted sufficient statistics, and fewer of them where many lie close together.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::assign::LANES;
use super::family::Family;
use crate::grid::Size;
use crate::pyramid::footprint;
use crate::surface::{Surface, SurfaceRow};

/// Statistics of some samples and what each weighs; padded to a multiple of [`LANES`] with weight 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples {
    pub(crate) a: Vec<f32>,
    pub(crate) b: Vec<f32>,
    pub(crate) c: Vec<f32>,
    pub(crate) weight: Vec<f32>,
}

impl Samples {
    /// Number of samples, padding included.
    pub(crate) fn len(&self) -> usize {
        self.weight.len()
    }

    /// Adds a sample.
    pub(crate) fn push(&mut self, weight: f32, [a, b, c]: [f32; 3]) {
        self.a.push(a);
        self.b.push(b);
        self.c.push(c);
        self.weight.push(weight);
    }

    /// Removes all samples.
    pub(crate) fn clear(&mut self) {
        for plane in [&mut self.a, &mut self.b, &mut self.c, &mut self.weight] {
            plane.clear();
        }
    }

    /// Fills up to a multiple of [`LANES`].
    pub(crate) fn pad(&mut self) {
        let padded = self.len().next_multiple_of(LANES);
        for plane in [&mut self.a, &mut self.b, &mut self.c, &mut self.weight] {
            plane.resize(padded, 0.0);
        }
    }
}

/// Samples of a whole map: the same number in every cell of a grid, whose weights sum to one in each.
pub(crate) struct SampleGrid {
    /// Cells, and samples in each.
    cells: Size,
    per_cell: usize,
    planes: [Vec<f32>; 3],
    /// Empty when every sample weighs 1.
    weight: Vec<f32>,
}

impl SampleGrid {
    /// One sample a fine texel.
    pub(crate) fn finest(family: impl Family, surface: &dyn Surface) -> Self {
        let cells = surface.size();
        let mut planes = [0; 3].map(|_| vec![0.0_f32; cells.area()]);
        let [a, b, c] = &mut planes;
        let width = cells.width;
        a.par_chunks_exact_mut(width)
            .zip(b.par_chunks_exact_mut(width))
            .zip(c.par_chunks_exact_mut(width))
            .enumerate()
            .for_each_init(
                || SurfaceRow::flat(width),
                |row, (y, ((a, b), c))| {
                    surface.read_row(y, row);
                    for i in 0..width {
                        [a[i], b[i], c[i]] = family.statistics(Vec3::new(row.x[i], row.y[i], row.z[i]));
                    }
                },
            );
        Self { cells, per_cell: 1, planes, weight: Vec::new() }
    }

    /// True when the cells of this grid fill texels of `level` exactly.
    pub(crate) fn nests(&self, level: Size) -> bool {
        self.cells.width.is_multiple_of(level.width) && self.cells.height.is_multiple_of(level.height)
    }

    /// Collects the samples under texel `(x, y)` of a level; their weights sum to one.
    pub(crate) fn gather(&self, level: Size, (x, y): (usize, usize), out: &mut Samples) {
        out.clear();
        let (columns, column_weight) = footprint(self.cells.width, level.width, x);
        let (rows, row_weight) = footprint(self.cells.height, level.height, y);
        let n = self.per_cell;
        // Where cells fill the texel they weigh the same, and nothing need be worked out for each.
        let even = self.nests(level).then(|| 1.0 / (columns.len() * rows.len()) as f32);
        for j in rows {
            let start = (j * self.cells.width + columns.start) * n;
            let range = start..start + columns.len() * n;
            out.a.extend_from_slice(&self.planes[0][range.clone()]);
            out.b.extend_from_slice(&self.planes[1][range.clone()]);
            out.c.extend_from_slice(&self.planes[2][range.clone()]);
            if let Some(cell) = even {
                match self.weight.get(range) {
                    Some(weights) if !self.weight.is_empty() => {
                        out.weight.extend(weights.iter().map(|w| w * cell))
                    }
                    _ => out.weight.resize(out.a.len(), cell),
                }
                continue;
            }
            let row_weight = row_weight(j) as f32;
            if self.weight.is_empty() {
                out.weight.extend(columns.clone().map(|i| row_weight * column_weight(i) as f32));
            } else {
                let weights = self.weight[range].chunks_exact(n).zip(columns.clone());
                out.weight.extend(weights.flat_map(|(w, i)| {
                    let cell = row_weight * column_weight(i) as f32;
                    w.iter().map(move |w| w * cell)
                }));
            }
        }
        out.pad();
    }

    /// A grid of `level`, whose texels must be nested, with at most `per_cell` samples in each cell.
    ///
    /// The cell's samples are cut in two across their widest spread, and the widest part again, until there are
    /// enough parts; each is replaced by its weighted mean, so sums over all samples do not change.
    pub(crate) fn merge(&self, level: Size, per_cell: usize) -> Self {
        let mut planes = [0; 3].map(|_| vec![0.0_f32; level.area() * per_cell]);
        let mut weight = vec![0.0_f32; level.area() * per_cell];
        let [a, b, c] = &mut planes;
        let step = level.width * per_cell;
        let rows = a.par_chunks_exact_mut(step).zip(b.par_chunks_exact_mut(step));
        let rows = rows.zip(c.par_chunks_exact_mut(step)).zip(weight.par_chunks_exact_mut(step));
        rows.enumerate().for_each_init(
            || (Samples::default(), Vec::new(), Vec::new()),
            |(samples, points, parts), (y, (((a, b), c), w))| {
                for x in 0..level.width {
                    self.gather(level, (x, y), samples);
                    points.clear();
                    let alive = (0..samples.len()).filter(|i| samples.weight[*i] > 0.0);
                    points
                        .extend(alive.map(|i| [samples.weight[i], samples.a[i], samples.b[i], samples.c[i]]));
                    cut(points, per_cell, parts);
                    for (at, part) in (x * per_cell..).zip(parts.iter()) {
                        [w[at], a[at], b[at], c[at]] = mean(&points[part.range.clone()]);
                    }
                }
            },
        );
        Self { cells: level, per_cell, planes, weight }
    }
}

/// Weight, and statistics.
type Point = [f32; 4];

/// A run of points.
struct Part {
    range: Range<usize>,
    /// Weight times the square of the widest extent.
    spread: f32,
    /// Where that is, and its middle.
    axis: usize,
    middle: f32,
}

impl Part {
    fn new(points: &[Point], range: Range<usize>) -> Self {
        let (mut low, mut high, mut weight) = ([f32::MAX; 3], [f32::MIN; 3], 0.0);
        for p in &points[range.clone()] {
            weight += p[0];
            for k in 0..3 {
                low[k] = low[k].min(p[k + 1]);
                high[k] = high[k].max(p[k + 1]);
            }
        }
        let extent = |k: usize| high[k] - low[k];
        let axis = (1..3).fold(0, |widest, k| if extent(k) > extent(widest) { k } else { widest });
        let spread = weight * extent(axis) * extent(axis);
        Self { range, spread, axis: axis + 1, middle: 0.5 * (low[axis] + high[axis]) }
    }
}

/// Sorts points into at most `most` parts, each a run.
fn cut(points: &mut [Point], most: usize, parts: &mut Vec<Part>) {
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

fn mean(points: &[Point]) -> Point {
    let mut sums = [0.0_f32; 4];
    for [w, a, b, c] in points {
        for (sum, value) in sums.iter_mut().zip([*w, w * a, w * b, w * c]) {
            *sum += value;
        }
    }
    let [w, a, b, c] = sums;
    [w, a / w, b / w, c / w]
}

/// Samples of a whole map for every level: the fine normals, and merged ones where that pays.
pub(crate) struct Samplings {
    finest: SampleGrid,
    merged: Vec<SampleGrid>,
}

/// First level that is merged, and samples kept in each of its cells and of every coarser level's.
///
/// A level looks at the cells of the level before, so from level 5 on a texel has at most four times this many
/// samples, whatever is under it. 64 begins to cost accuracy; 128 costs none that could be measured.
const MERGED_FROM: usize = 4;
const MERGED_SAMPLES: usize = 128;

impl Samplings {
    /// Reads the surface and merges as far as levels nest; `sizes` are those of all levels.
    pub(crate) fn new(family: impl Family, surface: &dyn Surface, sizes: &[Size]) -> Self {
        let finest = SampleGrid::finest(family, surface);
        let mut merged: Vec<SampleGrid> = Vec::new();
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
    pub(crate) fn finest(&self) -> &SampleGrid {
        &self.finest
    }

    /// The coarsest grid whose cells are smaller than the texels of this level and fill them.
    pub(crate) fn for_level(&self, size: Size) -> &SampleGrid {
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
        let all = Samplings::new(Spherical, &*surface, &sizes);
        let sums = |grid: &SampleGrid, size: Size| {
            let mut samples = Samples::default();
            grid.gather(size, (0, 0), &mut samples);
            let total = |v: &[f32]| samples.weight.iter().zip(v).map(|(w, v)| f64::from(w * v)).sum::<f64>();
            [total(&vec![1.0; samples.len()]), total(&samples.a), total(&samples.b), total(&samples.c)]
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
        let grid = SampleGrid::finest(Spherical, &*surface);
        let mut samples = Samples::default();
        grid.gather(Size::new(2, 1).unwrap(), (0, 0), &mut samples);
        let weights: Vec<f32> = samples.weight[..9].to_vec();
        for (w, expected) in weights.iter().zip([0.4, 0.4, 0.2].repeat(3)) {
            assert!((w - expected / 3.0).abs() < 1e-7);
        }
        assert!(samples.weight[9..].iter().all(|w| *w == 0.0) && samples.len() == LANES);
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
