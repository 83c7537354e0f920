//! FLIP, the difference that a viewer perceives when two pictures alternate on a screen.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images" (Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020), for pictures of low dynamic
//! range. Two pipelines look at every pixel: one at colours, blurred as the eye blurs them, the other at
//! edges and points. Constants have the paper's values; their docs name its symbols.
//!
//! Channels here are light over white's. The paper's YCxCz are multiples of them, and an offset; blurs, whose
//! weights add up to 1, and derivatives, whose weights add up to 0, do not see the difference.

use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::LazyLock;

use glam::{DMat3, DVec2, DVec3};
use ndfmap_core::grid::{Grid, Size};

use super::{Picture, by_rows, to_bytes};

/// Pixels a degree of the visual angle.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct PixelsPerDegree(f64);

impl PixelsPerDegree {
    /// Screen of 3840 pixels in a row, seen from as far as it is wide (0.7 m): `3840 pi / 180`, about 67.02.
    pub const SCREEN: Self = Self(3840.0 * PI / 180.0);

    /// The number itself.
    #[must_use]
    pub fn get(self) -> f64 {
        self.0
    }
}

/// Mean of [`flip_map`].
///
/// # Panics
/// When the pictures differ in size.
#[must_use]
pub fn flip(picture: &Picture, truth: &Picture, exposure: f32) -> f64 {
    FlipTruth::new(truth, exposure).mean(picture)
}

/// FLIP of every pixel, 0 to 1, between display values in 8 bits on a [`PixelsPerDegree::SCREEN`]. It is
/// symmetric, and the same bits for any number of threads.
///
/// # Panics
/// When the pictures differ in size.
#[must_use]
pub fn flip_map(picture: &Picture, truth: &Picture, exposure: f32) -> Grid<f32> {
    FlipTruth::new(truth, exposure).map(picture)
}

/// A true picture, as the eye sees it: many pictures are compared with it in half the time.
pub struct FlipTruth {
    exposure: f32,
    seen: Seen,
}

/// The eye before a [`PixelsPerDegree::SCREEN`].
static EYE: LazyLock<Eye> = LazyLock::new(|| Eye::new(PixelsPerDegree::SCREEN));

impl FlipTruth {
    /// Looks at the truth.
    #[must_use]
    pub fn new(truth: &Picture, exposure: f32) -> Self {
        Self { exposure, seen: EYE.see(&to_bytes(truth, exposure)) }
    }

    /// [`flip_map`] of a picture.
    ///
    /// # Panics
    /// When its size is another.
    #[must_use]
    pub fn map(&self, picture: &Picture) -> Grid<f32> {
        let b = &self.seen;
        assert_eq!(picture.size(), b.colours.size(), "pictures that are compared have one size");
        let a = EYE.see(&to_bytes(picture, self.exposure));
        by_rows(picture.size(), |y, row| {
            let colour = a.colours.row(y).iter().zip(b.colours.row(y)).map(|(a, b)| EYE.colour_error(*a, *b));
            let feature = a.features.row(y).iter().zip(b.features.row(y)).map(|(a, b)| feature_error(*a, *b));
            for (error, (colour, feature)) in row.iter_mut().zip(colour.zip(feature)) {
                *error = colour.powf(1.0 - feature) as f32;
            }
        })
    }

    /// [`flip`] of a picture.
    ///
    /// # Panics
    /// When its size is another.
    #[must_use]
    pub fn mean(&self, picture: &Picture) -> f64 {
        let map = self.map(picture);
        map.texels().iter().map(|e| f64::from(*e)).sum::<f64>() / map.texels().len() as f64
    }
}

/// Exponent of colour distances, `q_c`.
const COLOUR_EXPONENT: f64 = 0.7;

/// Part of the greatest colour distance, `p_c`, that is an error of [`KNEE_ERROR`].
const KNEE: f64 = 0.4;

/// Error of the knee, `p_t`.
const KNEE_ERROR: f64 = 0.95;

/// Width of the features that the eye finds, `w`, in degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Gaussian of degrees `x`: `a sqrt(pi / b) exp(-pi² x² / b)`.
struct Gaussian {
    a: f64,
    b: f64,
}

