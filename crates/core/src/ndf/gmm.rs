//! `gmm:J`: a mixture of isotropic Gaussians in the plane of `n.xy`, fitted and aligned. Tan et al. 2005,
//! section 4.
//!
//! Lobe i holds `alpha, alpha mu, alpha (2 sigma² + |mu|²)`: with `sigma²` a variance on one axis, `E|n.xy|²`
//! is `2 sigma² + |mu|²`, and that is what mixes linearly. The paper prints `sigma² + |mu|²` in and `E -
//! |mu|²` out, mixing a variance on one axis with one on two, which doubles the spread between means;
//! `gmm:J:printed` keeps that. A lobe is shaded in the plane too: the BRDF widened by `sigma²`, as a function
//! of `|w.xy - mu|`. The paper has a Gaussian BRDF lobe in that plane, which makes a Gaussian of the sum of
//! both variances, and so does `printed`. No BRDF of ours is one: their lobes are functions of the angle.

use std::fmt::{self, Display};

use glam::DVec3;

use super::mixture::{LobeSums, MixtureEvaluator, NormalLobe, Response, effective, parse_mixture};
use super::table::counted;
use super::{
    AnyMethod, Decoded, Describe, Encoding, Evaluator, FlatLobe, Form, FormKind, ParameterError,
    Representation, Row, Sample, StoredSums, mixture::spell,
};
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, LobeKind, MAX_LOBES};
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Planar Gaussian lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gmm {
    fit: Fit,
    /// True for variances interpolated, and lobes shaded, as printed.
    printed: bool,
}

pub(super) const ROW: Row = Row {
    name: "gmm",
    aliases: &[],
    parameters: ":J[:ALIGNMENT][:printed]",
    summary: "J = 1..8 planar Gaussians, aligned as `vmf` is; `prior` is the paper's own",
    paper: "Tan et al. 2005, section 4; refined is ours",
    parse,
    samples: &["gmm:4", "gmm:1", "gmm:4:prior", "gmm:3:parent", "gmm:2:unaligned", "gmm:4:printed"],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let fit = |lobes| Gmm::new(lobes).map(|gmm| gmm.fit);
    parse_mixture(words, fit, &["printed"])
        .map(|(fit, word)| AnyMethod::from(Gmm { fit, printed: word.is_some() }))
}

/// The mixture a texel stands for; means are `(x, y, 0)`.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianMixture {
    /// Lobes that are alive.
    pub lobes: Vec<NormalLobe>,
}

impl From<GaussianMixture> for Decoded {
    fn from(mixture: GaussianMixture) -> Self {
        Self::PlanarLobes(mixture.lobes)
    }
}

impl Gmm {
    /// This many lobes a texel, 1 to [`MAX_LOBES`], aligned by refinement.
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another number.
    pub fn new(lobes: usize) -> Result<Self, ParameterError> {
        let lobes = counted(lobes, "number of lobes", 1..=MAX_LOBES, "gmm:4")?;
        Ok(Self { fit: Fit::new(LobeKind::Planar, lobes), printed: false })
    }

    /// Returns it with another way of making lobes of neighbours correspond.
    #[must_use]
    pub fn alignment(mut self, alignment: Alignment) -> Self {
        self.fit.alignment = alignment;
        self
    }

    /// Returns it with variances interpolated, and lobes shaded, as the paper prints it.
    #[must_use]
    pub fn printed(self) -> Self {
        Self { printed: true, ..self }
    }

    fn response(&self) -> Response {
        if self.printed { Response::PlanarGaussian } else { Response::Plane }
    }

    fn lobes(&self, sums: &LobeSums) -> Vec<NormalLobe> {
        let total = sums.total();
        let lobe = |(index, &[alpha, x, y, q]): (usize, &[f32; 4])| {
            let alpha = f64::from(alpha);
            let (x, y, q) = (f64::from(x) / alpha, f64::from(y) / alpha, f64::from(q) / alpha);
            let second = q - x * x - y * y;
            let variance = SlopeVariance::clamped(if self.printed { second } else { second / 2.0 });
            // Damaged files aside, means lie in the unit disk.
            let mean = DVec3::new(x.clamp(-1.5, 1.5), y.clamp(-1.5, 1.5), 0.0);
            NormalLobe { index, weight: alpha / total, mean, variance }
        };
        sums.alive().map(lobe).collect()
    }
}

impl Display for Gmm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&spell(ROW.name, &self.fit, self.printed.then_some("printed")))
    }
}

impl Describe for Gmm {
    fn encoding(&self) -> Encoding {
        let sums = if self.printed { StoredSums::AsPrinted } else { StoredSums::Plain };
        Encoding::Lobes { kind: self.fit.kind, count: self.fit.lobes, sums }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[include_str!("gmm.wgsl")]).constant("PRINTED", self.printed)
    }

    fn flat_lobe(&self, _brdf: &dyn Lobe) -> FlatLobe {
        if self.printed { FlatLobe::OwnKernel } else { FlatLobe::Exact }
    }

    fn fit(&self) -> Option<Fit> {
        Some(self.fit)
    }
}

impl Representation for Gmm {
    type Sums = LobeSums;
    type Lobes = GaussianMixture;

    fn zero(&self) -> LobeSums {
        LobeSums::zero(self.fit.lobes)
    }

    /// Without a fit, all normals go to the first lobe.
    fn accumulate(&self, sums: &mut LobeSums, sample: &Sample, weight: f32) {
        let [x, y, _] = sample.normal.to_array();
        sums.add(0, [1.0, x, y, x * x + y * y], weight);
    }

    fn blend(&self, sums: &mut LobeSums, part: &LobeSums, weight: f32) {
        sums.blend(part, weight);
    }

    fn pack(&self, sums: &LobeSums, channels: &mut [f32]) {
        sums.to_channels(channels);
    }

    fn unpack(&self, channels: &[f32]) -> LobeSums {
        LobeSums::from_channels(self.fit.lobes, channels)
    }

    fn decode(&self, sums: &LobeSums) -> GaussianMixture {
        GaussianMixture { lobes: self.lobes(sums) }
    }

    fn form<'a>(&'a self, lobes: &GaussianMixture) -> Form<'a> {
        Form::Lobes(lobes.lobes.clone(), self.response())
    }

    fn effective<'a>(
        &'a self,
        lobes: &GaussianMixture,
        lobe: &'a dyn Lobe,
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective(&lobes.lobes, lobe, self.response())
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let lobes = |channels: &[f32]| self.lobes(&self.unpack(channels));
        Box::new(MixtureEvaluator { lobes, response: self.response(), rho: Vec::new(), lobe, directions })
    }

    /// From `alpha (2 sigma² + |mu|²)` to what the paper stores.
    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]) {
        channels.copy_from_slice(sums);
        let [alpha, x, y, q] = channels else { return };
        if self.printed && *alpha > 0.0 {
            let square = (*x * *x + *y * *y) / *alpha;
            *q = square + 0.5 * (*q - square);
        }
    }
}
