//! Distributions of microfacets in closed form: `D` and its inverse, for sampling and blurring.

use std::f64::consts::PI;

/// Kind of microfacet distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Microfacets {
    /// Beckmann: Gaussian slopes (Walter et al. 2007, equation 25).
    Beckmann,
    /// GGX, or Trowbridge-Reitz (Walter et al. 2007, equation 33).
    Ggx,
}

impl Microfacets {
    /// `D`: area of facets per solid angle of their normals, per unit of macro-surface area, at the angle to
    /// the normal of this squared cosine and squared sine. Both are passed, since near the normal `1 - cos²`
    /// has few digits left.
    #[must_use]
    pub fn d(self, alpha_squared: f64, cos_squared: f64, sin_squared: f64) -> f64 {
        match self {
            Self::Beckmann => {
                (-sin_squared / (cos_squared * alpha_squared)).exp()
                    / (PI * alpha_squared * cos_squared * cos_squared)
            }
            Self::Ggx => {
                // The printed (alpha² - 1) cos² + 1 without its cancellation.
                let root = sin_squared + alpha_squared * cos_squared;
                alpha_squared / (PI * root * root)
            }
        }
    }

    /// [`Self::d`] at a squared tangent.
    #[must_use]
    pub fn d_of_tangent(self, alpha_squared: f64, tan_squared: f64) -> f64 {
        let cos_squared = 1.0 / (1.0 + tan_squared);
        self.d(alpha_squared, cos_squared, tan_squared * cos_squared)
    }

    /// Squared tangent of the angle to the normal within which this share, 0 to 1, of the facets' projected
    /// area lies (Walter et al. 2007, equations 28 and 35).
    #[must_use]
    pub fn quantile(self, alpha_squared: f64, share: f64) -> f64 {
        match self {
            Self::Beckmann => -alpha_squared * (-share).ln_1p(),
            Self::Ggx => alpha_squared * share / (1.0 - share),
        }
    }
}
