//! `sh:L`: the distribution in real spherical harmonics up to order L. Han et al. 2007, section 5.
//!
//! `gamma_lm = E[Y_lm(n)]`; the effective lobe is `Σ rho_l gamma_lm Y_lm(w)`, exact up to the cut at L, with
//! the lobe's zonal coefficients `rho_l`. Ringing below zero is clamped to zero. `sh:L:printed` uses the
//! paper's `exp` approximations of `rho_l` in place of the exact ones, to show the difference.

use std::fmt::{self, Display};

use std::f64::consts::PI;

use glam::DVec3;

use super::table::{count_of, counted};
use super::{
    AnyMethod, Decoded, Describe, Encoding, Evaluator, FlatLobe, Form, FormKind, ParameterError,
    Representation, Row, Sample,
};
use crate::brdf::Lobe;
use crate::shader::Shader;
use crate::sphere::{MAX_SH_ORDER, sh_count, spherical_harmonics};

/// Spherical harmonics up to an order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sh {
    order: usize,
    printed: bool,
}

pub(super) const ROW: Row = Row {
    name: "sh",
    aliases: &[],
    parameters: ":L[:printed]",
    summary: "spherical harmonics of order L = 2..16, exact for wide lobes and Lambert",
    paper: "Han et al. 2007, section 5",
    parse,
    samples: &["sh:2", "sh:4", "sh:7", "sh:16", "sh:7:printed"],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let (order, printed) = match words {
        [order] => (count_of(Some(order)), false),
        [order, "printed"] => (count_of(Some(order)), true),
        _ => (0, false),
    };
    let sh = Sh::new(order)?;
    Ok(AnyMethod::from(if printed { sh.printed() } else { sh }))
}

/// Room for every coefficient of the highest order, so that a texel needs no heap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    gamma: [f32; sh_count(MAX_SH_ORDER)],
    count: usize,
}

impl From<Coefficients> for Decoded {
    fn from(c: Coefficients) -> Self {
        Self::Coefficients(c.gamma[..c.count].iter().map(|g| f64::from(*g)).collect())
    }
}

impl Sh {
    /// Harmonics up to this order, 2 to [`MAX_SH_ORDER`].
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another order.
    pub fn new(order: usize) -> Result<Self, ParameterError> {
        counted(order, "order", 2..=MAX_SH_ORDER, "sh:7").map(|order| Self { order, printed: false })
    }

    /// Returns it with the paper's approximations of a lobe's zonal coefficients.
    #[must_use]
    pub fn printed(self) -> Self {
        Self { printed: true, ..self }
    }

    fn zonal(&self, lobe: &dyn Lobe) -> Vec<f64> {
        let printed = if self.printed { lobe.zonal_as_printed(self.order) } else { None };
        printed.unwrap_or_else(|| lobe.zonal(self.order))
    }

    /// `rho_l Y_lm(w)` for every l and m: the weights of the stored coefficients.
    fn weights(&self, rho: &[f64], w: DVec3) -> Vec<f64> {
        let mut weights = vec![0.0; sh_count(self.order)];
        spherical_harmonics(self.order, w, &mut weights);
        for (l, rho) in rho.iter().enumerate() {
            weights[l * l..(l + 1) * (l + 1)].iter_mut().for_each(|y| *y *= rho);
        }
        weights
    }
}

/// Sum of products, clamped where the cut series rings below zero.
fn clamped_dot(weights: &[f64], gamma: &[f32]) -> f64 {
    weights.iter().zip(gamma).map(|(w, g)| w * f64::from(*g)).sum::<f64>().max(0.0)
}

struct ShEvaluator {
    /// Weights, a run of [`sh_count`] for each direction.
    weights: Vec<f64>,
    count: usize,
}

impl Evaluator for ShEvaluator {
    fn evaluate(&self, channels: &[f32], out: &mut [f64]) {
        for (out, weights) in out.iter_mut().zip(self.weights.chunks_exact(self.count)) {
            *out = clamped_dot(weights, &channels[..self.count]);
        }
    }
}

impl Display for Sh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}{}", ROW.name, self.order, if self.printed { ":printed" } else { "" })
    }
}

impl Describe for Sh {
    fn encoding(&self) -> Encoding {
        Encoding::Harmonics { order: self.order }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Whole
    }

    fn reads(&self, stored: &Encoding) -> bool {
        // Lower orders come first.
        matches!(stored, Encoding::Harmonics { order } if *order >= self.order)
    }

    fn shader(&self) -> Shader {
        let sources = &[include_str!("sh.wgsl"), include_str!("../sphere.wgsl")];
        Shader::new(FormKind::Whole, sources).constant("ORDER", self.order as u32).table(self.order + 1)
    }

    fn flat_lobe(&self, _brdf: &dyn Lobe) -> FlatLobe {
        FlatLobe::BandLimited(self.order)
    }
}

impl Representation for Sh {
    type Sums = Coefficients;
    type Lobes = Coefficients;

    fn zero(&self) -> Coefficients {
        Coefficients { gamma: [0.0; sh_count(MAX_SH_ORDER)], count: sh_count(self.order) }
    }

    fn accumulate(&self, sums: &mut Coefficients, sample: &Sample, weight: f32) {
        let mut y = [0.0; sh_count(MAX_SH_ORDER)];
        spherical_harmonics(self.order, sample.normal.as_dvec3(), &mut y);
        for (g, y) in sums.gamma.iter_mut().zip(y).take(sums.count) {
            *g += weight * y as f32;
        }
    }

    fn blend(&self, sums: &mut Coefficients, part: &Coefficients, weight: f32) {
        for (g, p) in sums.gamma.iter_mut().zip(part.gamma).take(sums.count) {
            *g += weight * p;
        }
    }

    fn pack(&self, sums: &Coefficients, channels: &mut [f32]) {
        channels[..sums.count].copy_from_slice(&sums.gamma[..sums.count]);
        channels[sums.count..].fill(1.0);
    }

    fn unpack(&self, channels: &[f32]) -> Coefficients {
        let mut c = self.zero();
        c.gamma[..c.count].copy_from_slice(&channels[..c.count]);
        c
    }

    fn decode(&self, sums: &Coefficients) -> Coefficients {
        *sums
    }

    fn form<'a>(&'a self, lobes: &Coefficients) -> Form<'a> {
        // Y_1 = sqrt(3/4 pi) (y, z, x).
        let [_, y, z, x, ..] = lobes.gamma;
        Form::Whole(DVec3::new(x.into(), y.into(), z.into()) * (4.0 * PI / 3.0).sqrt())
    }

    fn table(&self, lobe: &dyn Lobe) -> Vec<f64> {
        self.zonal(lobe)
    }

    fn effective_with<'a>(
        &'a self,
        lobes: &Coefficients,
        _brdf: &'a dyn Lobe,
        table: &'a [f64],
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let lobes = *lobes;
        Box::new(move |w| clamped_dot(&self.weights(table, w), &lobes.gamma))
    }

    fn effective<'a>(&'a self, lobes: &Coefficients, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let (rho, lobes) = (self.zonal(lobe), *lobes);
        Box::new(move |w| clamped_dot(&self.weights(&rho, w), &lobes.gamma))
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let rho = self.zonal(lobe);
        let weights = directions.iter().flat_map(|w| self.weights(&rho, *w)).collect();
        Box::new(ShEvaluator { weights, count: sh_count(self.order) })
    }
}
