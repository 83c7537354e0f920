//! Beckmann: `D(u) = exp(-tan²/alpha²) / (pi alpha² u⁴)`, w the half-vector. Walter et al. 2007, equation 25.
//!
//! A Gaussian of slopes of variance `alpha²/2`, so convolution in slope space is exact: `alpha'² = alpha² +
//! 2v`. Zonal coefficients by quadrature: their moments have an upward recurrence, but it loses all digits
//! for small alpha.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Display};

use super::{AnyLobe, Lobe, Microfacets, Row, Widen, number, twin};
use crate::units::{Alpha, SlopeVariance};

/// A Beckmann distribution of microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beckmann {
    alpha_squared: f64,
}

impl Beckmann {
    /// A lobe of this width.
    #[must_use]
    pub fn new(alpha: Alpha) -> Self {
        Self { alpha_squared: alpha.get() * alpha.get() }
    }

    /// A lobe of slopes of this variance.
    #[must_use]
    pub fn of_width(width: SlopeVariance) -> Self {
        Self { alpha_squared: 2.0 * width.get() }
    }
}

pub(super) const ROW: Row = Row {
    name: "beckmann",
    parameter: ":ALPHA",
    summary: "Beckmann microfacet distribution D(n·h)",
    parse: |text| Ok(AnyLobe::from(Beckmann::new(number(text, Alpha::new)?))),
    samples: &["beckmann:0.1", "beckmann:0.4"],
};

/// Masking of facets at cosine `u > 0`, in Walter et al.'s rational form (their equation 27).
pub(super) fn masking(u: f64, width: SlopeVariance) -> f64 {
    // a = 1/(alpha tan), alpha² = 2 v.
    let tan_squared = ((1.0 - u * u) / (u * u)).max(0.0);
    let a = 1.0 / (2.0 * width.get() * tan_squared).sqrt();
    if a < 1.6 { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) } else { 1.0 }
}

impl Display for Beckmann {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", ROW.name, self.alpha_squared.sqrt())
    }
}

impl Widen for Beckmann {
    fn widened(&self, by: SlopeVariance) -> Self {
        Self { alpha_squared: self.alpha_squared + 2.0 * by.get() }
    }
}

impl Lobe for Beckmann {
    fn evaluate(&self, u: f64) -> f64 {
        // Below 1e-6 the exponential has underflowed for alpha up to 1, and u⁴ is about to underflow for any
        // alpha.
        if u <= 1e-6 {
            return 0.0;
        }
        let u2 = (u * u).min(1.0);
        Microfacets::Beckmann.d(self.alpha_squared, u2, 1.0 - u2)
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        Some(SlopeVariance::clamped(self.alpha_squared / 2.0))
    }

    /// Slope profile of Beckmann: the Gaussian itself.
    fn slope_profile(&self, square: f64) -> f64 {
        (-0.5 * square).exp() / (2.0 * PI)
    }

    fn as_beckmann(&self) -> Option<Self> {
        None
    }

    fn shader(&self) -> Cow<'static, str> {
        [include_str!("beckmann.wgsl"), twin::GAUSSIAN_FACETS, twin::UNTINTED].join("\n").into()
    }

    fn base(&self) -> f64 {
        self.alpha_squared
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masking_follows_the_exact_form() {
        // Smith's integral, 1/(1+L), L = (exp(-a²)/(a sqrt pi) - erfc a)/2; Walter et al. state 0.35 % for
        // their form.
        for u in [0.9_f64, 0.5, 0.2, 0.05] {
            for alpha in [0.1_f64, 0.5, 1.0] {
                let a = u / (alpha * (1.0 - u * u).sqrt());
                let lambda = 0.5 * ((-a * a).exp() / (a * PI.sqrt()) - libm::erfc(a));
                let got = masking(u, SlopeVariance::clamped(alpha * alpha / 2.0));
                assert!((got * (1.0 + lambda) - 1.0).abs() < 0.0036, "{u} {alpha}");
            }
        }
    }
}
