//! `slopes`: first and second moments of the slope, a non-centred Gaussian. LEAN (Olano and Baker 2010) and
//! LEADR (Dupuy et al. 2013): `E[x], E[y], E[x²], E[y²], E[xy]` and the mean height.
//!
//! The base lobe's slope variance adds to both variances at shading time, and the lobe's own profile is
//! stretched by the sum: in slopes, per unit of map area, a lobe around the vertical is `p(t) = f(u) u³`, u =
//! 1/sqrt(1+t²), and t becomes the Mahalanobis distance in units of the lobe's own deviation. With no spread
//! that is the lobe itself; for a Gaussian of angles it is LEAN's Gaussian. The density is per map area,
//! `gamma = P22 / w.z³`, because that is how a normal map's texels weigh; LEAN's `D = P22 / w.z⁴` counts
//! facet area and is brighter by 1/w.z where the map is steep (`docs/methods.md` has what that costs).
//! Lambert is averaged over 5×5 slopes of the Gaussian, as in LEADR. On a surface that the map displaces,
//! facets weigh by what the eye sees of them: `leadr.rs`.

use std::fmt::{self, Display};

use fearless_simd::{Level, dispatch};
use glam::{DVec2, DVec3, Vec3};

use super::leadr::SlopeGrid;
use super::table::{count_of, counted};
use super::{
    AnyMethod, Decoded, Describe, Encoding, Form, FormKind, ParameterError, Representation, Row, Sample,
};
use crate::brdf::Lobe;
use crate::shader::Shader;
use crate::surface::{SurfaceRow, slope_of_normal};
use crate::units::SlopeVariance;

/// Moments of the slope.
#[derive(Clone, Debug, PartialEq)]
pub struct Slopes {
    /// Slopes over which environments and diffuse facets of a displaced surface are averaged.
    grid: SlopeGrid,
}

impl Slopes {
    /// The paper's 5 × 5 slopes.
    #[must_use]
    pub fn new() -> Self {
        Self { grid: SlopeGrid::new(5) }
    }

    /// Averages environments and diffuse facets of displaced surfaces over `n` × `n` slopes, n from 5 to 128.
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another `n`.
    pub fn with_grid(n: usize) -> Result<Self, ParameterError> {
        counted(n, "number of slopes", 5..=128, "slopes:9").map(|n| Self { grid: SlopeGrid::new(n) })
    }

    /// Returns it with as many slopes, drawn at random.
    #[must_use]
    pub fn drawn(self) -> Self {
        Self { grid: SlopeGrid::drawn(self.grid.len()) }
    }
}

impl Default for Slopes {
    fn default() -> Self {
        Self::new()
    }
}

pub(super) const ROW: Row = Row {
    name: "slopes",
    aliases: &["lean", "leadr"],
    parameters: "[:N[:drawn]]",
    summary: "one anisotropic Gaussian of slopes, with the mean height; N × N of them (5) under environments and for displaced diffuse facets",
    paper: "Olano and Baker 2010 (LEAN); Dupuy et al. 2013 (LEADR)",
    parse,
    samples: &["slopes", "slopes:9", "slopes:9:drawn"],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let slopes = match words {
        [] => Slopes::new(),
        [n] => Slopes::with_grid(count_of(Some(n)))?,
        [n, "drawn"] => Slopes::with_grid(count_of(Some(n)))?.drawn(),
        _ => return Err(ParameterError::Words("takes one number at most, and perhaps `drawn`".to_owned())),
    };
    Ok(AnyMethod::from(slopes))
}

/// Stored sums: means of height, slope and products of slopes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SlopeMoments {
    /// `E[h]` in texture widths.
    pub height: f32,
    /// `E[x], E[y]`.
    pub mean: [f32; 2],
    /// `E[x²], E[y²], E[xy]`.
    pub second: [f32; 3],
}

/// A Gaussian of slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeGaussian {
    /// Mean height in texture widths.
    pub height: f64,
    /// Mean slope.
    pub mean: DVec2,
    /// Covariance: xx, yy, xy. Never indefinite.
    pub covariance: [f64; 3],
}

impl From<SlopeGaussian> for Decoded {
    fn from(g: SlopeGaussian) -> Self {
        Self::Slopes { height: g.height, mean: g.mean, covariance: g.covariance }
    }
}

impl SlopeGaussian {
    /// This distribution convolved with an isotropic one.
    #[must_use]
    pub fn widen(self, by: SlopeVariance) -> Self {
        let [xx, yy, xy] = self.covariance;
        Self { covariance: [xx + by.get(), yy + by.get(), xy], ..self }
    }
}

