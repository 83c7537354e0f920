//! `vmf:J`: a mixture of von Mises-Fisher lobes, fitted and aligned. Han et al. 2007, section 6.
//!
//! Lobe j holds `alpha, alpha r`, r the mean of its normals: a partition of what `toksvig` keeps. Filtered sums decode as
//! `r = T(alpha r)/T(alpha)`, `kappa = (3|r| - |r|³)/(1 - |r|²)` (Banerjee et al. 2005), mean direction `r/|r|`. A lobe is
//! shaded as the BRDF widened by the slope variance `1/kappa`, which for Blinn-Phong is `s' = kappa s/(kappa + s)`, for
//! Torrance-Sparrow `sigma'² = sigma² + 1/(2 kappa)`, for Beckmann and GGX `alpha'² = alpha² + 2/kappa`.
//!
//! Stored about the pole, `alpha (1 - r.z)` in place of `alpha r.z`: as linear, and in half floats `1 - |r|²` keeps its
//! digits (`docs/methods.md` has what that gains). `vmf:J:origin` stores the paper's form.

use glam::DVec3;

use super::mixture::{
    Cosine, LobeSums, MixtureEvaluator, NormalLobe, cosine, effective, mean_of, parse_mixture,
};
use super::{Decoded, Evaluator, Method, MixtureLobe, Representation, Row, Sample};
use crate::brdf::Lobe;
use crate::fit::{Fit, LobeKind, from_pole};
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Von Mises-Fisher lobes.
#[derive(Clone, Copy, Debug)]
pub struct Vmf {
    fit: Fit,
    /// Stored as the paper has it.
    origin: bool,
}

pub(super) const ROW: Row = Row {
    name: "vmf",
    parameters: ":J[:ALIGNMENT][:origin]",
    summary: "J = 1..8 von Mises-Fisher lobes, aligned: refined (default), parent, prior, matched or unaligned",
    paper: "Han et al. 2007, section 6; refined is ours",
    parse,
    samples: &[
        "vmf:4",
        "vmf:1",
        "vmf:8",
        "vmf:4:origin",
        "vmf:3:parent",
        "vmf:2:prior",
        "vmf:3:matched",
        "vmf:4:unaligned",
    ],
};

fn parse(words: &[&str]) -> Result<Box<dyn Method>, String> {
    let (fit, origin) = parse_mixture(words, LobeKind::Spherical, "origin", "vmf")?;
    Ok(Box::new(Vmf { fit, origin }))
}

/// Shortest `|r|` that has a direction; below it a lobe is as wide as a lobe can be said to be.
const MIN_LENGTH: f64 = 1e-3;

impl Vmf {
    /// From `alpha (1 - r.z)` to `alpha r.z`, where asked; and back, since both are `alpha` less the other.
    fn turned(&self, &[alpha, x, y, w]: &[f32; 4]) -> [f32; 4] {
        [alpha, x, y, if self.origin { alpha - w } else { w }]
    }

    /// The lobes that the sums decode to, dead ones left out.
    fn lobes(sums: &LobeSums) -> Vec<NormalLobe> {
        let total = sums.total();
        let lobe = |(layer, &[alpha, x, y, w]): (usize, &[f32; 4])| {
            let alpha = f64::from(alpha);
            let (x, y, w) = (f64::from(x) / alpha, f64::from(y) / alpha, f64::from(w) / alpha);
            // 1 - |r|² of r = (x, y, 1 - w).
            let short = (2.0 * w - w * w - x * x - y * y).clamp(0.0, 1.0);
            let length = (1.0 - short).sqrt().max(MIN_LENGTH);
            let mean = DVec3::new(x, y, 1.0 - w).try_normalize().unwrap_or(DVec3::Z);
            let variance = SlopeVariance::clamped(short / (length * (3.0 - length * length)));
            NormalLobe { layer, weight: alpha / total, mean, variance }
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
        let lobe = |l: &NormalLobe| MixtureLobe {
            layer: l.layer,
            weight: l.weight,
            mean: l.mean,
            variance: l.variance.get(),
        };
        Self::Lobes(mixture.lobes.iter().map(lobe).collect())
    }
}

impl Representation for Vmf {
    type Sums = LobeSums;
    type Lobes = VmfMixture;

    fn spelling(&self) -> String {
        super::mixture::spell(ROW.name, &self.fit, self.origin.then_some("origin"))
    }

    fn layers(&self) -> usize {
        self.fit.lobes
    }

    fn encoding(&self) -> &'static str {
        if self.origin { "sums" } else { "sums-about-pole" }
    }

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

    fn mean(&self, lobes: &VmfMixture) -> DVec3 {
        mean_of(&lobes.lobes)
    }

    fn effective<'a>(&'a self, lobes: &VmfMixture, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective(&lobes.lobes, lobe, cosine)
    }

    fn shader(&self) -> Shader {
        Shader::new(&[
            include_str!("vmf.wgsl"),
            include_str!("sphere_cosine.wgsl"),
            include_str!("mixture.wgsl"),
        ])
        .constant("ORIGIN", self.origin)
    }

    fn isotropic(&self, lobes: &VmfMixture) -> Option<(Cosine, Vec<NormalLobe>)> {
        Some((cosine, lobes.lobes.clone()))
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let lobes = |channels: &[f32]| Self::lobes(&self.unpack(channels));
        Box::new(MixtureEvaluator { lobes, cosine, lobe, directions })
    }

    fn fit(&self) -> Option<Fit> {
        Some(self.fit)
    }
}
