//! Decoded texels, for people and scripts to look at.

use glam::{DMat3, DVec2, DVec3};

use super::NormalLobe;

/// Decoded texel. Callers that write it match every variant, and are told by the compiler of a new one.
#[derive(Clone, Debug, PartialEq)]
pub enum Decoded {
    /// A mean normal: unit length for `naive` and `fixed`, shorter for `toksvig`.
    Mean(DVec3),
    /// A Gaussian in space.
    Gaussian {
        /// Mean normal.
        mean: DVec3,
        /// Covariance of the normals.
        covariance: DMat3,
    },
    /// A Gaussian of slopes.
    Slopes {
        /// Mean height in texture widths.
        height: f64,
        /// Mean slope.
        mean: DVec2,
        /// Covariance of the slopes: xx, yy, xy.
        covariance: [f64; 3],
    },
    /// A Gaussian of `n.xy/(1 + n.z)`, normals seen on the plane from the pole below.
    Projected {
        /// Mean.
        mean: DVec2,
        /// Covariance: xx, yy, xy.
        covariance: [f64; 3],
    },
    /// Real spherical-harmonic coefficients: l, then m from -l to l.
    Coefficients(Vec<f64>),
    /// Von Mises-Fisher lobes on the sphere that are alive; the variance of each is `1/kappa`.
    Lobes(Vec<NormalLobe>),
    /// Phong peaks, the exponent of each one over its variance.
    Peaks(Vec<NormalLobe>),
    /// Gaussian lobes in the plane of `n.xy` that are alive; means are `(x, y, 0)`.
    PlanarLobes(Vec<NormalLobe>),
}

impl Decoded {
    /// Lobes, where the texel is lobes.
    #[must_use]
    pub fn lobes(&self) -> &[NormalLobe] {
        match self {
            Self::Lobes(lobes) | Self::Peaks(lobes) | Self::PlanarLobes(lobes) => lobes,
            _ => &[],
        }
    }
}