/// Stretches the profile of a lobe of width `base` by a covariance that already holds that width.
///
/// Returns a function of a slope relative to the mean: the density there, per unit of slope area.
pub(super) fn stretched<'a>(
    lobe: &'a dyn Lobe,
    base: SlopeVariance,
    covariance: [f64; 3],
) -> impl Fn(DVec2) -> f64 + 'a {
    let area = root_of_determinant(covariance).recip();
    move |d| {
        let square = mahalanobis(covariance, d);
        // Per map area: the profile counts facet area, which is 1/u as much.
        lobe.slope_profile(square) * (1.0 + base.get() * square).sqrt() * area
    }
}

/// Root of the determinant of a covariance (xx, yy, xy): the area of its ellipse over pi.
pub(super) fn root_of_determinant([xx, yy, xy]: [f64; 3]) -> f64 {
    (xx * yy - xy * xy).max(f64::MIN_POSITIVE).sqrt()
}

/// Squared length of a slope in units of its deviations.
pub(super) fn mahalanobis(covariance: [f64; 3], d: DVec2) -> f64 {
    let [xx, yy, xy] = covariance;
    let root = root_of_determinant(covariance);
    (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / root / root
}

/// Positions (in deviations) and weights of 5-point Gauss-Hermite quadrature: exact to degree 9.
const HERMITE: [(f64, f64); 5] = [
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_64),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_64),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// Normals of 5×5 slopes of the Gaussian, with weights that sum to one.
fn slope_samples(g: &SlopeGaussian) -> Vec<(DVec3, f64)> {
    let [xx, yy, xy] = g.covariance;
    let deviation = xx.sqrt();
    let shear = if deviation > 0.0 { xy / deviation } else { 0.0 };
    let rest = (yy - shear * shear).max(0.0).sqrt();
    let mut samples = Vec::with_capacity(25);
    for (a, wa) in HERMITE {
        for (b, wb) in HERMITE {
            let slope = g.mean + DVec2::new(deviation * a, shear * a + rest * b);
            samples.push((DVec3::new(-slope.x, -slope.y, 1.0).normalize(), wa * wb));
        }
    }
    samples
}

#[inline(always)]
fn moments_of_row(row: &SurfaceRow, first: &mut [[f32; 4]], second: &mut [[f32; 4]]) {
    let normals = row.x.iter().zip(&row.y).zip(&row.z).zip(&row.height);
    for ((((x, y), z), height), (first, second)) in normals.zip(first.iter_mut().zip(&mut *second)) {
        let s = slope_of_normal(Vec3::new(*x, *y, *z));
        *first = [*height, s.x, s.y, 1.0];
        *second = [s.x * s.x, s.y * s.y, s.x * s.y, 1.0];
    }
    // The spread of slopes within a texel, where the surface knows it.
    for (second, spread) in second.iter_mut().zip(&row.spread) {
        second.iter_mut().zip(spread).for_each(|(s, within)| *s += within);
    }
}

impl Display for Slopes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.grid.len(), self.grid.is_drawn()) {
            (5, false) => f.write_str(ROW.name),
            (n, false) => write!(f, "{}:{n}", ROW.name),
            (n, true) => write!(f, "{}:{n}:drawn", ROW.name),
        }
    }
}

impl Describe for Slopes {
    fn encoding(&self) -> Encoding {
        Encoding::SlopeMoments
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Slopes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Slopes, &[include_str!("slopes.wgsl"), include_str!("stretched.wgsl")])
            .constant("GRID", self.grid.len() as u32)
            .constant("GRID_STEP", SlopeGrid::step(self.grid.len()) as f32)
            .constant("GRID_WEIGHT", self.grid.middle_weight() as f32)
            .constant("GRID_LEVEL", self.grid.level_offset() as f32)
            .constant("GRID_DRAWN", self.grid.is_drawn())
    }
}

impl Representation for Slopes {
    type Sums = SlopeMoments;
    type Lobes = SlopeGaussian;

    fn zero(&self) -> SlopeMoments {
        SlopeMoments::default()
    }

    fn accumulate(&self, sums: &mut SlopeMoments, sample: &Sample, weight: f32) {
        let s = slope_of_normal(sample.normal);
        let [xx, yy, xy] = sample.spread;
        let one = SlopeMoments {
            height: sample.height,
            mean: s.to_array(),
            second: [s.x * s.x + xx, s.y * s.y + yy, s.x * s.y + xy],
        };
        self.blend(sums, &one, weight);
    }

