//! How one normal reflects: lobes of the form `f(w · n)`, with `w` the light or the half-vector.
//!
//! Han et al. 2007, section 4: every such lobe acts on a distribution of normals by spherical
//! convolution, so two facts are all that a representation needs of it: its **zonal coefficients**,
//! and how it **widens** when convolved with an isotropic lobe. [`TABLE`] lists them; a row buys the
//! conformance tests at the end of this file.

mod beckmann;
mod blinn_phong;
mod ggx;
mod lambert;
pub mod measured;
mod torrance_sparrow;

pub use beckmann::Beckmann;
pub use blinn_phong::BlinnPhong;
pub use ggx::Ggx;
pub use lambert::{Lambert, mean_of_positive_part};
pub use measured::{Factors, Measured};
pub use torrance_sparrow::TorranceSparrow;

use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Debug;

use glam::DVec3;

use crate::light::environment::Kernel;
use crate::sphere::{gauss_legendre, legendre};
use crate::units::SlopeVariance;

/// Which vector the lobe takes beside the normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// The direction to the light.
    Light,
    /// The half-vector between light and eye.
    Half,
}

/// A reflectance lobe around a normal.
pub trait Brdf: Send + Sync + Debug {
    /// As written on the command line, such as `blinn-phong:50`.
    fn spelling(&self) -> String;

    /// What `w` is.
    fn argument(&self) -> Argument;

    /// `f(u)`, u = w · n in [-1, 1]; zero where u ≤ 0 unless the lobe was widened.
    fn evaluate(&self, u: f64) -> f64;

    /// [`Self::evaluate`] of every element, in place.
    fn evaluate_all(&self, u: &mut [f64]);

    /// Slope variance of the lobe on one axis; `None` for Lambert, which is no narrow lobe.
    fn slope_variance(&self) -> Option<SlopeVariance>;

    /// This lobe convolved with an isotropic lobe of normals of variance `by`; exactly itself for zero.
    fn widen(&self, by: SlopeVariance) -> Box<dyn Brdf>;

    /// [`Self::widen`], then [`Self::evaluate`], without a lobe on the heap: what a pixel asks of a lobe, once.
    fn evaluate_widened(&self, by: SlopeVariance, u: f64) -> f64;

    /// Smith's masking (Walter et al. 2007, section 5.1) at cosine `u > 0` to the normal, of a lobe of this kind that is
    /// `width` wide; Beckmann's, where a lobe has none of its own.
    fn masking(&self, u: f64, width: SlopeVariance) -> f64 {
        beckmann::masking(u, width)
    }

    /// Colour of the lobe itself, at the cosine u = wi·wh; white, but for what was measured.
    fn tint(&self, _u: f64) -> DVec3 {
        DVec3::ONE
    }

    /// The factors of a material that was measured as a whole: its diffuse part belongs to the lobe.
    fn measured(&self) -> Option<&Factors> {
        None
    }

    /// The microfacets whose blur of an environment is most like this lobe's.
    fn kernel(&self) -> Kernel {
        Kernel::Beckmann
    }

    /// The microfacets of a lobe that is none: Beckmann's, as wide as it; `None` for lobes of microfacets, and for Lambert.
    fn microfacets(&self) -> Option<Beckmann> {
        self.slope_variance().map(Beckmann::of_width)
    }

    /// Density of facets over slopes, in units of the lobe's own deviations: D(u) u⁴ times its variance, at a slope of this squared
    /// length. Not through u where a lobe is a function of slopes: near 1, u has few of their digits.
    fn slope_profile(&self, square: f64) -> f64 {
        let variance = self.slope_variance().unwrap_or(SlopeVariance::ZERO).get();
        let u2 = 1.0 / (1.0 + variance * square);
        self.evaluate(u2.sqrt()) * u2 * u2 * variance
    }

    /// Area, projected along a direction, of the facets that face it: the mean of `max(X, 0)` for X of this mean and deviation, X being
    /// distributed as slopes are for lobes of this kind. Beckmann's Gaussian, where a lobe has none of its own. Per unit of area that the
    /// facets cover, and masking apart: [`Self::masking`] is the mean over this.
    fn visible_area(&self, mean: f64, deviation: f64) -> f64 {
        mean_of_positive_part(mean, deviation * deviation)
    }

    /// Zonal coefficients `rho_l = 2 pi ∫ f(u) P_l(u) du` for l = 0..`order` (Han et al., equation 8).
    ///
    /// Closed forms or recurrences where there are any; else [`zonal_by_quadrature`].
    fn zonal(&self, order: usize) -> Vec<f64> {
        zonal_by_quadrature(self, order)
    }