/// The eye's contrast sensitivity in each opponent channel, sums of Gaussians: light, red against green,
/// yellow against blue.
const SENSITIVITIES: [&[Gaussian]; 3] = [
    &[Gaussian { a: 1.0, b: 0.0047 }],
    &[Gaussian { a: 1.0, b: 0.0053 }],
    &[Gaussian { a: 34.1, b: WIDEST }, Gaussian { a: 13.5, b: 0.025 }],
];

/// Greatest `b` of these Gaussians; all are cut off at three times its standard deviation.
const WIDEST: f64 = 0.04;

/// Weights along a line, around its middle.
type Kernel = Vec<f64>;

/// Kernels that find features.
struct FeatureKernels {
    gaussian: Kernel,
    /// First derivative.
    edge: Kernel,
    /// Second derivative.
    point: Kernel,
}

/// Filters and colour spaces of the eye.
struct Eye {
    /// Light of display values in 8 bits.
    light: Vec<f64>,
    /// Linear RGB to XYZ over white's.
    xyz: DMat3,
    /// Linear RGB to opponent channels: Y, X - Y and Y - Z of XYZ over white's.
    opponents: DMat3,
    /// Blur of each opponent channel: the sum of these kernels, each along rows and along columns.
    blurs: [Vec<Kernel>; 3],
    features: FeatureKernels,
    /// Greatest distance of colours, `c_max`, that between sRGB's green and blue.
    greatest: f64,
}

/// Picture as the eye sees it.
struct Seen {
    /// Blurred colours, as [`lightness_and_chroma`] has them.
    colours: Grid<DVec3>,
    /// Strengths of edges and of points.
    features: Grid<DVec2>,
}

impl Eye {
    fn new(density: PixelsPerDegree) -> Self {
        let xyz = xyz_over_white();
        let [x, y, z] = [0, 1, 2].map(|i| xyz.row(i));
        let [green, blue] = [DVec3::Y, DVec3::Z].map(|c| lightness_and_chroma(xyz * c));
        Self {
            light: (0..=255).map(|v| light(f64::from(v) / 255.0)).collect(),
            xyz,
            opponents: DMat3::from_cols(y, x - y, y - z).transpose(),
            blurs: SENSITIVITIES.map(|s| blur_kernels(s, density)),
            features: FeatureKernels::new(density),
            greatest: colour_distance(green, blue),
        }
    }

    fn see(&self, picture: &Grid<[u8; 3]>) -> Seen {
        let size = picture.size();
        let linear = |c: &[u8; 3]| DVec3::from_array(c.map(|v| self.light[usize::from(v)]));
        let opponents: [Grid<f64>; 3] = [0, 1, 2].map(|i| {
            let channel = self.opponents.row(i);
            by_rows(size, |y, row| {
                row.iter_mut().zip(picture.row(y)).for_each(|(v, c)| *v = channel.dot(linear(c)));
            })
        });
        Seen { colours: self.colours(&opponents), features: self.features.strengths(&opponents[0]) }
    }

    fn colours(&self, opponents: &[Grid<f64>; 3]) -> Grid<DVec3> {
        let (size, back) = (opponents[0].size(), self.opponents.inverse());
        // Blurred along rows; along columns below.
        let blurred: [Vec<Grid<f64>>; 3] =
            [0, 1, 2].map(|i| self.blurs[i].iter().map(|kernel| along_rows(&opponents[i], kernel)).collect());
        by_rows(size, |y, row: &mut [DVec3]| {
            for (i, blurred) in blurred.iter().enumerate() {
                for (grid, kernel) in blurred.iter().zip(&self.blurs[i]) {
                    let channel = along_columns(grid, kernel, y);
                    row.iter_mut().zip(channel).for_each(|(colour, v)| colour[i] += v);
                }
            }
            for colour in row {
                let rgb = (back * *colour).clamp(DVec3::ZERO, DVec3::ONE);
                *colour = lightness_and_chroma(self.xyz * rgb);
            }
        })
    }

