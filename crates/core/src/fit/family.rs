//! Kinds of lobe that are fitted, as exponential families of any number of sufficient statistics.
//!
//! A lobe's *sums* are the weighted means of the statistics `(1, T(n))` over the normals it answers for. They
//! mix by plain averaging and are all that an M-step needs, which is why a texel stores them. An E-step needs
//! `log(alpha g(n))`, for every family a linear function of the same statistics, `theta · (1, T(n))`: N
//! multiplications and an exponential a lobe.

use glam::Vec3;

use super::Level;
use super::coherent::PriorContext;
use super::refine::LevelLobes;
use super::samples::SampleGrid;

/// Weight below which a lobe is dead: nothing is divided by it.
pub(crate) const DEAD: f32 = 1e-7;

/// Least variance of a lobe on one axis while fitting: what rounding to 8 bits leaves, `(2/255)²/12`.
///
/// Without it a lobe on equal normals would be infinitely likely.
pub(crate) const LEAST_VARIANCE: f32 = 5e-6;

/// Largest variance of a lobe on one axis; wider is as good as uniform.
pub(crate) const MOST_VARIANCE: f32 = 0.6;

/// `theta` of a lobe that no normal should choose.
const NOWHERE: f32 = -60.0;

/// A decoded lobe.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shape {
    pub(crate) alpha: f32,
    /// Mean: on the sphere a unit vector, in the plane `(x, y, 0)`.
    pub(crate) mean: [f32; 3],
    /// Variance on one axis: `1/kappa` on the sphere.
    pub(crate) variance: f32,
    /// Length `|r|` of the mean on the sphere, which follows from the variance and is costly to work out; not
    /// used in the plane.
    pub(crate) length: f32,
}

/// Half the squared distance of two means: `1 - cos` on the sphere.
pub(crate) fn gap(a: &Shape, b: &Shape) -> f32 {
    0.5 * (0..3).map(|k| (a.mean[k] - b.mean[k]).powi(2)).sum::<f32>()
}

/// Derivatives by the parameters of a [`Shape`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ShapeSlope {
    pub(crate) alpha: f32,
    pub(crate) mean: [f32; 3],
    pub(crate) variance: f32,
}

/// `theta · (1, T)`, the logarithm of a weighted lobe's density.
#[inline(always)]
pub(crate) fn log_density<const N: usize>(theta: &[f32; N], t: &[f32; N]) -> f32 {
    let mut log = theta[0];
    for s in 1..N {
        log += theta[s] * t[s];
    }
    log
}

/// Exponential family of lobes with N statistics, the first of them one.
///
/// Sums are the weight, then N - 1 statistics times the weight. [`Isotropic`] makes a family of four
/// statistics from any lobe with a mean and one variance.
pub(crate) trait Family<const N: usize>: Copy + Send + Sync {
    /// `(1, T(n))`.
    fn statistics(self, n: Vec3) -> [f32; N];

    /// `theta` of the weighted lobe with these sums.
    fn natural(self, sums: &[f32; N]) -> [f32; N];

    /// Mean of the lobe with these sums, in the space in which lobes of neighbours are matched.
    fn mean(self, sums: &[f32; N]) -> [f32; 3];

    /// Variance of the lobe with these sums, on one axis.
    fn width(self, sums: &[f32; N]) -> f32;

    /// Moves the lobes of a level towards the least error that is seen; does nothing for a family that
    /// cannot.
    fn refine(self, _grid: &SampleGrid<N>, _level: &mut LevelLobes<'_, N>, _rounds: usize) {}

    /// EM with the papers' prior for the texels of a level; plain EM, for a family that has no prior.
    fn fit_with_prior(self, context: &PriorContext<'_, N>, level: &mut Level<N>) {
        super::coherent::without_prior(self, context, level);
    }
}

/// Lobe around a mean with one variance on every axis: four statistics.
pub(crate) trait Isotropic: Copy + Send + Sync {
    /// Statistics that tell the mean normal, the weight among them: the first of all.
    const OF_MEAN: usize;

    /// True where an E-step weighs lobes by their share, as that of a mixture must.
    const WEIGHED: bool = true;

    /// `T(n)`.
    fn sufficient(self, n: Vec3) -> [f32; 3];

    /// A lobe of this weight, with its mean and variance brought into their ranges.
    fn shape(self, alpha: f32, mean: [f32; 3], variance: f32) -> Shape;

