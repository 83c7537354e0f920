//! `toksvig`: the mean normal, whose shortening widens the lobe. Toksvig 2005, "Mipmapping Normal Maps".
//!
//! With `L = |E[n]|`, Blinn-Phong's exponent becomes `f_t s`, `f_t = L/(L + s(1-L))`, scaled by
//! `(1 + f_t s)/(1 + s)`. That is a convolution with a lobe of slope variance `(1-L)/L`, and so the rule is
//! carried to every other BRDF; for normalised Blinn-Phong it is the printed formula exactly.

use std::fmt::{self, Display};

use glam::{DVec3, Vec3};

use super::mixture::{NormalLobe, Response};
use super::{
    Decoded, Describe, Encoding, Form, FormKind, Representation, Row, Sample, direction_or_up,
    table::no_parameters,
};
use crate::brdf::Lobe;
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Toksvig's rule: a single isotropic lobe from the length of the mean normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Toksvig;

pub(super) const ROW: Row = Row {
    name: "toksvig",
    aliases: &[],
    parameters: "",
    summary: "the lobe widened by the shortening of the mean normal",
    paper: "Toksvig 2005",
    parse: |words| no_parameters(words, Toksvig),
    samples: &["toksvig"],
};

/// An isotropic lobe of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanLobe {
    /// Mean normal, of length `L` at most 1.
    pub mean: DVec3,
    /// Spread about it.
    pub variance: SlopeVariance,
}

impl From<MeanLobe> for Decoded {
    fn from(lobe: MeanLobe) -> Self {
        Self::Mean(lobe.mean)
    }
}

/// Shortest mean normal that still widens; below it (normals in all directions) the lobe is as wide as
/// a lobe can be said to be.
const MIN_LENGTH: f64 = 1e-3;

impl Display for Toksvig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(ROW.name)
    }
}

impl Describe for Toksvig {
    fn encoding(&self) -> Encoding {
        Encoding::MeanNormal
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[include_str!("toksvig.wgsl"), include_str!("sphere_response.wgsl")])
    }
}

impl Representation for Toksvig {
    type Sums = Vec3;
    type Lobes = MeanLobe;

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

    fn decode(&self, sums: &Vec3) -> MeanLobe {
        let mean = sums.as_dvec3();
        let length = mean.length().clamp(MIN_LENGTH, 1.0);
        MeanLobe { mean, variance: SlopeVariance::clamped((1.0 - length) / length) }
    }

    fn form<'a>(&'a self, lobes: &MeanLobe) -> Form<'a> {
        Form::Lobes(vec![NormalLobe::alone(direction_or_up(lobes.mean), lobes.variance)], Response::Sphere)
    }

    fn effective<'a>(&'a self, lobes: &MeanLobe, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let (mu, widened) = (direction_or_up(lobes.mean), lobe.widen(lobes.variance));
        Box::new(move |w| widened.evaluate(w.dot(mu)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::BlinnPhong;
    use crate::units::Exponent;
    use std::f64::consts::PI;

    #[test]
    fn is_toksvigs_formula_for_blinn_phong() {
        let s = 50.0;
        let blinn_phong = BlinnPhong { exponent: Exponent::new(s).unwrap() };
        for length in [0.2_f64, 0.7, 0.95, 1.0] {
            let lobe = Toksvig.decode(&Vec3::new(0.0, 0.0, length as f32));
            let effective = Toksvig.effective(&lobe, &blinn_phong);
            let f_t = length / (length + s * (1.0 - length));
            for u in [0.5_f64, 0.9, 1.0] {
                let w = DVec3::new((1.0 - u * u).sqrt(), 0.0, u);
                let printed = (1.0 + f_t * s) / (1.0 + s) * (s + 1.0) / (2.0 * PI) * u.powf(f_t * s);
                // The mean is stored in single precision, 6e-8, and s (1-L) magnifies it by up to 50.
                assert!((effective(w) - printed).abs() < 1e-5 * printed.max(1.0));
            }
        }
    }
}