    /// Error of colours, 0 to 1: small distances spread up to the knee, great ones between it and 1.
    fn colour_error(&self, a: DVec3, b: DVec3) -> f64 {
        let (distance, knee) = (colour_distance(a, b), KNEE * self.greatest);
        if distance < knee {
            KNEE_ERROR * distance / knee
        } else {
            KNEE_ERROR + (1.0 - KNEE_ERROR) * (distance - knee) / (self.greatest - knee)
        }
    }
}

impl FeatureKernels {
    fn new(density: PixelsPerDegree) -> Self {
        let deviation = FEATURE_WIDTH / 2.0 * density.get();
        let kernel = |weight: fn(f64) -> f64| -> Kernel {
            line(3.0 * deviation).map(|x| x / deviation).map(|x| weight(x) * (-x * x / 2.0).exp()).collect()
        };
        Self {
            gaussian: balanced(kernel(|_| 1.0)),
            edge: balanced(kernel(|x| -x)),
            point: balanced(kernel(|x| x * x - 1.0)),
        }
    }

    /// Lengths of the two derivatives along rows and columns, of edges and of points.
    fn strengths(&self, light: &Grid<f64>) -> Grid<DVec2> {
        let Self { gaussian, edge, point } = self;
        let [smooth, edges, points] = [gaussian, edge, point].map(|kernel| along_rows(light, kernel));
        by_rows(light.size(), |y, row| {
            let lengths = |across: &Grid<f64>, kernel: &Kernel| {
                let (along_x, along_y) =
                    (along_columns(across, gaussian, y), along_columns(&smooth, kernel, y));
                along_x.into_iter().zip(along_y).map(|(x, y)| (x * x + y * y).sqrt())
            };
            let both = lengths(&edges, edge).zip(lengths(&points, point));
            row.iter_mut().zip(both).for_each(|(strengths, (e, p))| *strengths = DVec2::new(e, p));
        })
    }
}

/// Error of features, 0 to 1, with exponent `q_f`, a half: by edges or points, whichever differ more.
fn feature_error(a: DVec2, b: DVec2) -> f64 {
    (FRAC_1_SQRT_2 * (a - b).abs().max_element()).sqrt()
}

/// Distance of colours by Abasi et al.'s HyAB, to the power of [`COLOUR_EXPONENT`].
fn colour_distance(a: DVec3, b: DVec3) -> f64 {
    let chroma = DVec2::new(a.y - b.y, a.z - b.z).length();
    ((a.x - b.x).abs() + chroma).powf(COLOUR_EXPONENT)
}

/// CIELAB (CIE 15) of XYZ over white's, with chroma less in the dark, by Hunt's effect.
fn lightness_and_chroma(xyz: DVec3) -> DVec3 {
    const LINEAR: f64 = 6.0 / 29.0;
    let root = |t: f64| {
        if t > LINEAR * LINEAR * LINEAR { t.cbrt() } else { t / (3.0 * LINEAR * LINEAR) + 4.0 / 29.0 }
    };
    let [x, y, z] = xyz.to_array().map(root);
    let lightness = 116.0 * y - 16.0;
    DVec3::new(lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z))
}

/// Light of a display value: sRGB's curve (IEC 61966-2-1), the other way.
fn light(display: f64) -> f64 {
    if display <= 0.040_45 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) }
}

/// Linear sRGB to XYZ over white's, from the chromaticities of its primaries and of D65 (ITU-R BT.709; CIE 15
/// has white's to five digits).
fn xyz_over_white() -> DMat3 {
    let at = |x: f64, y: f64| DVec3::new(x, y, 1.0 - x - y);
    let primaries = DMat3::from_cols(at(0.64, 0.33), at(0.30, 0.60), at(0.15, 0.06));
    let white = at(0.312_71, 0.329_02);
    let amounts = primaries.inverse() * white;
    DMat3::from_diagonal(white.recip()) * primaries * DMat3::from_diagonal(amounts)
}

