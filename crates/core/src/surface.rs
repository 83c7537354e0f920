//! Heights, slopes and normals: the one place that knows the sign conventions.
//!
//! Tangent frame: x to the right of the picture, y **up** (image rows run down, so y is minus the
//! row direction), z out of the surface. A height field `h` has slope `(dh/dx, dh/dy)`; its normal
//! is `(-slope.x, -slope.y, 1)` normalised (`docs/notation.md`). Heights are in units of the texture's
//! width on both axes, so slopes have no unit and do not depend on the resolution.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::grid::{Grid, Size};
use crate::words;

/// Wrap of a map on one axis: how it goes on beyond its edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The map tiles.
    #[default]
    Repeat,
    /// The edge texel goes on for ever.
    Clamp,
}

words!(Wrap { Repeat => "repeat", Clamp => "clamp" });

impl Wrap {
    /// The texel that stands for coordinate `i`, which may lie outside `0..n`.
    #[must_use]
    pub fn index(self, i: isize, n: usize) -> usize {
        match self {
            Self::Repeat => i.rem_euclid(n as isize) as usize,
            Self::Clamp => i.clamp(0, n as isize - 1) as usize,
        }
    }
}

/// [`Wrap`] of each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wraps {
    /// Along a row.
    pub x: Wrap,
    /// Along a column.
    pub y: Wrap,
}

/// Largest slope on one axis that is kept apart from "vertical": 84 degrees.
///
/// Second moments are ruled by the steepest texels: one of slope 255 (n.z = 1/255, a frequent artefact of
/// JPEG) outweighs 65 000 of slope 1. On three real maps with such artefacts 10 takes a quarter to two thirds
/// off the error of `slopes` at the coarsest level against 255, and it costs clean ones nothing
/// (`docs/decisions.md`). A normal at or below the horizon has no slope at all and gets this one, in its own
/// direction.
pub const MAX_SLOPE: f32 = 10.0;

/// Slope of a unit normal, each axis held to [`MAX_SLOPE`]: `(-n.x/n.z, -n.y/n.z)`.
#[inline]
#[must_use]
pub fn slope_of_normal(n: Vec3) -> Vec2 {
    let z = n.z.max(f32::MIN_POSITIVE);
    Vec2::new((-n.x / z).clamp(-MAX_SLOPE, MAX_SLOPE), (-n.y / z).clamp(-MAX_SLOPE, MAX_SLOPE))
}

/// Unit normal of a slope: `(-x, -y, 1) / sqrt(1 + x² + y²)`.
#[inline]
#[must_use]
pub fn normal_of_slope(slope: Vec2) -> Vec3 {
    Vec3::new(-slope.x, -slope.y, 1.0) * (1.0 + slope.length_squared()).sqrt().recip()
}

/// Unit normal of a stored vector; `(0,0,1)` for a vector without a direction (zero or not finite).
#[inline]
#[must_use]
pub fn unit_or_up(v: Vec3) -> Vec3 {
    let length_squared = v.length_squared();
    // 1e-12 lies far below (1/255)², the shortest vector an 8-bit map can mean.
    if length_squared > 1e-12 && length_squared < f32::INFINITY {
        v * length_squared.sqrt().recip()
    } else {
        Vec3::Z
    }
}

/// Row of the finest level: unit normals, and heights in texture widths.
///
/// Planes, not structs, so that the loops over them become SIMD without being written as such.
#[derive(Clone, Debug)]
pub struct SurfaceRow {
    /// `n.x` of each texel.
    pub x: Vec<f32>,
    /// `n.y`, up.
    pub y: Vec<f32>,
    /// `n.z`, out of the surface.
    pub z: Vec<f32>,
    /// Height; zero where the map has none.
    pub height: Vec<f32>,
    /// Covariance of the slopes within each texel (xx, yy, xy), around the slope of its normal; empty where
    /// it is not known.
    pub spread: Vec<[f32; 3]>,
}

impl SurfaceRow {
    /// A flat row of `width` texels.
    #[must_use]
    pub fn flat(width: usize) -> Self {
        let zeros = vec![0.0; width];
        Self { x: zeros.clone(), y: zeros.clone(), z: vec![1.0; width], height: zeros, spread: Vec::new() }
    }

    /// Number of texels.
    #[must_use]
    pub fn width(&self) -> usize {
        self.x.len()
    }

    /// Unit normal of texel `i`.
    #[inline]
    #[must_use]
    pub fn normal(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// Sets the unit normal of texel `i`.
    #[inline]
    pub fn set_normal(&mut self, i: usize, n: Vec3) {
        (self.x[i], self.y[i], self.z[i]) = (n.x, n.y, n.z);
    }
}

/// The finest level of a map, read a row at a time so that no copy of it in floats need exist.
pub trait Surface: Send + Sync {
    /// Width and height in texels.
    fn size(&self) -> Size;

