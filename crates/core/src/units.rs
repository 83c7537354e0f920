//! Widths of a reflectance lobe, each in its own type, so that no bare float is ever "roughness".
//!
//! All of them say how far the microfacet normals stray; they differ in the quantity that is linear.
//! Conversions are named methods, and each states its source in `docs/notation.md`.

use std::fmt;

/// Error of a width that is out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{unit} must be {range}, not {value}")]
pub struct UnitError {
    unit: &'static str,
    range: &'static str,
    value: f64,
}

macro_rules! unit {
    ($(#[$doc:meta])* $name:ident, $label:literal, $range:literal, $valid:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
        pub struct $name(f64);

        impl $name {
            #[doc = concat!("Accepts a value that is ", $range, ".")]
            ///
            /// # Errors
            /// [`UnitError`] for any other value, NaN included.
            pub fn new(value: f64) -> Result<Self, UnitError> {
                let valid: fn(f64) -> bool = $valid;
                if valid(value) { Ok(Self(value)) } else { Err(UnitError { unit: $label, range: $range, value }) }
            }

            /// The number itself.
            #[must_use]
            pub fn get(self) -> f64 {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

unit!(
    /// Width `alpha` of a Beckmann or GGX lobe: the root of twice the slope variance on one axis.
    Alpha, "alpha", "between 0.0001 and 1", |v| (1e-4..=1.0).contains(&v)
);
unit!(
    /// The slider that artists see; its square is [`Alpha`].
    PerceptualRoughness, "perceptual roughness", "between 0.01 and 1", |v| (1e-2..=1.0).contains(&v)
);
unit!(
    /// Variance of the surface slope on one axis, dimensionless. Zero is a mirror.
    SlopeVariance, "slope variance", "finite and at least 0", |v| v.is_finite() && v >= 0.0
);
unit!(
    /// Exponent `s` of a Blinn-Phong lobe.
    Exponent, "exponent", "between 0.001 and 1e6", |v| (1e-3..=1e6).contains(&v)
);
unit!(
    /// Width `sigma` of Han et al.'s Torrance-Sparrow lobe, in radians.
    LobeAngle, "sigma", "between 0.0001 and 1", |v| (1e-4..=1.0).contains(&v)
);

impl From<PerceptualRoughness> for Alpha {
    fn from(r: PerceptualRoughness) -> Self {
        Self(r.0 * r.0)
    }
}

impl From<Alpha> for PerceptualRoughness {
    fn from(a: Alpha) -> Self {
        Self(a.0.sqrt())
    }
}

impl From<Alpha> for SlopeVariance {
    /// `alpha² / 2` (Beckmann is a Gaussian of slopes; GGX borrows the rule).
    fn from(a: Alpha) -> Self {
        Self(a.0 * a.0 / 2.0)
    }
}

impl TryFrom<SlopeVariance> for Alpha {
    type Error = UnitError;

    /// The GGX lobe as wide as that, by the same rule.
    fn try_from(variance: SlopeVariance) -> Result<Self, UnitError> {
        Self::new((2.0 * variance.0).sqrt())
    }
}

impl From<Exponent> for SlopeVariance {
    /// `1 / s`, the width for which Han et al.'s `s' = kappa s / (kappa + s)` is an addition of variances.
    fn from(s: Exponent) -> Self {
        Self(1.0 / s.0)
    }
}

impl From<LobeAngle> for SlopeVariance {
    /// `2 sigma²`: the lobe `exp(-beta²/(4 sigma²))` has that variance on each axis (Han et al., section
    /// 6.2).
    fn from(sigma: LobeAngle) -> Self {
        Self(2.0 * sigma.0 * sigma.0)
    }
}

impl PerceptualRoughness {
    /// Least of the slider: nearly a mirror.
    pub const SMOOTHEST: Self = Self(1e-2);
}

impl SlopeVariance {
    /// No spread at all.
    pub const ZERO: Self = Self(0.0);

    /// Variance of at least zero: clamps rounding below zero, and NaN, to zero.
    #[must_use]
    pub fn clamped(value: f64) -> Self {
        Self(if value > 0.0 { value.min(f64::MAX) } else { 0.0 })
    }

    /// Convolution of two lobes adds their variances.
    #[must_use]
    pub fn widen(self, by: Self) -> Self {
        Self(self.0 + by.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_held() {
        assert!(Alpha::new(f64::NAN).is_err());
        assert!(Alpha::new(0.0).is_err());
        assert!(Exponent::new(-1.0).is_err());
        assert!(SlopeVariance::new(f64::INFINITY).is_err());
        let message = Alpha::new(2.0).unwrap_err().to_string();
        assert_eq!(message, "alpha must be between 0.0001 and 1, not 2");
    }

    #[test]
    fn conversions_round_trip() {
        let r = PerceptualRoughness::new(0.4).unwrap();
        let a = Alpha::from(r);
        assert!((a.get() - 0.16).abs() < 1e-15);
        assert!((PerceptualRoughness::from(a).get() - 0.4).abs() < 1e-15);
        assert!((SlopeVariance::from(a).get() - 0.0128).abs() < 1e-15);
    }
}