/// Kernels of a blur by these Gaussians. All weights of the blur add up to 1, those of a kernel along both
/// axes to its Gaussian's part of that.
fn blur_kernels(gaussians: &[Gaussian], density: PixelsPerDegree) -> Vec<Kernel> {
    let radius = 3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * density.get();
    let kernel = |Gaussian { a, b }: &Gaussian| -> Kernel {
        let height = (a * (PI / b).sqrt()).sqrt();
        line(radius).map(|x| x / density.get()).map(|x| height * (-PI * PI * x * x / b).exp()).collect()
    };
    let mut kernels: Vec<Kernel> = gaussians.iter().map(kernel).collect();
    let whole: f64 = kernels.iter().map(|k| k.iter().sum::<f64>().powi(2)).sum();
    kernels.iter_mut().flatten().for_each(|weight| *weight /= whole.sqrt());
    kernels
}

/// Pixels from the middle of a kernel that reaches at least this far.
fn line(radius: f64) -> impl Iterator<Item = f64> {
    let radius = radius.ceil() as i32;
    (-radius..=radius).map(f64::from)
}

/// The same kernel with positive weights that add up to 1, and negative ones to -1.
fn balanced(kernel: Kernel) -> Kernel {
    let sum = |sign: f64| kernel.iter().map(|w| (sign * w).max(0.0)).sum::<f64>();
    let (positive, negative) = (sum(1.0), sum(-1.0));
    kernel.into_iter().map(|w| if w > 0.0 { w / positive } else { w / negative }).collect()
}

/// Grid, filtered along its rows; its outermost pixels go on beyond it.
fn along_rows(grid: &Grid<f64>, kernel: &Kernel) -> Grid<f64> {
    let (width, radius) = (grid.size().width, kernel.len() / 2);
    by_rows(grid.size(), |y, sums| {
        let row = grid.row(y);
        let wide = [&vec![row[0]; radius], row, &vec![row[width - 1]; radius]].concat();
        weighted(sums, &wide.windows(width).collect::<Vec<_>>(), kernel);
    })
}

/// Row `y` of a grid filtered along its columns; its outermost pixels go on beyond it.
fn along_columns(grid: &Grid<f64>, kernel: &Kernel, y: usize) -> Vec<f64> {
    let (Size { width, height }, radius) = (grid.size(), kernel.len() / 2);
    let rows = (y..y + kernel.len()).map(|below| grid.row(below.saturating_sub(radius).min(height - 1)));
    let mut sums = vec![0.0; width];
    weighted(&mut sums, &rows.collect::<Vec<_>>(), kernel);
    sums
}

/// Sums of rows, each times its weight.
fn weighted(sums: &mut [f64], rows: &[&[f64]], kernel: &Kernel) {
    // Pixels at a time: few enough that their sums stay in registers.
    const STEP: usize = 16;
    let (steps, rest) = sums.as_chunks_mut::<STEP>();
    let done = steps.len() * STEP;
    for (at, sums) in steps.iter_mut().enumerate() {
        let mut step = [0.0; STEP];
        for (row, weight) in rows.iter().zip(kernel) {
            for (sum, v) in step.iter_mut().zip(&row.as_chunks::<STEP>().0[at]) {
                *sum += weight * v;
            }
        }
        *sums = step;
    }
    for (row, weight) in rows.iter().zip(kernel) {
        for (sum, v) in rest.iter_mut().zip(&row[done..]) {
            *sum += weight * v;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_an_edge_of_its_height() {
        // Beside a step all positive weights lie on one side of it, and all negative ones on the other.
        let size = Size { width: 40, height: 3 };
        let step = Grid::from_fn(size, |x, _| if x < 20 { 0.2 } else { 0.9 });
        let strengths = FeatureKernels::new(PixelsPerDegree::SCREEN).strengths(&step);
        // Forty roundings of double precision.
        let near = |a: f64, b: f64| (a - b).abs() < 4e-15;
        for y in 0..size.height {
            let row = strengths.row(y);
            assert!(near(row[19].x, 0.7) && near(row[20].x, 0.7), "{} {}", row[19].x, row[20].x);
            assert!(near(row[19].y, row[20].y) && row[19].y > 0.1, "{} {}", row[19].y, row[20].y);
            // Kernels reach nine pixels: three times 0.041 degrees.
            assert!(near(row[10].length(), 0.0) && row[11].x > 1e-3, "{} {}", row[10], row[11]);
        }
    }
}
