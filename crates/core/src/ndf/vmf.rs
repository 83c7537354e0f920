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
//! a prior that counts no normals (equation 23). `vmf:J:series` is shaded by the lobe's zonal series, as
//! equations 13 to 19 have it for any BRDF, in place of widening.

use std::fmt::{self, Display};

use glam::DVec3;

use super::mixture::{
    LobeSums, MixtureEvaluator, NormalLobe, Response, SERIES_ORDER, effective, parse_mixture,
};
use super::table::counted;
use super::{
    AnyMethod, Decoded, Describe, Encoding, Evaluator, FlatLobe, Form, FormKind, ParameterError,
    Representation, Row, Sample, StoredSums, mixture::spell,
};
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, LobeKind, MAX_LOBES, from_pole};
use crate::shader::Shader;
use crate::units::SlopeVariance;
use crate::words;

/// Von Mises-Fisher lobes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vmf {
    fit: Fit,
    form: VmfForm,
}

/// Form in which lobes are stored and shaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VmfForm {
    /// Ours: about the pole, shaded by widening.
    #[default]
    Ours,
    /// Stored about the origin, as the paper has it.
    Origin,
    /// Stored so, and fitted by EM as printed.
    Printed,
    /// Shaded by the lobe's zonal series.
    Series,
}

words!(VmfForm { Ours => "ours", Origin => "origin", Printed => "printed", Series => "series" });

pub(super) const ROW: Row = Row {
    name: "vmf",
    aliases: &[],
    parameters: ":J[:ALIGNMENT][:FORM]",
    summary: "J = 1..8 von Mises-Fisher lobes, aligned: refined (default), parent, prior[=C], matched or \
              unaligned; form origin, printed or series",
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
        "vmf:3:series",
        "vmf:3:matched",
        "vmf:4:unaligned",
    ],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let fit = |lobes| Vmf::new(lobes).map(|vmf| vmf.fit);
    let (fit, word) = parse_mixture(words, fit, &["origin", "printed", "series"])?;
    let form = word.and_then(|word| word.parse().ok()).unwrap_or_default();
    Ok(AnyMethod::from(Vmf { fit, form: VmfForm::Ours }.form(form)))
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
        Ok(Self { fit: Fit::new(LobeKind::Spherical, lobes), form: VmfForm::Ours })
    }

    /// Returns it with another way of making lobes of neighbours correspond.
    #[must_use]
    pub fn alignment(mut self, alignment: Alignment) -> Self {
        self.fit.alignment = alignment;
        self
    }

    /// Returns it stored, fitted or shaded in another form.
    #[must_use]
    pub fn form(self, form: VmfForm) -> Self {
        Self { fit: Fit { printed: form == VmfForm::Printed, ..self.fit }, form }
    }

    /// True when stored about the origin.
    fn about_its_origin(&self) -> bool {
        matches!(self.form, VmfForm::Origin | VmfForm::Printed)
    }

    fn response(&self) -> Response {
        if self.form == VmfForm::Series { Response::Series } else { Response::Sphere }
    }

    /// From `alpha (1 - r.z)` to `alpha r.z`, where asked; and back, since both are `alpha` less the other.
    fn turned(&self, &[alpha, x, y, w]: &[f32; 4]) -> [f32; 4] {
        [alpha, x, y, if self.about_its_origin() { alpha - w } else { w }]
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
        let word = (self.form != VmfForm::Ours).then(|| self.form.name());
        f.write_str(&spell(ROW.name, &self.fit, word))
    }
}

impl Describe for Vmf {
    fn encoding(&self) -> Encoding {
        let sums = if self.about_its_origin() { StoredSums::Plain } else { StoredSums::AboutPole };
        Encoding::Lobes { kind: self.fit.kind, count: self.fit.lobes, sums }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        let shader = if self.form == VmfForm::Series {
            let sources = &[include_str!("vmf.wgsl"), include_str!("series_response.wgsl")];
            Shader::new(FormKind::Lobes, sources).table(SERIES_ORDER + 1)
        } else {
            Shader::new(FormKind::Lobes, &[include_str!("vmf.wgsl"), include_str!("sphere_response.wgsl")])
        };
        shader.constant("ORIGIN", self.about_its_origin())
    }

    fn flat_lobe(&self, brdf: &dyn Lobe) -> FlatLobe {
        // Diffuse light is no series: its lobe widens in closed form.
        let series = self.form == VmfForm::Series && brdf.slope_variance().is_some();
        if series { FlatLobe::BandLimited(SERIES_ORDER) } else { FlatLobe::Exact }
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
        Form::Lobes(lobes.lobes.clone(), self.response())
    }

    fn effective<'a>(&'a self, lobes: &VmfMixture, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective(&lobes.lobes, lobe, self.response())
    }

    /// The lobe's zonal coefficients, for the series.
    fn table(&self, lobe: &dyn Lobe) -> Vec<f64> {
        if self.form == VmfForm::Series { lobe.zonal(SERIES_ORDER) } else { Vec::new() }
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let lobes = |channels: &[f32]| Self::lobes(&self.unpack(channels));
        Box::new(MixtureEvaluator {
            lobes,
            response: self.response(),
            rho: self.table(lobe),
            lobe,
            directions,
        })
    }
}
