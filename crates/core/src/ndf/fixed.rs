//! `fixed`: the reflectance stays as it is, whatever the distance. The do-nothing baseline.
//!
//! The lobe of the finest level around the filtered normal, where the normal is filtered as two-channel
//! (BC5) normal maps are in most engines: mean of `n.xy`, z rebuilt. It is also Tan et al.'s "fixed BRDF"
//! (2005, section 4): one planar lobe at `E[n.xy]` whose width never changes.

use glam::{DVec2, DVec3, Vec2};

use super::mixture::{Cosine, NormalLobe, cosine};
use super::naive::UnitMean;
use super::{Representation, Row, Sample, no_parameters};
use crate::brdf::Lobe;
use crate::shader::Shader;

/// The do-nothing baseline.
#[derive(Clone, Copy, Debug)]
pub struct Fixed;

pub(super) const ROW: Row = Row {
    name: "fixed",
    parameters: "",
    summary: "the fine lobe around the filtered n.xy, z rebuilt: what two-channel normal maps do",
    paper: "Tan et al. 2005 (baseline)",
    parse: |words| no_parameters(words, Fixed),
    samples: &["fixed"],
};

impl Representation for Fixed {
    type Sums = Vec2;
    type Lobes = UnitMean;

    fn spelling(&self) -> String {
        ROW.name.to_owned()
    }

    fn layers(&self) -> usize {
        1
    }

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

    fn mean(&self, lobes: &UnitMean) -> DVec3 {
        lobes.alone().mean
    }

    fn effective<'a>(&'a self, lobes: &UnitMean, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        lobes.effective(lobe)
    }

    fn shader(&self) -> Shader {
        Shader::new(&[
            include_str!("fixed.wgsl"),
            include_str!("sphere_cosine.wgsl"),
            include_str!("mixture.wgsl"),
        ])
    }

    fn isotropic(&self, lobes: &UnitMean) -> Option<(Cosine, Vec<NormalLobe>)> {
        Some((cosine, vec![lobes.alone()]))
    }
}