    fn blend(&self, sums: &mut SlopeMoments, part: &SlopeMoments, weight: f32) {
        sums.height += weight * part.height;
        for (sum, p) in sums.mean.iter_mut().zip(part.mean) {
            *sum += weight * p;
        }
        for (sum, p) in sums.second.iter_mut().zip(part.second) {
            *sum += weight * p;
        }
    }

    fn pack(&self, sums: &SlopeMoments, channels: &mut [f32]) {
        let ([x, y], [xx, yy, xy]) = (sums.mean, sums.second);
        channels.copy_from_slice(&[sums.height, x, y, 1.0, xx, yy, xy, 1.0]);
    }

    fn pack_row(&self, row: &SurfaceRow, channels: &mut [f32]) {
        let (first, second) = channels.split_at_mut(4 * row.width());
        let (first, second) = (first.as_chunks_mut().0, second.as_chunks_mut().0);
        dispatch!(Level::new(), _simd => moments_of_row(row, first, second));
    }

    fn unpack(&self, channels: &[f32]) -> SlopeMoments {
        SlopeMoments {
            height: channels[0],
            mean: [channels[1], channels[2]],
            second: [channels[4], channels[5], channels[6]],
        }
    }

    fn decode(&self, sums: &SlopeMoments) -> SlopeGaussian {
        let [x, y] = sums.mean.map(f64::from);
        let [xx, yy, xy] = sums.second.map(f64::from);
        // Rounding of the stored moments can leave a variance below zero or a correlation beyond one.
        let (xx, yy) = ((xx - x * x).max(0.0), (yy - y * y).max(0.0));
        let limit = (xx * yy).sqrt();
        let covariance = [xx, yy, (xy - x * y).clamp(-limit, limit)];
        SlopeGaussian { height: f64::from(sums.height), mean: DVec2::new(x, y), covariance }
    }

    fn form<'a>(&'a self, lobes: &SlopeGaussian) -> Form<'a> {
        Form::Slopes(*lobes, &self.grid)
    }

    fn effective<'a>(&'a self, lobes: &SlopeGaussian, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let Some(base) = lobe.slope_variance() else {
            let samples = slope_samples(lobes);
            return Box::new(move |w| {
                samples.iter().map(|(n, weight)| weight * lobe.evaluate(w.dot(*n))).sum()
            });
        };
        let mean = lobes.mean;
        let p22 = stretched(lobe, base, lobes.widen(base).covariance);
        Box::new(move |w| {
            if w.z <= 0.0 {
                return 0.0;
            }
            p22(DVec2::new(-w.x, -w.y) / w.z - mean) / w.z.powi(3)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::Beckmann;
    use crate::units::Alpha;
    use std::f64::consts::PI;

    #[test]
    fn beckmann_on_gaussian_slopes_is_the_closed_form() {
        // Beckmann's profile per map area is its Gaussian over u: f u³ = P22 / u.
        let alpha = 0.3;
        let lobe = Beckmann::new(Alpha::new(alpha).unwrap());
        let g = SlopeGaussian { height: 0.0, mean: DVec2::new(0.2, -0.1), covariance: [0.05, 0.02, 0.01] };
        let slopes = Slopes::default();
        let effective = slopes.effective(&g, &lobe);
        let w = DVec3::new(0.1, 0.3, 0.9).normalize();
        let d = DVec2::new(-w.x, -w.y) / w.z - g.mean;
        let base = alpha * alpha / 2.0;
        let (xx, yy, xy) = (0.05 + base, 0.02 + base, 0.01);
        let det = xx * yy - xy * xy;
        let q = (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / det;
        let expected = (-q / 2.0).exp() / (2.0 * PI * det.sqrt()) * (1.0 + base * q).sqrt() / w.z.powi(3);
        assert!((effective(w) - expected).abs() < 1e-12 * expected);
    }

    #[test]
    fn quadrature_of_slopes_has_the_moments() {
        let g = SlopeGaussian { height: 0.0, mean: DVec2::new(0.2, -0.1), covariance: [0.05, 0.02, 0.01] };
        let samples = slope_samples(&g);
        let mean = |f: &dyn Fn(DVec2) -> f64| -> f64 {
            samples.iter().map(|(n, w)| w * f(DVec2::new(-n.x, -n.y) / n.z)).sum()
        };
        assert!((mean(&|_| 1.0) - 1.0).abs() < 1e-14);
        assert!((mean(&|s| s.x) - 0.2).abs() < 1e-14);
        assert!((mean(&|s| s.x * s.y) - (0.01 - 0.02)).abs() < 1e-14);
        assert!((mean(&|s| s.y * s.y) - (0.02 + 0.01)).abs() < 1e-14);
    }
}