    /// Shape that sums stand for; finite whatever they are.
    fn decode(self, sums: &[f32; 4]) -> Shape;

    /// The sums of a lobe.
    fn encode(self, shape: &Shape) -> [f32; 4];

    /// `theta` of a unit lobe around `mean` with this variance.
    fn unit_natural(self, mean: &[f32; 3], variance: f32) -> [f32; 4];

    /// The unweighted mean of `n` in sums, as [`Shape::mean`] counts it: `Σ w n`.
    fn first_moment(self, sums: &[f32; 4]) -> [f32; 3];

    /// `Σ w (half the squared distance of n to mean)` from sums.
    fn spread(self, sums: &[f32; 4], mean: &[f32; 3]) -> f32;

    /// A derivative by the lobe's parameters as one by its sums.
    fn slope_of_sums(self, shape: &Shape, slope: &ShapeSlope) -> [f32; 4];

    /// A derivative by sums as one by the lobe's own `(ln alpha, mean, variance)`.
    fn slope_of_shape(self, shape: &Shape, slope: &[f32; 4]) -> ShapeSlope;

    /// The mean of the paper's prior: this lobe drawn towards `Σ alpha_k mu_k` of its neighbours, of total
    /// weight `weight`, by `strength`; `count` is the number of normals under the texel.
    fn with_prior(self, sums: &[f32; 4], pull: &Pull) -> [f32; 4];

    /// Sums of a shape as they are stored: a lobe that ended at the least variance is stored with variance 0,
    /// since its own cannot be told.
    fn settle(self, shape: &Shape) -> [f32; 4] {
        // Through single-precision sums it comes back with an error of about 1 %.
        if shape.variance > 1.05 * LEAST_VARIANCE {
            return self.encode(shape);
        }
        self.encode(&Shape { variance: 0.0, length: 1.0, ..*shape })
    }
}

impl<F: Isotropic> Family<4> for F {
    #[inline(always)]
    fn statistics(self, n: Vec3) -> [f32; 4] {
        let [a, b, c] = self.sufficient(n);
        [1.0, a, b, c]
    }

    fn natural(self, sums: &[f32; 4]) -> [f32; 4] {
        if sums[0] <= DEAD {
            return [NOWHERE, 0.0, 0.0, 0.0];
        }
        let shape = self.decode(sums);
        let mut theta = self.unit_natural(&shape.mean, shape.variance);
        if F::WEIGHED {
            theta[0] += shape.alpha.ln();
        }
        theta
    }

    fn mean(self, sums: &[f32; 4]) -> [f32; 3] {
        self.decode(sums).mean
    }

    fn width(self, sums: &[f32; 4]) -> f32 {
        self.decode(sums).variance
    }

    fn refine(self, grid: &SampleGrid<4>, level: &mut LevelLobes<'_, 4>, rounds: usize) {
        super::refine::refine(self, grid, level, rounds);
    }

    fn fit_with_prior(self, context: &PriorContext<'_, 4>, level: &mut Level<4>) {
        super::coherent::with_prior(self, context, level);
    }
}

/// Pull of a prior: the neighbours that it draws a lobe towards.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pull {
    /// `Σ alpha_k` of the neighbours.
    pub(crate) weight: f32,
    /// `Σ alpha_k mu_k`.
    pub(crate) mean: [f32; 3],
    /// The paper's `c` or `C`.
    pub(crate) strength: f32,
    /// Normals under the texel.
    pub(crate) count: f32,
}

pub(crate) fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit_or_up(v: [f32; 3]) -> [f32; 3] {
    let length = dot(&v, &v).sqrt();
    if length > 1e-9 { v.map(|c| c / length) } else { [0.0, 0.0, 1.0] }
}

/// Von Mises-Fisher lobes on the sphere (Han et al. 2007, section 6): `T(n) = (n.x, n.y, 1 - n.z)`. As
/// PRINTED, the E-step has no weights (Algorithm 1, line 5), and the prior's `C` counts no normals (equation
/// 23).
///
/// The third statistic is counted from the pole, where most normals are and where `|r|` near 1 needs the
/// digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spherical<const PRINTED: bool>;