    /// Text of the twin in WGSL: `SPECULAR` and the functions `brdf_widen`, `brdf_evaluate`, `brdf_variance`, `brdf_masking`,
    /// `brdf_slope_profile`, `brdf_visible_area`, `brdf_tint`.
    fn shader(&self) -> Cow<'static, str>;

    /// The one number, `base`, that the twin's functions take for this lobe.
    fn base(&self) -> f64;

    /// The approximation that Han et al. print for the zonal coefficients, if they do.
    fn zonal_as_printed(&self, _order: usize) -> Option<Vec<f64>> {
        None
    }
}

/// Zonal coefficients by Gauss-Legendre quadrature in the angle, in panels that halve towards the peak.
///
/// 14 panels of 24 nodes resolve a lobe of width 1e-3 and orders to 16 to about 1e-13 (tested against
/// closed forms and an independent script).
pub fn zonal_by_quadrature<B: Brdf + ?Sized>(brdf: &B, order: usize) -> Vec<f64> {
    let nodes = gauss_legendre(24);
    let mut rho = vec![0.0; order + 1];
    let mut end = PI;
    for panel in 0..15 {
        // Panels: (pi/2, pi), (pi/4, pi/2), ... and the last reaches zero.
        let start = if panel == 14 { 0.0 } else { FRAC_PI_2 * 0.5_f64.powi(panel) };
        for (x, weight) in &nodes {
            let theta = start + (end - start) * (x + 1.0) / 2.0;
            let u = theta.cos();
            let f = brdf.evaluate(u) * theta.sin() * weight * (end - start) / 2.0;
            for (rho, p) in rho.iter_mut().zip(legendre(order, u)) {
                *rho += 2.0 * PI * f * p;
            }
        }
        end = start;
    }
    rho
}

/// A row of [`TABLE`].
pub struct Row {
    /// The word before the colon.
    pub name: &'static str,
    /// What follows it, for help: `:S`, `:ALPHA` or nothing.
    pub parameter: &'static str,
    /// One line for help and docs.
    pub summary: &'static str,
    /// Reads the parameter.
    pub parse: fn(&str) -> Result<Box<dyn Brdf>, String>,
    /// Spellings that the conformance tests run.
    pub samples: &'static [&'static str],
}

/// Every lobe there is.
pub static TABLE: &[Row] = &[
    lambert::ROW,
    blinn_phong::ROW,
    torrance_sparrow::ROW,
    beckmann::ROW,
    ggx::ROW,
    measured::SGD,
    measured::ABC,
];

/// A spelling that names no lobe.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParseBrdfError {
    /// No row of the table has this name.
    #[error("there is no BRDF called `{0}`")]
    Unknown(String),
    /// The parameter is missing, superfluous or out of range.
    #[error("BRDF `{spelling}`: {reason}")]
    Parameter {
        /// What was written.
        spelling: String,
        /// What is wrong.
        reason: String,
    },
}

/// Reads a spelling such as `blinn-phong:50`, `ggx:0.2` or `lambert`.
///
/// # Errors
/// [`ParseBrdfError`], naming what is wrong.
pub fn parse(spelling: &str) -> Result<Box<dyn Brdf>, ParseBrdfError> {
    let (name, parameter) = spelling.split_once(':').unwrap_or((spelling, ""));
    let row =
        TABLE.iter().find(|row| row.name == name).ok_or_else(|| ParseBrdfError::Unknown(name.to_owned()))?;
    (row.parse)(parameter)
        .map_err(|reason| ParseBrdfError::Parameter { spelling: spelling.to_owned(), reason })
}

/// The text of a lobe without a colour of its own.
fn untinted(text: &str) -> Cow<'static, str> {
    [text, include_str!("untinted.wgsl")].join("\n").into()
}

