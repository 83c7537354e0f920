//! Common parts of the fitted mixtures: sums of several lobes, spellings, and an evaluator.

use glam::DVec3;

use super::table::count_of;
use super::{Evaluator, ParameterError};
use crate::brdf::{AnyLobe, Lobe};
use crate::fit::{Alignment, Fit, MAX_LOBES};
use crate::units::SlopeVariance;
use crate::words::UnknownWord;

/// Sums of every lobe: weight, then three statistics times the weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeSums {
    sums: [[f32; 4]; MAX_LOBES],
    count: usize,
}

/// Share of a texel's weight below which a lobe says nothing: a few steps of a half float.
const DEAD: f32 = 1e-5;

impl LobeSums {
    /// Sums over nothing.
    pub(super) fn zero(count: usize) -> Self {
        Self { sums: [[0.0; 4]; MAX_LOBES], count }
    }

    /// Reads RGBA layers, one a lobe.
    pub(super) fn from_channels(count: usize, channels: &[f32]) -> Self {
        let mut lobes = Self::zero(count);
        lobes.sums[..count].copy_from_slice(&channels.as_chunks().0[..count]);
        lobes
    }

    /// Writes RGBA layers, one a lobe.
    pub(super) fn to_channels(self, channels: &mut [f32]) {
        channels.copy_from_slice(self.all().as_flattened());
    }

    /// Sums with every lobe changed by `f`.
    pub(super) fn map(mut self, f: impl Fn(&[f32; 4]) -> [f32; 4]) -> Self {
        self.sums[..self.count].iter_mut().for_each(|s| *s = f(s));
        self
    }

    /// Adds to lobe `j`.
    pub(super) fn add(&mut self, j: usize, values: [f32; 4], weight: f32) {
        self.sums[j].iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
    }

    /// Adds the sums of a part.
    pub(super) fn blend(&mut self, part: &Self, weight: f32) {
        (0..self.count).for_each(|j| self.add(j, part.sums[j], weight));
    }

    /// Every lobe's sums.
    #[must_use]
    pub fn all(&self) -> &[[f32; 4]] {
        &self.sums[..self.count]
    }

    /// Sums of the lobes that say something, with their places.
    pub(super) fn alive(&self) -> impl Iterator<Item = (usize, &[f32; 4])> {
        self.all().iter().enumerate().filter(|(_, s)| s[0] > DEAD)
    }

    /// Weight of the lobes that say something.
    pub(super) fn total(&self) -> f64 {
        self.alive().map(|(_, s)| f64::from(s[0])).sum()
    }
}

/// A decoded lobe, ready to be shaded: the BRDF widened by `variance`, around `mean`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalLobe {
    /// Its number among the lobes of the texel.
    pub index: usize,
    /// Share of the texel; shares sum to one.
    pub weight: f64,
    /// Mean direction; for planar lobes `(x, y, 0)`.
    pub mean: DVec3,
    /// Spread on one axis.
    pub variance: SlopeVariance,
}

impl NormalLobe {
    /// A lobe that makes up all of a texel.
    pub(super) fn alone(mean: DVec3, variance: SlopeVariance) -> Self {
        Self { index: 0, weight: 1.0, mean, variance }
    }

    /// The unit direction of the mean: on the sphere the mean itself; a planar mean, whose z is 0, is lifted
    /// to it.
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        let DVec3 { x, y, z } = self.mean;
        DVec3::new(x, y, if z == 0.0 { (1.0 - x * x - y * y).max(0.0).sqrt() } else { z })
            .normalize_or(DVec3::Z)
    }
}

/// Mean normal of lobes, a lobe's own being shorter the wider it is.
pub(super) fn mean_of(lobes: &[NormalLobe]) -> DVec3 {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for lobe in lobes {
        sum += lobe.weight * lobe.direction() / (1.0 + lobe.variance.get());
        total += lobe.weight;
    }
    if total > 0.0 { sum / total } else { DVec3::Z }
}

/// Reads `J[:ALIGNMENT][:WORD]`; the second result says whether the word was there.
pub(super) fn parse_mixture(
    words: &[&str],
    fit: impl Fn(usize) -> Result<Fit, ParameterError>,
    word: &str,
) -> Result<(Fit, bool), ParameterError> {
    let mut fit = fit(count_of(words.first()))?;
    let rest = words.get(1..).unwrap_or_default();
    let (rest, flag) = match rest.split_last() {
        Some((last, rest)) if *last == word => (rest, true),
        _ => (rest, false),
    };
    match rest {
        [] => {}
        [alignment] => {
            fit.alignment = alignment.parse().map_err(|e: UnknownWord| {
                let said = format!("`{alignment}` is no alignment; there are {}, and then `{word}`", e.known);
                ParameterError::Words(said)
            })?;
        }
        _ => {
            let said = format!("takes the number of lobes, an alignment and `{word}`, no more");
            return Err(ParameterError::Words(said));
        }
    }
    Ok((fit, flag))
}