/// `1/kappa` of a mean of length r: Banerjee et al.'s `kappa = (3r - r³)/(1 - r²)`, inverted.
fn variance_of_length(r: f32) -> f32 {
    (1.0 - r * r) / (r * (3.0 - r * r))
}

/// Derivative of `variance_of_length`.
fn variance_slope(r: f32) -> f32 {
    let (n, d) = (1.0 - r * r, 3.0 * r - r * r * r);
    (-2.0 * r * d - n * (3.0 - 3.0 * r * r)) / (d * d)
}

/// The length of the mean for a variance: Newton's method from the first two terms of the series at 1.
fn length_of_variance(variance: f32) -> f32 {
    let v = variance.min(MOST_VARIANCE);
    let mut r = (1.0 - v - 0.5 * v * v).max(0.2);
    // One step leaves 1e-6 where the series holds; farther out it takes four.
    for _ in 0..if v < 0.1 { 1 } else { 4 } {
        r = (r - (variance_of_length(r) - v) / variance_slope(r)).clamp(0.05, 1.0);
    }
    r
}

/// `1 - z` of a unit vector without cancelling near the pole.
pub(crate) fn from_pole(m: &[f32; 3]) -> f32 {
    if m[2] > 0.0 { (m[0] * m[0] + m[1] * m[1]) / (1.0 + m[2]) } else { 1.0 - m[2] }
}

impl<const PRINTED: bool> Isotropic for Spherical<PRINTED> {
    const OF_MEAN: usize = 4;
    const WEIGHED: bool = !PRINTED;

    #[inline(always)]
    fn sufficient(self, n: Vec3) -> [f32; 3] {
        [n.x, n.y, from_pole(&n.to_array())]
    }

    fn shape(self, alpha: f32, mean: [f32; 3], variance: f32) -> Shape {
        let variance = variance.clamp(LEAST_VARIANCE, MOST_VARIANCE);
        Shape { alpha, mean: unit_or_up(mean), variance, length: length_of_variance(variance) }
    }

    fn decode(self, &[alpha, x, y, w]: &[f32; 4]) -> Shape {
        if alpha <= DEAD {
            return self.shape(0.0, [0.0, 0.0, 1.0], LEAST_VARIANCE);
        }
        let (x, y, w) = (x / alpha, y / alpha, w / alpha);
        // 1 - |r|² of r = (x, y, 1 - w).
        let short = (2.0 * w - w * w - x * x - y * y).clamp(0.0, 0.999);
        let length = (1.0 - short).sqrt();
        let variance = short / (length * (3.0 - length * length));
        if (LEAST_VARIANCE..=MOST_VARIANCE).contains(&variance) {
            return Shape { alpha, mean: unit_or_up([x, y, 1.0 - w]), variance, length };
        }
        self.shape(alpha, [x, y, 1.0 - w], variance)
    }

    fn encode(self, s: &Shape) -> [f32; 4] {
        let r = s.length;
        [
            s.alpha,
            s.alpha * r * s.mean[0],
            s.alpha * r * s.mean[1],
            s.alpha * ((1.0 - r) + r * from_pole(&s.mean)),
        ]
    }

    fn unit_natural(self, m: &[f32; 3], variance: f32) -> [f32; 4] {
        // kappa/(2 pi (1 - e^{-2 kappa})) e^{kappa (n·mu - 1)}; the second factor is 1 in single floats above
        // 10.
        let kappa = variance.recip();
        let scale =
            if kappa > 10.0 { kappa } else { kappa / -(-2.0 * kappa).exp_m1() } / std::f32::consts::TAU;
        [scale.ln() - kappa * from_pole(m), kappa * m[0], kappa * m[1], -kappa * m[2]]
    }

    fn first_moment(self, s: &[f32; 4]) -> [f32; 3] {
        [s[1], s[2], s[0] - s[3]]
    }

    fn spread(self, s: &[f32; 4], mean: &[f32; 3]) -> f32 {
        s[0] - dot(&self.first_moment(s), mean)
    }

    fn slope_of_sums(self, s: &Shape, slope: &ShapeSlope) -> [f32; 4] {
        // r = X/alpha, mean = r/|r|, variance a function of |r|.
        let r = s.length;
        let along = dot(&slope.mean, &s.mean);
        let radial = slope.variance * variance_slope(r);
        let x: [f32; 3] =
            [0, 1, 2].map(|k| ((slope.mean[k] - along * s.mean[k]) / r + radial * s.mean[k]) / s.alpha);
        // As a function of (alpha, x, y, w = alpha - z): z is alpha - w.
        let alpha = slope.alpha - r * dot(&s.mean, &x);
        [alpha + x[2], x[0], x[1], -x[2]]
    }

