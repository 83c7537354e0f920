//! Measured lobes: `kd + f(theta_h) g(theta_d)`, f a sum of kernels that widen in closed form, g a colour.
//!
//! Han et al. 2007, section 4, take measured materials in the factored form of Lawrence et al. 2006: f is a
//! lobe around the half-vector, and g does not depend on the normal. The factors are fitted to a table of
//! measurements (`factor.rs`), or to a table of values of a published fit (`analytic.rs`); [`Residual`] has
//! the error that this leaves. f is stored as a sum of von Mises-Fisher kernels, none of negative weight:
//! convolving with a lobe of normals adds its variance to each kernel's, which is what the paper's zonal
//! series `Σ Lambda_l rho_l Y_l0` does order by order, without its hundreds of orders for a shiny material
//! (`docs/decisions.md`). With Han et al.'s factor `max(n·wi, 0)` the lobe is the measured reflectance
//! itself.

mod analytic;
mod factor;

pub use factor::{BINS, Residual, half_angle};

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Display, Write as _};
use std::sync::Arc;

use glam::DVec3;

use super::{AnyLobe, Lobe, Microfacets, Row, Widen, twin};
use crate::units::SlopeVariance;
use crate::words;

/// A measured lobe.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Name, as on the command line.
    name: String,
    fit: Arc<LobeFactors>,
    /// Slope variance that widened it.
    widened: SlopeVariance,
}

/// The factors of a material.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeFactors {
    /// Diffuse albedo, linear RGB: pi times the constant part.
    pub diffuse: DVec3,
    /// Kernels of f: weight, and variance on one axis.
    pub kernels: Vec<(f64, f64)>,
    /// `g cos² theta_d` as a polynomial in `1 - cos theta_d`, from the constant up; below zero it counts as
    /// zero.
    pub tint: [DVec3; 6],
    /// Error that the fit leaves.
    pub residual: Residual,
}

pub(super) const SGD: Row = Row {
    name: "sgd",
    parameter: ":NAME",
    summary: "a MERL material by its fit of Bagher, Soler and Holzschuch 2012, factored, in its own colours",
    parse: |name| Ok(AnyLobe::from(Measured::published(PublishedFit::Sgd, name)?)),
    samples: &["sgd:blue-fabric", "sgd:gold-metallic-paint"],
};

pub(super) const ABC: Row = Row {
    name: "abc",
    parameter: ":NAME",
    summary: "a MERL material by its fit of Löw et al. 2012, factored, in its own colours",
    parse: |name| Ok(AnyLobe::from(Measured::published(PublishedFit::Abc, name)?)),
    samples: &["abc:pearl-paint"],
};

/// Published fits of the hundred MERL materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PublishedFit {
    /// Shifted gamma: Bagher, Soler and Holzschuch 2012.
    Sgd,
    /// ABC: Löw et al. 2012.
    Abc,
}

words!(PublishedFit { Sgd => "sgd", Abc => "abc" });

/// Names of the materials with published fits.
#[must_use]
pub fn materials() -> Vec<&'static str> {
    analytic::names()
}

/// Reflectance of a published fit for unit directions to the light and the eye about the normal z, RGB.
///
/// # Errors
/// A sentence that says what is wrong with the name, and which is nearest.
pub fn published(fit: PublishedFit, name: &str) -> Result<impl Fn(DVec3, DVec3) -> DVec3 + use<>, String> {
    analytic::find(fit, name).map(|material| move |wi, wo| material.reflectance(wi, wo))
}

impl Measured {
    /// The material of this name, factored from a published fit.
    ///
    /// # Errors
    /// A sentence that says what is wrong with the name, and which is nearest.
    pub fn published(fit: PublishedFit, name: &str) -> Result<Self, String> {
        let reflectance = published(fit, name)?;
        // Sixteen bins tell apart all that the fits depend on.
        Ok(Self::new(&format!("{fit}:{name}"), 16, |wi, wo, _| Some(reflectance(wi, wo))))
    }

