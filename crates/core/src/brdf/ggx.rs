//! GGX (Trowbridge-Reitz): `D(u) = alpha² / (pi ((alpha²-1) u² + 1)²)`, w the half-vector. Walter et al.
//! 2007, equation 33.
//!
//! Widening borrows Beckmann's rule, `alpha'² = alpha² + 2v`, as every engine does: GGX is no Gaussian and
//! has no variance, so this is a convention; `compare` measures what it costs. Zonal coefficients by
//! quadrature.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Display};

use super::{AnyLobe, Lobe, Microfacets, Row, Widen, number, twin};
use crate::units::{Alpha, PerceptualRoughness, SlopeVariance};

/// A GGX distribution of microfacets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    alpha_squared: f64,
}

impl Ggx {
    /// A lobe of this width.
    #[must_use]
    pub fn new(alpha: Alpha) -> Self {
        Self { alpha_squared: alpha.get() * alpha.get() }
    }
}

pub(super) const ROW: Row = Row {
    name: "ggx",
    parameter: ":ALPHA",
    summary: "GGX (Trowbridge-Reitz) microfacet distribution D(n·h); alpha is roughness²",
    parse: |text| Ok(AnyLobe::from(Ggx::new(number(text, Alpha::new)?))),
    samples: &["ggx:0.1", "ggx:0.4"],
};

/// GGX by the number of material editors.
pub(super) const ROUGHNESS: Row = Row {
    name: "roughness",
    parameter: ":R",
    summary: "GGX by the roughness of glTF and of material editors: alpha is its square",
    parse: |text| Ok(AnyLobe::from(Ggx::new(number(text, PerceptualRoughness::new)?.into()))),
    samples: &["roughness:0.45"],
};

impl Display for Ggx {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", ROW.name, self.alpha_squared.sqrt())
    }
}

impl Widen for Ggx {
    fn widened(&self, by: SlopeVariance) -> Self {
        Self { alpha_squared: self.alpha_squared + 2.0 * by.get() }
    }
}

impl Lobe for Ggx {
    fn evaluate(&self, u: f64) -> f64 {
        if u <= 0.0 {
            return 0.0;
        }
        let u2 = (u * u).min(1.0);
        Microfacets::Ggx.d(self.alpha_squared, u2, 1.0 - u2)
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        Some(SlopeVariance::clamped(self.alpha_squared / 2.0))
    }

    /// Walter et al.'s equation 34.
    fn masking(&self, u: f64, width: SlopeVariance) -> f64 {
        let tan_squared = ((1.0 - u * u) / (u * u)).max(0.0);
        2.0 / (1.0 + (1.0 + 2.0 * width.get() * tan_squared).sqrt())
    }

    /// Student's t of two degrees, on two axes.
    fn slope_profile(&self, square: f64) -> f64 {
        (2.0 * PI * (1.0 + 0.5 * square).powi(2)).recip()
    }

    /// Walter et al.'s equation 34 read as an area. It holds for negative means too: slopes seen along a
    /// plane are Student's t of two degrees.
    fn visible_area(&self, mean: f64, deviation: f64) -> f64 {
        let spread = 2.0 * deviation * deviation;
        let root = (mean * mean + spread).sqrt();
        // For a negative mean, in the form whose two terms do not cancel.
        if mean < 0.0 { spread / (root - mean) / 2.0 } else { (mean + root) / 2.0 }
    }

    fn microfacets(&self) -> Microfacets {
        Microfacets::Ggx
    }

    fn as_beckmann(&self) -> Option<super::Beckmann> {
        None
    }

    fn shader(&self) -> Cow<'static, str> {
        [include_str!("ggx.wgsl"), twin::UNTINTED].join("\n").into()
    }

    fn base(&self) -> f64 {
        self.alpha_squared
    }
}