    fn slope_of_shape(self, s: &Shape, slope: &[f32; 4]) -> ShapeSlope {
        let r = s.length;
        let x = [slope[1], slope[2], -slope[3]];
        let along = dot(&x, &s.mean);
        let sums = self.encode(s);
        ShapeSlope {
            alpha: (0..4).map(|k| slope[k] * sums[k]).sum(),
            mean: [0, 1, 2].map(|k| s.alpha * r * (x[k] - along * s.mean[k])),
            variance: s.alpha * along / variance_slope(r),
        }
    }

    /// `mu_j = normalize(Σ z n + C Σ alpha_jk mu_jk)`, the length of `r_j` kept: so the likelihood of Han et
    /// al.'s appendix has it, with `Σ z` a number of normals, as Tan et al. have theirs. Equation 23 prints
    /// `r_j`, the mean of those normals, in place of their sum.
    fn with_prior(self, sums: &[f32; 4], pull: &Pull) -> [f32; 4] {
        let shape = self.decode(sums);
        if shape.alpha <= DEAD {
            return *sums;
        }
        let normals = if PRINTED { 1.0 } else { shape.alpha * pull.count };
        let mean = [0, 1, 2].map(|k| normals * shape.length * shape.mean[k] + pull.strength * pull.mean[k]);
        self.encode(&Shape { mean: unit_or_up(mean), ..shape })
    }
}

/// Isotropic Gaussians in the plane of `n.xy` (Tan et al. 2005, section 4): `T(n) = (n.x, n.y, n.x² + n.y²)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planar;

impl Isotropic for Planar {
    // The fourth is the second moment; kept too, it costs more highlight than it gains diffuse light.
    const OF_MEAN: usize = 3;

    #[inline(always)]
    fn sufficient(self, n: Vec3) -> [f32; 3] {
        [n.x, n.y, n.x * n.x + n.y * n.y]
    }

    fn shape(self, alpha: f32, [x, y, _]: [f32; 3], variance: f32) -> Shape {
        // Beyond the unit disk there are no normals; but a mean of a rounded rim may lie a little outside.
        let mean = [x.clamp(-1.1, 1.1), y.clamp(-1.1, 1.1), 0.0];
        Shape { alpha, mean, variance: variance.clamp(LEAST_VARIANCE, MOST_VARIANCE), length: 1.0 }
    }

    fn decode(self, &[alpha, x, y, q]: &[f32; 4]) -> Shape {
        if alpha <= DEAD {
            return self.shape(0.0, [0.0; 3], LEAST_VARIANCE);
        }
        let (x, y) = (x / alpha, y / alpha);
        self.shape(alpha, [x, y, 0.0], (q / alpha - x * x - y * y) * 0.5)
    }

    fn encode(self, s: &Shape) -> [f32; 4] {
        let [x, y, _] = s.mean;
        [s.alpha, s.alpha * x, s.alpha * y, s.alpha * (2.0 * s.variance + x * x + y * y)]
    }

    fn unit_natural(self, m: &[f32; 3], variance: f32) -> [f32; 4] {
        let precision = variance.recip();
        let norm = (precision / std::f32::consts::TAU).ln();
        let square = m[0] * m[0] + m[1] * m[1];
        [norm - 0.5 * square * precision, m[0] * precision, m[1] * precision, -0.5 * precision]
    }

    fn first_moment(self, s: &[f32; 4]) -> [f32; 3] {
        [s[1], s[2], 0.0]
    }

    fn spread(self, s: &[f32; 4], m: &[f32; 3]) -> f32 {
        0.5 * (s[3] - 2.0 * dot(&self.first_moment(s), m) + s[0] * dot(m, m))
    }

    fn slope_of_sums(self, s: &Shape, slope: &ShapeSlope) -> [f32; 4] {
        // mean = X/alpha, variance = (q/alpha - |mean|²)/2.
        let q = slope.variance / (2.0 * s.alpha);
        let [x, y] = [0, 1].map(|k| (slope.mean[k] - slope.variance * s.mean[k]) / s.alpha);
        let second = 2.0 * s.variance + dot(&s.mean, &s.mean);
        [slope.alpha - s.mean[0] * x - s.mean[1] * y - second * q, x, y, q]
    }