    /// Factors a table of measurements: reflectance, RGB, for directions to the light and the eye (the normal
    /// is z). Every pair of `theta_h` and `theta_d` is asked for in `turns` bins of `phi_d` from 0 to 180
    /// degrees. The third number is the bin's, counted over all, `(theta_h × 90 + theta_d) × turns + phi_d`.
    /// `None` where nothing was measured.
    #[must_use]
    pub fn new(name: &str, turns: usize, reflectance: impl Fn(DVec3, DVec3, usize) -> Option<DVec3>) -> Self {
        let fit = factor::factor(turns, reflectance);
        Self { name: name.to_owned(), fit: fit.into(), widened: SlopeVariance::ZERO }
    }

    /// Variance of the lobe as it was fitted: that of a Gaussian of the same height and light.
    fn own_variance(&self) -> f64 {
        let (light, height) =
            self.fit.kernels.iter().fold((0.0, 0.0), |(light, height), (weight, variance)| {
                (light + weight, height + weight * kernel(*variance, 1.0))
            });
        if light > 0.0 { light / (2.0 * PI * height) } else { 0.1 }
    }
}

/// A von Mises-Fisher kernel of this variance, `1/kappa`, at the cosine `u`; it integrates to one over the
/// sphere.
fn kernel(variance: f64, u: f64) -> f64 {
    let kappa = 1.0 / variance;
    kappa / (2.0 * PI * -(-2.0 * kappa).exp_m1()) * (kappa * (u - 1.0)).exp()
}

/// Least cosine whose square divides g: 87 degrees, where measurements end.
const LEAST_COSINE: f64 = 0.05;

/// g from its polynomial, at the cosine of `theta_d`.
fn colour(tint: &[DVec3; 6], u: f64) -> DVec3 {
    let u = u.clamp(LEAST_COSINE, 1.0);
    tint.iter().rev().fold(DVec3::ZERO, |sum, c| sum * (1.0 - u) + *c).max(DVec3::ZERO) / (u * u)
}

impl Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl Widen for Measured {
    fn widened(&self, by: SlopeVariance) -> Self {
        Self { widened: self.widened.widen(by), ..self.clone() }
    }

    fn value_widened(&self, by: SlopeVariance, u: f64) -> f64 {
        if u <= 0.0 {
            return 0.0;
        }
        let by = self.widened.widen(by).get();
        self.fit.kernels.iter().map(|(weight, variance)| weight * kernel(variance + by, u.min(1.0))).sum()
    }
}

impl Lobe for Measured {
    fn evaluate(&self, u: f64) -> f64 {
        self.value_widened(SlopeVariance::ZERO, u)
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        Some(SlopeVariance::clamped(self.own_variance()).widen(self.widened))
    }

    fn tint(&self, u: f64) -> DVec3 {
        colour(&self.fit.tint, u)
    }

    fn measured(&self) -> Option<&LobeFactors> {
        Some(&self.fit)
    }

    fn microfacets(&self) -> Microfacets {
        Microfacets::Ggx
    }

    fn as_beckmann(&self) -> Option<super::Beckmann> {
        None
    }

