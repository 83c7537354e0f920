//! Torrance-Sparrow as Han et al. 2007 use it: `f = exp(-beta²/(4 sigma²)) / (4 pi sigma²)`, beta the angle
//! between normal and half-vector, without the geometric and Fresnel factors, which do not depend on n.
//!
//! Zonal coefficients by quadrature; the paper prints `exp(-(sigma l)²)`. Widening (their section 6.2):
//! `sigma' = sqrt(sigma² + 1/(2 kappa))`. The lobe ends at the horizon, beta = 90°.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Display};

use super::{AnyLobe, Lobe, Row, Widen, number, twin};
use crate::units::{LobeAngle, SlopeVariance};

/// A Gaussian of the angle to the half-vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorranceSparrow {
    sigma_squared: f64,
}

impl TorranceSparrow {
    /// A lobe of this width.
    #[must_use]
    pub fn new(sigma: LobeAngle) -> Self {
        Self { sigma_squared: sigma.get() * sigma.get() }
    }
}

pub(super) const ROW: Row = Row {
    name: "torrance-sparrow",
    parameter: ":SIGMA",
    summary: "Gaussian of the half-vector's angle, sigma in radians",
    parse: |text| Ok(AnyLobe::from(TorranceSparrow::new(number(text, LobeAngle::new)?))),
    samples: &["torrance-sparrow:0.05", "torrance-sparrow:0.2"],
};

impl Display for TorranceSparrow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", ROW.name, self.sigma_squared.sqrt())
    }
}

impl Widen for TorranceSparrow {
    fn widened(&self, by: SlopeVariance) -> Self {
        Self { sigma_squared: self.sigma_squared + by.get() / 2.0 }
    }
}

impl Lobe for TorranceSparrow {
    fn evaluate(&self, u: f64) -> f64 {
        if u <= 0.0 {
            return 0.0;
        }
        let beta = u.min(1.0).acos();
        (-beta * beta / (4.0 * self.sigma_squared)).exp() / (4.0 * PI * self.sigma_squared)
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        Some(SlopeVariance::clamped(2.0 * self.sigma_squared))
    }

    fn shader(&self) -> Cow<'static, str> {
        [include_str!("torrance_sparrow.wgsl"), twin::GAUSSIAN_FACETS, twin::SLOPE_PROFILE, twin::UNTINTED]
            .join("\n")
            .into()
    }

    fn base(&self) -> f64 {
        self.sigma_squared
    }

    fn zonal_as_printed(&self, order: usize) -> Option<Vec<f64>> {
        Some((0..=order).map(|l| (-self.sigma_squared * (l * l) as f64).exp()).collect())
    }
}