/// Reads the one number of a lobe into its unit.
fn number<U, E: ToString>(text: &str, unit: fn(f64) -> Result<U, E>) -> Result<U, String> {
    if text.is_empty() {
        return Err("a number must follow, as in `name:0.5`".to_owned());
    }
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    unit(value).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples() -> impl Iterator<Item = Box<dyn Brdf>> {
        TABLE.iter().flat_map(|row| row.samples).map(|s| parse(s).unwrap())
    }

    #[test]
    fn spellings_round_trip() {
        for brdf in samples() {
            assert_eq!(parse(&brdf.spelling()).unwrap().spelling(), brdf.spelling());
        }
        assert!(TABLE.iter().all(|row| !row.samples.is_empty()));
    }

    #[test]
    fn bad_spellings_say_why() {
        let message = |s: &str| parse(s).unwrap_err().to_string();
        assert_eq!(message("phong:3"), "there is no BRDF called `phong`");
        assert_eq!(message("ggx:2"), "BRDF `ggx:2`: alpha must be between 0.0001 and 1, not 2");
        assert_eq!(message("ggx"), "BRDF `ggx`: a number must follow, as in `name:0.5`");
        assert_eq!(message("ggx:x"), "BRDF `ggx:x`: `x` is no number");
        assert_eq!(
            message("blinn-phong:NaN"),
            "BRDF `blinn-phong:NaN`: exponent must be between 0.001 and 1e6, not NaN"
        );
        assert_eq!(message("lambert:1"), "BRDF `lambert:1`: takes no number");
    }

    #[test]
    fn lobes_are_finite_falling_and_dark_behind() {
        for brdf in samples() {
            assert_eq!(brdf.evaluate(-0.5), 0.0, "{}", brdf.spelling());
            let mut all: Vec<f64> = (0..=1000).map(|i| f64::from(i) / 1000.0).collect();
            let one_by_one: Vec<f64> = all.iter().map(|u| brdf.evaluate(*u)).collect();
            brdf.evaluate_all(&mut all);
            assert_eq!(all, one_by_one);
            assert!(all.windows(2).all(|f| f[0].is_finite() && f[1] >= f[0]), "{}", brdf.spelling());
        }
    }

    #[test]
    fn zonal_coefficients_agree_with_quadrature() {
        for brdf in samples() {
            let (exact, numeric) = (brdf.zonal(16), zonal_by_quadrature(&*brdf, 16));
            for l in 0..=16 {
                // Lobes that are not polynomials near u = 0 leave the quadrature about 1e-10.
                assert!(
                    (exact[l] - numeric[l]).abs() < 1e-9,
                    "{} l = {l}: {} {}",
                    brdf.spelling(),
                    exact[l],
                    numeric[l]
                );
            }
        }
    }

    #[test]
    fn widening_by_nothing_changes_nothing() {
        for brdf in samples() {
            let same = brdf.widen(SlopeVariance::ZERO);
            for u in [-0.2, 0.0, 0.3, 0.9, 0.999, 1.0] {
                let (a, b) = (brdf.evaluate(u), same.evaluate(u));
                assert!((a - b).abs() <= 1e-12 * a.abs(), "{} at {u}: {a} {b}", brdf.spelling());
            }
        }
    }

    #[test]
    fn widening_in_passing_is_widening() {
        let by = SlopeVariance::clamped(0.03);
        for brdf in samples() {
            for u in [-0.2, 0.3, 0.999] {
                assert_eq!(brdf.evaluate_widened(by, u), brdf.widen(by).evaluate(u), "{}", brdf.spelling());
            }
        }
    }

    #[test]
    fn widening_matches_the_convolution_with_a_von_mises_fisher_lobe() {
        // The exact effect of a vMF lobe (kappa = 1/v) is to scale rho_l by its own zonal coefficient
        // A_l: A_1 = coth k - 1/k, A_{l+1} = A_{l-1} - (2l+1)/k A_l. The rules approximate that. Shape (rho_l
        // over rho_0) must agree to 4 %. GGX has no variance to add to, and the rule costs it up to 16 %. Energy rho_0 must stay, but for GGX and Beckmann, whose D holds one
        // unit of *projected* area: the wider, the more of it leans, at most 1 + pi v ~ 10 % here;
        // Torrance-Sparrow, normalised as on a plane, loses 2 sigma²/3.
        let kappa = 50.0_f64;
        let mut a = vec![1.0, 1.0 / kappa.tanh() - 1.0 / kappa];
        for l in 1..4 {
            a.push(a[l - 1] - (2 * l + 1) as f64 / kappa * a[l]);
        }
        for brdf in samples() {
            let (base, wide) = (brdf.zonal(4), brdf.widen(SlopeVariance::clamped(1.0 / kappa)).zonal(4));
            for l in 0..=4 {
                let (got, expected) = (wide[l] / wide[0], base[l] / base[0] * a[l]);
                let bound = if brdf.spelling().starts_with("ggx") { 0.16 } else { 0.04 };
                assert!((got - expected).abs() < bound, "{} l = {l}: {got} for {expected}", brdf.spelling());
            }
            let energy = wide[0] / base[0];
            let bound = if brdf.spelling().starts_with(['g', 'b']) { 0.1 } else { 0.01 };
            assert!((energy - 1.0).abs() < bound, "{} {energy}", brdf.spelling());
        }
    }
}