    fn slope_of_shape(self, s: &Shape, slope: &[f32; 4]) -> ShapeSlope {
        let sums = self.encode(s);
        let mean = |k: usize| s.alpha * (slope[k + 1] + 2.0 * s.mean[k] * slope[3]);
        ShapeSlope {
            alpha: (0..4).map(|k| slope[k] * sums[k]).sum(),
            mean: [mean(0), mean(1), 0.0],
            variance: 2.0 * s.alpha * slope[3],
        }
    }

    /// `mu_i = (Σ z n + c Σ alpha_k mu_k)/(Σ z + c Σ alpha_k)`, `Σ z` a number of normals (Tan et al. 2005,
    /// section 4.2), and the variance about that mean.
    fn with_prior(self, sums: &[f32; 4], pull: &Pull) -> [f32; 4] {
        let [alpha, x, y, q] = *sums;
        if alpha <= DEAD {
            return *sums;
        }
        let c = pull.strength / pull.count;
        let total = alpha + c * pull.weight;
        let mean = [(x + c * pull.mean[0]) / total, (y + c * pull.mean[1]) / total, 0.0];
        let variance = self.spread(&[alpha, x, y, q], &mean) / alpha;
        self.encode(&self.shape(alpha, mean, variance))
    }
}

/// Gaussians of `n.xy` of any covariance: `T(n) = (n.x, n.y, n.x², n.y², n.x n.y)`. Only tests have them.
#[cfg(test)]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elliptic;

#[cfg(test)]
impl Elliptic {
    /// Covariance of sums over their weight: xx, yy, xy; held above the least variance.
    fn covariance(&[alpha, x, y, xx, yy, xy]: &[f32; 6]) -> [f32; 3] {
        let (x, y) = (x / alpha, y / alpha);
        [
            (xx / alpha - x * x).max(0.0) + LEAST_VARIANCE,
            (yy / alpha - y * y).max(0.0) + LEAST_VARIANCE,
            xy / alpha - x * y,
        ]
    }
}

#[cfg(test)]
impl Family<6> for Elliptic {
    fn statistics(self, n: Vec3) -> [f32; 6] {
        [1.0, n.x, n.y, n.x * n.x, n.y * n.y, n.x * n.y]
    }

    /// `ln alpha - ln(tau sqrt|C|) - (n - m)ᵀ C⁻¹ (n - m)/2`, multiplied out.
    fn natural(self, sums: &[f32; 6]) -> [f32; 6] {
        if sums[0] <= DEAD {
            return [NOWHERE, 0.0, 0.0, 0.0, 0.0, 0.0];
        }
        let [xx, yy, xy] = Self::covariance(sums);
        let determinant = (xx * yy - xy * xy).max(LEAST_VARIANCE * LEAST_VARIANCE);
        let [a, b, c] = [yy / determinant, xx / determinant, -xy / determinant];
        let (x, y) = (sums[1] / sums[0], sums[2] / sums[0]);
        let norm = sums[0].ln() - (std::f32::consts::TAU * determinant.sqrt()).ln();
        let square = a * x * x + b * y * y + 2.0 * c * x * y;
        [norm - 0.5 * square, a * x + c * y, b * y + c * x, -0.5 * a, -0.5 * b, -c]
    }

    fn mean(self, sums: &[f32; 6]) -> [f32; 3] {
        let alpha = sums[0].max(DEAD);
        [sums[1] / alpha, sums[2] / alpha, 0.0]
    }

