//! `fixed`: the reflectance stays as it is, whatever the distance. The do-nothing baseline.
//!
//! The lobe of the finest level around the filtered normal, where the normal is filtered as two-channel
//! (BC5) normal maps are in most engines: mean of `n.xy`, z rebuilt. It is also Tan et al.'s "fixed BRDF"
//! (2005, section 4): one planar lobe at `E[n.xy]` whose width never changes.

use std::fmt::{self, Display};

use glam::{DVec2, DVec3, Vec2};

use super::mixture::Response;
use super::naive::UnitMean;
use super::{Describe, Encoding, Form, FormKind, Representation, Row, Sample, table::no_parameters};
use crate::brdf::Lobe;
use crate::shader::Shader;

/// The do-nothing baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fixed;

pub(super) const ROW: Row = Row {
    name: "fixed",
    aliases: &[],
    parameters: "",
    summary: "the fine lobe around the filtered n.xy, z rebuilt: what two-channel normal maps do",
    paper: "Tan et al. 2005 (baseline)",
    parse: |words| no_parameters(words, Fixed),
    samples: &["fixed"],
};

impl Display for Fixed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(ROW.name)
    }
}

impl Describe for Fixed {
    fn encoding(&self) -> Encoding {
        Encoding::MeanXy
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[include_str!("fixed.wgsl"), include_str!("sphere_response.wgsl")])
    }
}

impl Representation for Fixed {
    type Sums = Vec2;
    type Lobes = UnitMean;

    fn zero(&self) -> Vec2 {
        Vec2::ZERO
    }

    fn accumulate(&self, sums: &mut Vec2, sample: &Sample, weight: f32) {
        *sums += weight * sample.normal.truncate();
    }

    fn blend(&self, sums: &mut Vec2, part: &Vec2, weight: f32) {
        *sums += weight * *part;
    }

    fn pack(&self, sums: &Vec2, channels: &mut [f32]) {
        channels.copy_from_slice(&[sums.x, sums.y, 1.0, 1.0]);
    }

    fn unpack(&self, channels: &[f32]) -> Vec2 {
        Vec2::new(channels[0], channels[1])
    }

    fn decode(&self, sums: &Vec2) -> UnitMean {
        let xy: DVec2 = sums.as_dvec2();
        UnitMean::new(xy.extend((1.0 - xy.length_squared()).max(0.0).sqrt()))
    }

    fn form<'a>(&'a self, lobes: &UnitMean) -> Form<'a> {
        Form::Lobes(vec![lobes.alone()], Response::Sphere)
    }

    fn effective<'a>(&'a self, lobes: &UnitMean, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        lobes.effective(lobe)
    }
}
