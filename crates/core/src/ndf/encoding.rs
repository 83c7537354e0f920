//! Encodings: what the channels of a stored map are, apart from the methods that read them.
//!
//! Several methods may read one encoding: `slopes:9` what `slopes` has stored, `naive` what `toksvig` has,
//! `sh:4` what `sh:7` has. [`super::Describe::reads`] says which.

use super::NdmFactors;
use crate::fit::LobeKind;

/// Encoding: the meaning of a stored map's channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// Mean of `n.xy`.
    MeanXy,
    /// Mean of the normal.
    MeanNormal,
    /// First and second moments of `n - (0, 0, 1)`.
    PoleMoments {
        /// Density for which the spare channels hold normalisation factors; `None` where they hold ones.
        factors: Option<NdmFactors>,
    },
    /// Mean height, first and second moments of the slope.
    SlopeMoments,
    /// First and second moments of `n.xy/(1 + n.z)`, and the mean normal.
    ProjectedMoments,
    /// Coefficients of real spherical harmonics.
    Harmonics {
        /// Highest order.
        order: usize,
    },
    /// Sums of fitted lobes, or peaks.
    Lobes {
        /// Kind of the lobes.
        kind: LobeKind,
        /// Lobes of a texel.
        count: usize,
        /// Form in which a lobe's sums are stored.
        sums: StoredSums,
    },
}

/// Form in which the sums of a fitted lobe are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoredSums {
    /// As fitting makes them, or for lobes on the sphere about the origin, as Han et al. have them.
    Plain,
    /// About the pole: `alpha (1 - r.z)` in place of `alpha r.z`.
    AboutPole,
    /// As Tan et al. print them, variances on one axis among moments on two.
    AsPrinted,
}

/// Layers in which the lobes of a texel, and what they carry, are stored.
///
/// A lobe fills [`Self::layers_each`] layers, one lobe after another; behind them all follows, for each
/// attribute, one layer a lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LobeLayout {
    /// Lobes of a texel.
    pub count: usize,
    /// RGBA layers of a lobe.
    pub layers_each: usize,
}

impl LobeLayout {
    /// First layer of a lobe.
    #[must_use]
    pub fn layer(self, lobe: usize) -> usize {
        lobe * self.layers_each
    }

    /// Layer in which a lobe carries an attribute, times its weight.
    #[must_use]
    pub fn attribute_layer(self, attribute: usize, lobe: usize) -> usize {
        self.layers(attribute) + lobe
    }

    /// Layers of all lobes, with so many attributes.
    #[must_use]
    pub fn layers(self, attributes: usize) -> usize {
        self.count * (self.layers_each + attributes)
    }

    /// Value of an attribute that a lobe carries, from a texel's channels; `None` where the texel has no such
    /// layer.
    #[must_use]
    pub fn attribute(self, channels: &[f32], attribute: usize, lobe: usize) -> Option<[f32; 4]> {
        if lobe >= self.count {
            return None;
        }
        // An attribute is stored times the lobe's weight, which comes first in the lobe's own layer.
        let weight = channels.get(4 * self.layer(lobe))?.max(f32::MIN_POSITIVE);
        let stored = channels.get(4 * self.attribute_layer(attribute, lobe)..)?.first_chunk::<4>()?;
        Some(stored.map(|value| value / weight))
    }
}

impl Encoding {
    /// Name of the kind of channels, as the header of a file has it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lobes { kind: LobeKind::Peaks, .. } => "peaks",
            Self::Lobes { sums: StoredSums::AsPrinted, .. } => "sums-as-printed",
            Self::Lobes { sums: StoredSums::AboutPole, .. } | Self::PoleMoments { .. } => "sums-about-pole",
            _ => "sums",
        }
    }

    /// RGBA layers, without attributes.
    #[must_use]
    pub fn layers(self) -> usize {
        match self {
            Self::PoleMoments { .. } => 3,
            Self::SlopeMoments | Self::ProjectedMoments => 2,
            Self::Harmonics { order } => crate::sphere::sh_count(order).div_ceil(4),
            Self::MeanXy | Self::MeanNormal | Self::Lobes { .. } => self.lobes().map_or(1, |l| l.layers(0)),
        }
    }

    /// Layout of the lobes, for channels that are lobes one by one.
    #[must_use]
    pub fn lobes(self) -> Option<LobeLayout> {
        match self {
            Self::MeanXy | Self::MeanNormal => Some(LobeLayout { count: 1, layers_each: 1 }),
            Self::Lobes { kind, count, .. } => Some(LobeLayout { count, layers_each: kind.layers() }),
            _ => None,
        }
    }
}