    /// Wrap of each axis, beyond the edges.
    fn wraps(&self) -> Wraps;

    /// Overwrites all of `row` (as wide as the map) with row `y`; its `spread` too, if only to clear it.
    fn read_row(&self, y: usize, row: &mut SurfaceRow);

    /// True when the heights mean something.
    fn has_height(&self) -> bool {
        false
    }

    /// Returns it with the slopes of the surface between its heights, where it can tell them.
    fn with_exact_slopes(&self) -> Option<Arc<dyn Surface>> {
        None
    }
}

/// A normal map of unit normals in memory.
#[derive(Clone, Debug)]
pub struct NormalGrid {
    /// Unit normals.
    pub normals: Grid<Vec3>,
    /// Wrap of each axis, beyond the edges.
    pub wraps: Wraps,
}

impl Surface for NormalGrid {
    fn size(&self) -> Size {
        self.normals.size()
    }

    fn wraps(&self) -> Wraps {
        self.wraps
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        for (i, n) in self.normals.row(y).iter().enumerate() {
            row.set_normal(i, *n);
        }
        row.height.fill(0.0);
    }
}

/// Filter that takes slopes from heights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SlopeFilter {
    /// `(h[i+1] - h[i-1]) / 2`: sharper, and what RenderMan's `txmake` does.
    #[default]
    CentralDifference,
    /// The 3×3 Sobel kernel: smooths across the derivative; OpenImageIO's default.
    Sobel,
    /// Slopes of the bilinear surface through the heights, which displaced meshes have: their mean and
    /// covariance over each texel, exactly.
    Bilinear,
}

/// Mean slope over a texel of the bilinear surface through the 3 × 3 heights around it, and the covariance
/// (xx, yy, xy), per texel; rows from above to below, y up.
///
/// A texel is a quarter each of the four cells between heights. In a cell, from the height h at its corner
/// on, the surface is `h + d a + e b + c a b`, so over the quarter `0 <= a, b <= 1/2` the slopes `d + c b`
/// and `e + c a` have means `d + c/4` and `e + c/4`, variances `c²/48` each, and are not correlated.
fn bilinear_slopes(heights: [[f32; 3]; 3]) -> (Vec2, [f32; 3]) {
    let [_, [_, middle, _], _] = heights;
    let mut quarters = [Vec2::ZERO; 4];
    let mut within = 0.0;
    for (k, quarter) in quarters.iter_mut().enumerate() {
        let (i, j) = (2 * (k % 2), 2 * (k / 2));
        let (d, e) = (heights[1][i] - middle, heights[j][1] - middle);
        let c = heights[j][i] - heights[1][i] - heights[j][1] + middle;
        // To the left and below, the cell's own axes run against the frame's.
        let signs = Vec2::new(i as f32 - 1.0, 1.0 - j as f32);
        *quarter = Vec2::new(d + c / 4.0, e + c / 4.0) * signs;
        within += c * c / 48.0 / 4.0;
    }
    let mean = quarters.iter().sum::<Vec2>() / 4.0;
    let mut covariance = [within, within, 0.0];
    for strays in quarters.map(|q| q - mean) {
        let products = [strays.x * strays.x, strays.y * strays.y, strays.x * strays.y];
        covariance.iter_mut().zip(products).for_each(|(sum, p)| *sum += p / 4.0);
    }
    (mean, covariance)
}

/// A height map, with slopes taken when read.
#[derive(Clone, Debug)]
pub struct HeightField {
    /// Heights in units of the texture's width.
    pub heights: Grid<f32>,
    /// Wrap of each axis, beyond the edges; also used for the slopes there.
    pub wraps: Wraps,
    /// Filter that takes the slopes.
    pub filter: SlopeFilter,
}

impl Surface for HeightField {
    fn size(&self) -> Size {
        self.heights.size()
    }

    fn wraps(&self) -> Wraps {
        self.wraps
    }

    fn has_height(&self) -> bool {
        true
    }

