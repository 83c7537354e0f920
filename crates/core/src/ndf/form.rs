//! Forms: the three ways in which a decoded texel is shaded.

use glam::DVec3;

use super::mixture::{NormalLobe, Response, mean_of};
use super::{SlopeGaussian, SlopeGrid, direction_or_up};
use crate::surface::normal_of_slope;
use crate::units::SlopeVariance;

/// Form of a method's texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormKind {
    /// Sums of isotropic lobes, each shaded by itself.
    Lobes,
    /// Gaussians of slopes, which know displacement and environments as LEADR has them.
    Slopes,
    /// A single distribution, shaded by its effective lobe.
    Whole,
}

impl FormKind {
    /// Number of the form in shaders.
    #[must_use]
    pub fn index(self) -> u32 {
        self as u32
    }
}

/// Decoded texel, as it is shaded.
pub enum Form<'a> {
    /// Isotropic lobes, and how they answer.
    Lobes(Vec<NormalLobe>, Response),
    /// A Gaussian of slopes, and the slopes over which diffuse facets and environments are averaged.
    Slopes(SlopeGaussian, &'a SlopeGrid),
    /// A single distribution, with this mean normal: the shorter, the further the normals stray.
    Whole(DVec3),
}

impl Form<'_> {
    /// Form, without its numbers.
    #[must_use]
    pub fn kind(&self) -> FormKind {
        match self {
            Self::Lobes(..) => FormKind::Lobes,
            Self::Slopes(..) => FormKind::Slopes,
            Self::Whole(_) => FormKind::Whole,
        }
    }

    /// Mean normal, whose length says how far the normals stray.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        match self {
            Self::Lobes(lobes, _) => mean_of(lobes),
            Self::Slopes(g, _) => {
                normal_of_slope(g.mean.as_vec2()).as_dvec3()
                    / (1.0 + 0.5 * (g.covariance[0] + g.covariance[1]))
            }
            Self::Whole(mean) => *mean,
        }
    }

    /// Isotropic lobe of normals most like the texel: of its mean direction, as wide as the mean is short.
    #[must_use]
    pub fn whole(&self) -> NormalLobe {
        let mean = self.mean();
        let length = mean.length().clamp(1e-3, 1.0);
        NormalLobe::alone(direction_or_up(mean), SlopeVariance::clamped((1.0 - length) / length))
    }
}
