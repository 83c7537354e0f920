//! `vmf:J`: a mixture of von Mises-Fisher lobes, fitted and aligned. Han et al. 2007, section 6.
//!
//! Lobe j holds `alpha, alpha r`, r the mean of its normals: a partition of what `toksvig` keeps. Filtered
//! sums decode as `r = T(alpha r)/T(alpha)`, `kappa = (3|r| - |r|³)/(1 - |r|²)` (Banerjee et al. 2005), mean
//! direction `r/|r|`. A lobe is shaded as the BRDF widened by the slope variance `1/kappa`, which for
//! Blinn-Phong is `s' = kappa s/(kappa + s)`, for Torrance-Sparrow `sigma'² = sigma² + 1/(2 kappa)`, for
//! Beckmann and GGX `alpha'² = alpha² + 2/kappa`.
//!
//! Stored about the pole, `alpha (1 - r.z)` in place of `alpha r.z`: as linear, and in half floats `1 - |r|²`
//! keeps its digits (`docs/methods.md` has what that gains). `vmf:J:origin` stores the paper's form;
//! `vmf:J:printed` stores it and fits by EM as printed: an E-step without weights (Algorithm 1, line 5), and
//! a prior that counts no normals (equation 23).

use std::fmt::{self, Display};

use glam::DVec3;

use super::mixture::{LobeSums, MixtureEvaluator, NormalLobe, Response, effective, parse_mixture};
use super::table::counted;
use super::{
    AnyMethod, Decoded, Describe, Encoding, Evaluator, Form, FormKind, ParameterError, Representation, Row,
    Sample, StoredSums, mixture::spell,
};
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, LobeKind, MAX_LOBES, from_pole};
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Von Mises-Fisher lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vmf {
    fit: Fit,
    /// True when stored as the paper has it.
    origin: bool,
}

pub(super) const ROW: Row = Row {
    name: "vmf",
    aliases: &[],
    parameters: ":J[:ALIGNMENT][:FORM]",
    summary: "J = 1..8 von Mises-Fisher lobes, aligned: refined (default), parent, prior[=C], matched or \
              unaligned; form origin or printed",
    paper: "Han et al. 2007, section 6; refined is ours",
    parse,
    samples: &[
        "vmf:4",
        "vmf:1",
        "vmf:8",
        "vmf:4:origin",
        "vmf:3:parent",
        "vmf:2:prior",
        "vmf:2:prior=0.5:printed",
        "vmf:3:matched",
        "vmf:4:unaligned",
    ],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let fit = |lobes| Vmf::new(lobes).map(|vmf| vmf.fit);
    parse_mixture(words, fit, &["origin", "printed"]).map(|(fit, word)| {
        let printed = word == Some("printed");
        AnyMethod::from(Vmf { fit: Fit { printed, ..fit }, origin: word.is_some() })
    })
}

/// Shortest `|r|` that has a direction; below it a lobe is as wide as a lobe can be said to be.
const MIN_LENGTH: f64 = 1e-3;

impl Vmf {
    /// This many lobes a texel, 1 to [`MAX_LOBES`], aligned by refinement.
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another number.
    pub fn new(lobes: usize) -> Result<Self, ParameterError> {
        let lobes = counted(lobes, "number of lobes", 1..=MAX_LOBES, "vmf:4")?;
        Ok(Self { fit: Fit::new(LobeKind::Spherical, lobes), origin: false })
    }

    /// Returns it with another way of making lobes of neighbours correspond.
    #[must_use]
    pub fn alignment(mut self, alignment: Alignment) -> Self {
        self.fit.alignment = alignment;
        self
    }

    /// Returns it stored about the origin, as the paper has it.
    #[must_use]
    pub fn about_origin(self) -> Self {
        Self { origin: true, ..self }
    }

    /// Returns it fitted and stored as the paper prints it.
    #[must_use]
    pub fn printed(self) -> Self {
        Self { fit: Fit { printed: true, ..self.fit }, origin: true }
    }