    fn with_exact_slopes(&self) -> Option<Arc<dyn Surface>> {
        Some(Arc::new(Self { filter: SlopeFilter::Bilinear, ..self.clone() }))
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        let Size { width, height } = self.size();
        let line = |dy: isize| self.heights.row(self.wraps.y.index(y as isize + dy, height));
        let (above, here, below) = (line(-1), line(0), line(1));
        // A texel is 1/width of the texture's width across, on both axes.
        let per_texel = width as f32;
        row.spread.clear();
        let mut set = |i: usize, l: usize, r: usize| {
            let slope = match self.filter {
                SlopeFilter::CentralDifference => Vec2::new(here[r] - here[l], above[i] - below[i]) * 0.5,
                SlopeFilter::Sobel => {
                    let dx = (above[r] - above[l]) + 2.0 * (here[r] - here[l]) + (below[r] - below[l]);
                    let dy = (above[l] - below[l]) + 2.0 * (above[i] - below[i]) + (above[r] - below[r]);
                    Vec2::new(dx, dy) * 0.125
                }
                SlopeFilter::Bilinear => {
                    let around = [above, here, below].map(|row| [row[l], row[i], row[r]]);
                    let (slope, spread) = bilinear_slopes(around);
                    row.spread.push(spread.map(|s| s * per_texel * per_texel));
                    slope
                }
            } * per_texel;
            row.set_normal(i, normal_of_slope(slope));
        };
        let edge = |i: isize| self.wraps.x.index(i, width);
        set(0, edge(-1), edge(1));
        for i in 1..width.saturating_sub(1) {
            set(i, i - 1, i + 1);
        }
        if width > 1 {
            let last = width as isize - 1;
            set(width - 1, edge(last - 1), edge(last + 1));
        }
        row.height.copy_from_slice(here);
    }
}

