//! `naive`: the mean normal, renormalised after filtering; the lobe unchanged.
//!
//! "Normalised MIP-mapping" of Han et al. 2007, figure 2. It keeps the direction and forgets the spread,
//! so highlights stay as sharp as on the finest level.

use std::fmt::{self, Display};

use glam::{DVec3, Vec3};

use super::mixture::{NormalLobe, Response};
use super::{
    AnyMethod, Decoded, Describe, Encoding, Form, FormKind, ParameterError, Representation, Row, Sample,
    direction_or_up,
};
use crate::brdf::Lobe;
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Normalised mip-mapping.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Naive {
    /// True for a mean that is not renormalised.
    unnormalised: bool,
}

pub(super) const ROW: Row = Row {
    name: "naive",
    aliases: &[],
    parameters: "[:unnormalised]",
    summary: "the fine lobe around the mean normal, renormalised; or `unnormalised`, as short as it comes",
    paper: "Han et al. 2007, figure 2 (baselines)",
    parse,
    samples: &["naive", "naive:unnormalised"],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    match words {
        [] => Ok(AnyMethod::from(Naive::default())),
        ["unnormalised"] => Ok(AnyMethod::from(Naive::default().unnormalised())),
        _ => Err(ParameterError::Words("takes `unnormalised`, or nothing".to_owned())),
    }
}

impl Naive {
    /// Returns it with the mean normal as short as filtering leaves it: "unnormalised MIP-mapping", which
    /// Han et al. find essentially black.
    #[must_use]
    pub fn unnormalised(self) -> Self {
        Self { unnormalised: true }
    }
}

/// A single mean normal, and nothing else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitMean {
    direction: DVec3,
}

impl UnitMean {
    /// The direction of `v`; `(0,0,1)` when it has none.
    pub(super) fn new(v: DVec3) -> Self {
        Self { direction: direction_or_up(v) }
    }

    /// The direction as a lobe without spread.
    pub(super) fn alone(&self) -> NormalLobe {
        NormalLobe::alone(self.direction, SlopeVariance::ZERO)
    }

    /// The lobe itself, around the direction.
    pub(super) fn effective<'a>(&self, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let n = self.direction;
        Box::new(move |w| lobe.evaluate(w.dot(n)))
    }
}

impl From<UnitMean> for Decoded {
    fn from(lobe: UnitMean) -> Self {
        Self::Mean(lobe.direction)
    }
}

impl Display for Naive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(ROW.name)?;
        f.write_str(if self.unnormalised { ":unnormalised" } else { "" })
    }
}

impl Describe for Naive {
    fn encoding(&self) -> Encoding {
        Encoding::MeanNormal
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[include_str!("naive.wgsl")]).constant("SHORT", self.unnormalised)
    }
}

impl Representation for Naive {
    type Sums = Vec3;
    type Lobes = UnitMean;

    fn zero(&self) -> Vec3 {
        Vec3::ZERO
    }

    fn accumulate(&self, sums: &mut Vec3, sample: &Sample, weight: f32) {
        *sums += weight * sample.normal;
    }

    fn blend(&self, sums: &mut Vec3, part: &Vec3, weight: f32) {
        *sums += weight * *part;
    }

    fn pack(&self, sums: &Vec3, channels: &mut [f32]) {
        channels.copy_from_slice(&sums.extend(1.0).to_array());
    }

    fn unpack(&self, channels: &[f32]) -> Vec3 {
        Vec3::from_slice(channels)
    }

    fn decode(&self, sums: &Vec3) -> UnitMean {
        if self.unnormalised {
            return UnitMean { direction: sums.as_dvec3() };
        }
        UnitMean::new(sums.as_dvec3())
    }

    fn form<'a>(&'a self, lobes: &UnitMean) -> Form<'a> {
        let response = if self.unnormalised { Response::Short } else { Response::Sphere };
        Form::Lobes(vec![lobes.alone()], response)
    }

    fn effective<'a>(&'a self, lobes: &UnitMean, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        lobes.effective(lobe)
    }
}