    /// The numbers are written into the text.
    fn shader(&self) -> Cow<'static, str> {
        let mut text = [include_str!("measured.wgsl"), twin::GAUSSIAN_FACETS, twin::SLOPE_PROFILE].join("\n");
        let _ = write!(
            text,
            "\nconst OWN_VARIANCE: f32 = {:?};\nconst LEAST_DIFFERENCE: f32 = {LEAST_COSINE:?};\n",
            self.own_variance() as f32
        );
        text += "\n// f(u), u the cosine between normal and half-vector, widened by `base`.\nfn lobe_evaluate(base: f32, u: f32) -> f32 {\n    if u <= 0.0 {\n        return 0.0;\n    }\n    var sum = 0.0;\n";
        for (weight, variance) in &self.fit.kernels {
            let _ =
                writeln!(text, "    sum += {:?} * kernel({:?} + base, u);", *weight as f32, *variance as f32);
        }
        text += "    return sum;\n}\n\n// g, of u = wi·wh.\nfn lobe_tint(u: f32) -> vec3<f32> {\n    let held = clamp(u, LEAST_DIFFERENCE, 1.0);\n    let x = 1.0 - held;\n    var sum = vec3<f32>(0.0);\n";
        for c in self.fit.tint.iter().rev() {
            let _ = writeln!(
                text,
                "    sum = sum * x + vec3<f32>({:?}, {:?}, {:?});",
                c.x as f32, c.y as f32, c.z as f32
            );
        }
        text += "    return max(sum, vec3<f32>(0.0)) / (held * held);\n}\n";
        text.into()
    }

    /// Slope variance that widened it; the rest is in the text.
    fn base(&self) -> f64 {
        self.widened.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::zonal_by_quadrature;
    use crate::sphere::legendre;

    #[test]
    fn every_published_material_is_factored() {
        assert_eq!(materials().len(), 100);
        for name in materials() {
            let lobe = SGD.parse;
            let lobe = lobe(name).unwrap();
            assert!(lobe.evaluate(1.0).is_finite() && lobe.evaluate(1.0) >= 0.0, "{name}");
            let diffuse = lobe.measured().unwrap().diffuse;
            assert!(
                diffuse.is_finite() && diffuse.min_element() >= 0.0 && diffuse.max_element() < 1.0,
                "{name} {diffuse}"
            );
            for u in [0.0, 0.3, 1.0] {
                assert!(lobe.tint(u).is_finite() && lobe.tint(u).min_element() >= 0.0, "{name}");
            }
        }
    }

    #[test]
    fn a_material_of_the_form_is_found_again() {
        // kd + f g with f a kernel between those of the dictionary, and g a polynomial.
        let (kd, f) = (DVec3::new(0.05, 0.1, 0.02), |u: f64| 0.08 * kernel(0.0123, u));
        let g = |u: f64| DVec3::new(1.0, 0.8, 0.6) + DVec3::ONE * (1.0 - u).powi(5);
        let lobe = Measured::new("test:form", 4, |wi, wo, _| {
            let wh = (wi + wo).normalize();
            Some(kd + f(wh.z) * g(wh.dot(wi)))
        });
        assert!(lobe.fit.residual.factored < 0.01, "{:?}", lobe.fit.residual);
        assert!((lobe.fit.diffuse / PI - kd).length() < 0.01, "{}", lobe.fit.diffuse / PI);
        for (u, d) in [(1.0, 1.0), (0.99, 0.8), (0.98, 0.5)] {
            let (got, expected) = (lobe.evaluate(u) * lobe.tint(d), f(u) * g(d));
            // Two kernels of the dictionary make one between them to 1 % (so does scipy's nonnegative least
            // squares); descent has not quite ended.
            assert!((got - expected).length() < 0.03 * expected.length(), "{u}: {got} {expected}");
        }
    }

    #[test]
    fn widening_is_the_zonal_series() {
        // Han et al.'s series, to an order where it has ended: Lambda_l of normals of variance v against the
        // same added to each kernel.
        for name in ["blue-fabric", "gold-metallic-paint", "pearl-paint"] {
            let lobe = (SGD.parse)(name).unwrap();
            let v = 0.02;
            let rho = zonal_by_quadrature(&*lobe, 48);
            // A_l of the normals' lobe: A_{l-1} = A_{l+1} + (2l+1) v A_l, downwards.
            let mut ratio = vec![0.0; 200];
            for l in (1..199).rev() {
                ratio[l] = 1.0 / ((2 * l + 1) as f64 * v + ratio[l + 1]);
            }
            let peak = lobe.evaluate_widened(SlopeVariance::clamped(v), 1.0);
            for u in [1.0, 0.98, 0.9, 0.7] {
                let (mut sum, mut a) = (0.0, 1.0);
                for (l, p) in legendre(48, u).iter().enumerate() {
                    a *= if l == 0 { 1.0 } else { ratio[l] };
                    sum += (2 * l + 1) as f64 / (4.0 * PI) * a * rho[l] * p;
                }
                let got = lobe.evaluate_widened(SlopeVariance::clamped(v), u);
                // Variances add exactly for Gaussians in the plane; on the sphere to some 2 % of the peak at
                // this width. The series itself rings by exp(-48² v/2), which is nothing.
                assert!((got - sum).abs() < 0.02 * peak, "{name} at {u}: {got} {sum}");
            }
        }
    }
}