/// Signed measure of how well a map's slopes are the gradient of *some* height: 1 for a perfect gradient
/// field, near 0 when nothing can be said (noise, a UV atlas), negative when y points the other way.
///
/// The mixed derivatives of a height agree, so slope.x differentiated along y and slope.y along x
/// are correlated over all texels whose normals stay clear of the horizon (n.z > 0.15).
#[must_use]
pub fn integrability(surface: &dyn Surface) -> f64 {
    let Size { width, height } = surface.size();
    if width < 3 || height < 3 {
        return 0.0;
    }
    let mut rows: Vec<SurfaceRow> = (0..3).map(|_| SurfaceRow::flat(width)).collect();
    for (y, row) in rows.iter_mut().enumerate() {
        surface.read_row(y, row);
    }
    let (mut xy, mut xx, mut yy) = (0.0_f64, 0.0_f64, 0.0_f64);
    for y in 1..height - 1 {
        let [above, here, below] = [0, 1, 2].map(|k| &rows[(y - 1 + k) % 3]);
        for i in 1..width - 1 {
            let around = [above.normal(i), below.normal(i), here.normal(i - 1), here.normal(i + 1)];
            if around.iter().all(|n| n.z > 0.15) {
                let [a, b, l, r] = around.map(slope_of_normal);
                let (dp_dy, dq_dx) = (f64::from(a.x - b.x), f64::from(r.y - l.y));
                xy += dp_dy * dq_dx;
                xx += dp_dy * dp_dy;
                yy += dq_dx * dq_dx;
            }
        }
        if y + 2 < height {
            surface.read_row(y + 2, &mut rows[(y + 2) % 3]);
        }
    }
    let norm = (xx * yy).sqrt();
    if norm > 0.0 { xy / norm } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::TAU;

    fn wave(size: Size) -> HeightField {
        let h = |x: usize, y: usize| {
            let (u, v) = ((x as f32 + 0.5) / size.width as f32, (y as f32 + 0.5) / size.width as f32);
            0.01 * (TAU * (2.0 * u - v)).sin()
        };
        HeightField {
            heights: Grid::from_fn(size, h),
            wraps: Wraps::default(),
            filter: SlopeFilter::default(),
        }
    }

    #[test]
    fn slopes_of_a_wave_match_its_derivative() {
        let size = Size::new(256, 256).unwrap();
        for filter in [SlopeFilter::CentralDifference, SlopeFilter::Sobel] {
            let surface = HeightField { filter, ..wave(size) };
            let mut row = SurfaceRow::flat(size.width);
            surface.read_row(0, &mut row);
            for i in [0, 1, 100, 255] {
                let (u, v) = ((i as f32 + 0.5) / 256.0, 0.5 / 256.0);
                let c = 0.01 * TAU * (TAU * (2.0 * u - v)).cos();
                let got = slope_of_normal(row.normal(i));
                // v runs down, y runs up: dh/dy = -dh/dv. Central differences of a wave of 128
                // texels err by (2 pi / 128)² / 6 = 0.04 %, Sobel's smoothing by twice that.
                let expected = Vec2::new(2.0 * c, c);
                assert!((got - expected).length() < 2e-3 * 0.14, "{filter:?} at {i}: {got} for {expected}");
            }
        }
    }

    #[test]
    fn bilinear_slopes_are_those_of_the_surface_between_the_heights() {
        // Known answer: the mean over many places of a texel of the surface's own differences.
        let heights = [[0.3, -0.1, 0.25], [0.7, 0.2, -0.4], [0.05, 0.6, 0.1_f32]];
        // At (x, y) from the middle texel, y up, each -1 to 1.
        let height = |x: f64, y: f64| {
            let pair = |t: f64| if t < 0.0 { (0, t + 1.0) } else { (1, t) };
            let ((i, s), (j, t)) = (pair(x), pair(-y));
            let h = |i: usize, j: usize| f64::from(heights[j][i]);
            (h(i, j) * (1.0 - s) + h(i + 1, j) * s) * (1.0 - t)
                + (h(i, j + 1) * (1.0 - s) + h(i + 1, j + 1) * s) * t
        };
        let n = 64;
        let at = |k: usize| (k as f64 + 0.5) / f64::from(n as u32) - 0.5;
        let slope = |x: f64, y: f64| {
            let step = 1e-5;
            let d = |a: f64, b: f64| (a - b) / (2.0 * step);
            (d(height(x + step, y), height(x - step, y)), d(height(x, y + step), height(x, y - step)))
        };
        let all: Vec<(f64, f64)> = (0..n * n).map(|k| slope(at(k % n), at(k / n))).collect();
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| all.iter().map(f).sum::<f64>() / all.len() as f64;
        let (x, y) = (mean(&|s| s.0), mean(&|s| s.1));
        let expected = [
            x,
            y,
            mean(&|s| (s.0 - x).powi(2)),
            mean(&|s| (s.1 - y).powi(2)),
            mean(&|s| (s.0 - x) * (s.1 - y)),
        ];
        let (got, [xx, yy, xy]) = bilinear_slopes(heights);
        for (got, expected) in [got.x, got.y, xx, yy, xy].into_iter().zip(expected) {
            // The midpoint rule over 64 × 64 places errs by 1/(12 × 64²) of the slopes' own change, which is
            // of order 1.
            assert!((f64::from(got) - expected).abs() < 2e-4, "{got} for {expected}");
        }
    }

    #[test]
    fn clamp_and_repeat_differ_at_the_edge_only() {
        let size = Size::new(8, 8).unwrap();
        let ramp = |wrap| HeightField {
            heights: Grid::from_fn(size, |x, _| x as f32 / 8.0),
            wraps: Wraps { x: wrap, y: wrap },
            filter: SlopeFilter::CentralDifference,
        };
        let mut row = SurfaceRow::flat(8);
        ramp(Wrap::Clamp).read_row(3, &mut row);
        assert!((slope_of_normal(row.normal(0)).x - 0.5).abs() < 1e-6);
        assert!((slope_of_normal(row.normal(4)).x - 1.0).abs() < 1e-6);
        ramp(Wrap::Repeat).read_row(3, &mut row);
        assert!((slope_of_normal(row.normal(0)).x + 3.0).abs() < 1e-5);
    }

    #[test]
    fn integrability_tells_up_from_down() {
        let size = Size::new(64, 64).unwrap();
        let up = wave(size);
        assert!(integrability(&up) > 0.999);
        let mut row = SurfaceRow::flat(64);
        let normals = (0..64).flat_map(|y| {
            up.read_row(y, &mut row);
            (0..64).map(|i| row.normal(i) * Vec3::new(1.0, -1.0, 1.0)).collect::<Vec<_>>()
        });
        let normals = Grid::from_vec(size, normals.collect()).unwrap();
        let down = NormalGrid { normals, wraps: Wraps::default() };
        assert!(integrability(&down) < -0.999);
    }

    #[test]
    fn vectors_that_are_no_direction_point_up() {
        for v in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e30)] {
            assert_eq!(unit_or_up(v), Vec3::Z);
        }
        assert!((unit_or_up(Vec3::new(-1.0, -1.0, -1.0)).length() - 1.0).abs() < 1e-6);
        assert_eq!(slope_of_normal(Vec3::NEG_X), Vec2::new(MAX_SLOPE, 0.0));
        assert_eq!(slope_of_normal(Vec3::new(0.0, 0.0, -1.0)), Vec2::ZERO);
    }

    #[test]
    fn one_texel_surfaces_read() {
        for (w, h) in [(1, 1), (1, 5), (5, 1), (2, 2)] {
            let size = Size::new(w, h).unwrap();
            let field = wave(size);
            let mut row = SurfaceRow::flat(w);
            for y in 0..h {
                field.read_row(y, &mut row);
                assert!(row.z.iter().all(|z| *z > 0.0));
            }
        }
    }
}