    fn width(self, sums: &[f32; 6]) -> f32 {
        if sums[0] <= DEAD {
            return LEAST_VARIANCE;
        }
        let [xx, yy, _] = Self::covariance(sums);
        0.5 * (xx + yy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes(family: impl Isotropic) -> [Shape; 3] {
        [
            family.shape(0.3, unit_or_up([0.4, -0.3, 0.8]), 0.05),
            family.shape(1.0, unit_or_up([0.01, 0.0, 1.0]), 0.002),
            family.shape(0.02, unit_or_up([0.9, 0.1, 0.2]), 0.4),
        ]
    }

    fn round_trip(family: impl Isotropic, shape: &Shape) {
        let back = family.decode(&family.encode(shape));
        // Single floats: 1 - |r|² holds about seven digits of 1.
        assert!((back.variance - shape.variance).abs() < 1e-6 + 1e-5 * shape.variance, "{back:?} {shape:?}");
        assert!(gap(&back, shape) < 1e-10 && back.alpha == shape.alpha);
    }

    /// `slope_of_sums` and `slope_of_shape` against finite differences of a smooth function of the sums.
    fn slopes(family: impl Isotropic, shape: &Shape) {
        let f = |s: &Shape| {
            f64::from(s.alpha).powi(2)
                + f64::from(s.mean[0]) * 0.7
                + f64::from(s.mean[1])
                + 3.0 * f64::from(s.variance)
        };
        let sums = family.encode(shape).map(f64::from);
        let at = |sums: [f64; 4]| f(&family.decode(&sums.map(|s| s as f32)));
        let slope = ShapeSlope { alpha: 2.0 * shape.alpha, mean: [0.7, 1.0, 0.0], variance: 3.0 };
        let by_sums = family.slope_of_sums(shape, &slope);
        for k in 0..4 {
            let h = 2e-3 * f64::from(shape.alpha);
            let moved = |h: f64| {
                let mut s = sums;
                s[k] += h;
                at(s)
            };
            let numeric = (moved(h) - moved(-h)) / (2.0 * h);
            // Second-order differences over a step of 2e-3 of functions that curve like 1/alpha².
            let tolerance = 2e-2 * numeric.abs().max(0.5 / f64::from(shape.alpha));
            assert!(
                (f64::from(by_sums[k]) - numeric).abs() < tolerance,
                "{k}: {} {numeric} {shape:?}",
                by_sums[k]
            );
        }
        let own = family.slope_of_shape(shape, &by_sums);
        assert!((own.alpha - shape.alpha * slope.alpha).abs() < 1e-4, "{own:?}");
        assert!((own.variance - slope.variance).abs() < 1e-3, "{own:?}");
    }

    #[test]
    fn sums_decode_to_what_was_encoded() {
        shapes(Spherical::<false>).iter().for_each(|shape| round_trip(Spherical::<false>, shape));
        shapes(Planar).iter().for_each(|shape| round_trip(Planar, shape));
    }

    #[test]
    fn derivatives_chain() {
        shapes(Spherical::<false>).iter().for_each(|shape| slopes(Spherical::<false>, shape));
        shapes(Planar).iter().for_each(|shape| slopes(Planar, shape));
    }

    #[test]
    fn theta_is_the_logarithm_of_the_density() {
        let shape = shapes(Spherical::<false>)[0];
        let n = Vec3::new(0.1, 0.2, 0.5).normalize();
        let log = |theta: [f32; 4], t: [f32; 4]| log_density(&theta, &t);
        let kappa = 1.0 / f64::from(shape.variance);
        let u = f64::from(dot(&n.to_array(), &shape.mean));
        let expected = (0.3 * kappa / (4.0 * std::f64::consts::PI * kappa.sinh())).ln() + kappa * u;
        let got = log(
            Spherical::<false>.natural(&Spherical::<false>.encode(&shape)),
            Spherical::<false>.statistics(n),
        );
        assert!((f64::from(got) - expected).abs() < 1e-4, "{got} {expected}");
        let flat = Planar.shape(0.3, [0.4, -0.3, 0.0], 0.05);
        let d = f64::from((n.x - 0.4).powi(2) + (n.y + 0.3).powi(2));
        let expected = (0.3 / (2.0 * std::f64::consts::PI * 0.05)).ln() - d / 0.1;
        let got = log(Planar.natural(&Planar.encode(&flat)), Planar.statistics(n));
        assert!((f64::from(got) - expected).abs() < 1e-4, "{got} {expected}");
    }

    #[test]
    fn nonsense_decodes_to_something_finite() {
        for fill in [0.0, -1.0, 1e-30, 1.0, 65504.0, -65504.0] {
            for sums in [[fill; 4], [1.0, fill, fill, fill], [fill, 1.0, 0.0, 1.0]] {
                for shape in [Spherical::<false>.decode(&sums), Planar.decode(&sums)] {
                    assert!(shape.mean.iter().all(|m| m.is_finite()) && shape.variance > 0.0);
                }
            }
        }
    }
}