    /// From `alpha (1 - r.z)` to `alpha r.z`, where asked; and back, since both are `alpha` less the other.
    fn turned(&self, &[alpha, x, y, w]: &[f32; 4]) -> [f32; 4] {
        [alpha, x, y, if self.origin { alpha - w } else { w }]
    }

    /// The lobes that the sums decode to, dead ones left out.
    fn lobes(sums: &LobeSums) -> Vec<NormalLobe> {
        let total = sums.total();
        let lobe = |(index, &[alpha, x, y, w]): (usize, &[f32; 4])| {
            let alpha = f64::from(alpha);
            let (x, y, w) = (f64::from(x) / alpha, f64::from(y) / alpha, f64::from(w) / alpha);
            // 1 - |r|² of r = (x, y, 1 - w).
            let short = (2.0 * w - w * w - x * x - y * y).clamp(0.0, 1.0);
            let length = (1.0 - short).sqrt().max(MIN_LENGTH);
            let mean = DVec3::new(x, y, 1.0 - w).try_normalize().unwrap_or(DVec3::Z);
            let variance = SlopeVariance::clamped(short / (length * (3.0 - length * length)));
            NormalLobe { index, weight: alpha / total, mean, variance }
        };
        sums.alive().map(lobe).collect()
    }
}

/// The mixture a texel stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct VmfMixture {
    /// Lobes that are alive.
    pub lobes: Vec<NormalLobe>,
}

impl From<VmfMixture> for Decoded {
    fn from(mixture: VmfMixture) -> Self {
        Self::Lobes(mixture.lobes)
    }
}

impl Display for Vmf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = if self.fit.printed { "printed" } else { "origin" };
        f.write_str(&spell(ROW.name, &self.fit, self.origin.then_some(word)))
    }
}

impl Describe for Vmf {
    fn encoding(&self) -> Encoding {
        let sums = if self.origin { StoredSums::Plain } else { StoredSums::AboutPole };
        Encoding::Lobes { kind: self.fit.kind, count: self.fit.lobes, sums }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[include_str!("vmf.wgsl"), include_str!("sphere_response.wgsl")])
            .constant("ORIGIN", self.origin)
    }

    fn fit(&self) -> Option<Fit> {
        Some(self.fit)
    }
}

impl Representation for Vmf {
    type Sums = LobeSums;
    type Lobes = VmfMixture;

    fn zero(&self) -> LobeSums {
        LobeSums::zero(self.fit.lobes)
    }

    /// Without a fit, all normals go to the first lobe.
    fn accumulate(&self, sums: &mut LobeSums, sample: &Sample, weight: f32) {
        let n = sample.normal.to_array();
        sums.add(0, [1.0, n[0], n[1], from_pole(&n)], weight);
    }

    fn blend(&self, sums: &mut LobeSums, part: &LobeSums, weight: f32) {
        sums.blend(part, weight);
    }

    fn pack(&self, sums: &LobeSums, channels: &mut [f32]) {
        sums.map(|lobe| self.turned(lobe)).to_channels(channels);
    }

    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]) {
        channels.copy_from_slice(sums);
        if let Some(lobe) = channels.first_chunk_mut() {
            *lobe = self.turned(lobe);
        }
    }

    fn unpack(&self, channels: &[f32]) -> LobeSums {
        LobeSums::from_channels(self.fit.lobes, channels).map(|lobe| self.turned(lobe))
    }

    fn decode(&self, sums: &LobeSums) -> VmfMixture {
        VmfMixture { lobes: Self::lobes(sums) }
    }

    fn form<'a>(&'a self, lobes: &VmfMixture) -> Form<'a> {
        Form::Lobes(lobes.lobes.clone(), Response::Sphere)
    }

    fn effective<'a>(&'a self, lobes: &VmfMixture, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective(&lobes.lobes, lobe, Response::Sphere)
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let lobes = |channels: &[f32]| Self::lobes(&self.unpack(channels));
        Box::new(MixtureEvaluator { lobes, response: Response::Sphere, lobe, directions })
    }
}