/// The spelling of a mixture; the default alignment goes without saying.
pub(super) fn spell(name: &str, fit: &Fit, word: Option<&str>) -> String {
    let mut text = format!("{name}:{}", fit.lobes);
    if fit.alignment != Alignment::default() {
        text += &format!(":{}", fit.alignment.name());
    }
    if let Some(word) = word {
        text += &format!(":{word}");
    }
    text
}

/// The BRDF's argument for a direction and a lobe's mean.
pub type Cosine = fn(DVec3, DVec3) -> f64;

/// The BRDF's argument for lobes on the sphere.
pub(super) fn cosine(w: DVec3, mu: DVec3) -> f64 {
    w.dot(mu)
}

/// The effective lobe of a mixture: the BRDF widened by each lobe, around its mean.
pub(super) fn effective<'a>(
    lobes: &[NormalLobe],
    lobe: &'a dyn Lobe,
    cosine: Cosine,
) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
    let cosine = argument(lobe, cosine);
    let widened: Vec<(f64, DVec3, AnyLobe)> =
        lobes.iter().map(|l| (l.weight, cosine.centre(l), lobe.widen(l.variance))).collect();
    Box::new(move |w| {
        widened.iter().map(|(weight, mu, lobe)| weight * lobe.evaluate((cosine.of)(w, *mu))).sum()
    })
}

/// Argument of a BRDF under lobes of normals: the function, and whether means are lifted to the sphere for
/// it.
#[derive(Clone, Copy)]
struct Argument {
    of: Cosine,
    lifted: bool,
}

impl Argument {
    /// Centre of a lobe as the function takes it.
    fn centre(self, lobe: &NormalLobe) -> DVec3 {
        if self.lifted { lobe.direction() } else { lobe.mean }
    }
}

/// Argument of a lobe of reflection. Diffuse light is no narrow lobe in the half-vector: it takes the cosine
/// to the mean itself, on the sphere (Tan et al. 2005, section 4.1: `[mu · l]`).
fn argument(lobe: &dyn Lobe, narrow: Cosine) -> Argument {
    let lifted = lobe.slope_variance().is_none();
    Argument { of: if lifted { cosine } else { narrow }, lifted }
}

/// Evaluates mixtures direction by direction, leaving out what lies beyond a lobe's reach.
pub(super) struct MixtureEvaluator<'a, L> {
    /// Decodes channels.
    pub(super) lobes: L,
    pub(super) cosine: Cosine,
    pub(super) lobe: &'a dyn Lobe,
    pub(super) directions: &'a [DVec3],
}

/// Values below this part of a lobe's peak are left out.
const NEGLIGIBLE: f64 = 1e-10;

/// The least cosine at which a falling lobe is not negligible.
fn least_cosine(lobe: &dyn Lobe) -> f64 {
    let peak = lobe.evaluate(1.0);
    let (mut dark, mut bright) = (-1.0, 1.0);
    if lobe.evaluate(dark) > NEGLIGIBLE * peak {
        return dark;
    }
    for _ in 0..40 {
        let middle = 0.5 * (dark + bright);
        if lobe.evaluate(middle) > NEGLIGIBLE * peak { bright = middle } else { dark = middle }
    }
    dark
}

impl<L> Evaluator for MixtureEvaluator<'_, L>
where
    L: Fn(&[f32]) -> Vec<NormalLobe> + Send + Sync,
{
    fn evaluate(&self, channels: &[f32], out: &mut [f64]) {
        out.fill(0.0);
        let (mut places, mut values) = (Vec::new(), Vec::new());
        let cosine = argument(self.lobe, self.cosine);
        for lobe in (self.lobes)(channels) {
            let widened = self.lobe.widen(lobe.variance);
            let (least, centre) = (least_cosine(&*widened), cosine.centre(&lobe));
            places.clear();
            values.clear();
            for (i, w) in self.directions.iter().enumerate() {
                let u = (cosine.of)(*w, centre);
                if u >= least {
                    places.push(i);
                    values.push(u);
                }
            }
            widened.evaluate_all(&mut values);
            for (i, f) in places.iter().zip(&values) {
                out[*i] += lobe.weight * f;
            }
        }
    }
}
