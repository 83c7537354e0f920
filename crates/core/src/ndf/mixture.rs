//! Common parts of the fitted mixtures: sums of several lobes, spellings, and an evaluator.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::table::count_of;
use super::{Evaluator, ParameterError};
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, MAX_LOBES};
use crate::sphere::legendre;
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

/// Reads `J[:ALIGNMENT][:WORD]`; the second result is the word, one of `words`, if it was there.
pub(super) fn parse_mixture<'w>(
    said: &[&str],
    fit: impl Fn(usize) -> Result<Fit, ParameterError>,
    words: &[&'w str],
) -> Result<(Fit, Option<&'w str>), ParameterError> {
    let mut fit = fit(count_of(said.first()))?;
    let rest = said.get(1..).unwrap_or_default();
    let word = rest.last().and_then(|last| words.iter().find(|word| *word == last).copied());
    match &rest[..rest.len() - usize::from(word.is_some())] {
        [] => {}
        [alignment] => set_alignment(&mut fit, alignment, words)?,
        _ => {
            let words = words.join("` or `");
            let said = format!("takes the number of lobes, an alignment and `{words}`, no more");
            return Err(ParameterError::Words(said));
        }
    }
    Ok((fit, word))
}

/// Sets the alignment of a word, and of `prior=C` the prior's strength.
fn set_alignment(fit: &mut Fit, word: &str, words: &[&str]) -> Result<(), ParameterError> {
    let (name, strength) = word.split_once('=').map_or((word, None), |(name, c)| (name, Some(c)));
    fit.alignment = name.parse().map_err(|e: UnknownWord| {
        let words = words.join("` or `");
        let said = format!("`{word}` is no alignment; there are {}, and then `{words}`", e.known);
        ParameterError::Words(said)
    })?;
    let Some(strength) = strength else { return Ok(()) };
    let strength = strength.parse().ok().filter(|c: &f32| (0.0..=1e6).contains(c));
    match strength {
        Some(strength) if fit.alignment == Alignment::Prior => fit.prior = strength,
        _ => {
            let said = format!("`{word}`: only `prior` has a strength, from 0 to 1e6, as in `prior=0.5`");
            return Err(ParameterError::Words(said));
        }
    }
    Ok(())
}

/// The spelling of a mixture; the default alignment goes without saying, and so does a prior of 1.
pub(super) fn spell(name: &str, fit: &Fit, word: Option<&str>) -> String {
    let mut text = format!("{name}:{}", fit.lobes);
    if fit.alignment != Alignment::default() {
        text += &format!(":{}", fit.alignment.name());
    }
    if fit.alignment == Alignment::Prior && fit.prior != 1.0 {
        text += &format!("={}", fit.prior);
    }
    if let Some(word) = word {
        text += &format!(":{word}");
    }
    text
}

/// Response of a lobe of normals: the function that it makes of the BRDF's own lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// The BRDF's lobe, widened, of the cosine to the mean.
    Sphere,
    /// That lobe, of the product with a mean shorter than one, as if it were a normal; diffuse light too.
    Short,
    /// That lobe, of the cosine to a normal as far from the mean as the direction is in the plane.
    Plane,
    /// The lobe's zonal series, each order scaled by that of the lobe of normals (Han et al. 2007, equations
    /// 13 to 19), to order [`SERIES_ORDER`].
    Series,
    /// A Gaussian of the distance in the plane, whose variance is the sum of both (Tan et al. 2005, section
    /// 3, as printed).
    PlanarGaussian,
}

impl Response {
    /// Value in a direction `w`, for a lobe of normals around `mean` that widens the BRDF by `by`.
    pub(super) fn value(self, lobe: &dyn Lobe, by: SlopeVariance, (w, mean): (DVec3, DVec3)) -> f64 {
        match self {
            Self::Sphere | Self::Short => lobe.evaluate_widened(by, w.dot(mean)),
            Self::Series => series(&lobe.zonal(SERIES_ORDER), by, w.dot(mean)),
            Self::Plane => lobe.evaluate_widened(by, planar_cosine(w, mean)),
            Self::PlanarGaussian => {
                if w.z <= 0.0 {
                    return 0.0;
                }
                let variance = lobe.slope_variance().unwrap_or(SlopeVariance::ZERO).widen(by).get();
                let far = DVec2::new(w.x - mean.x, w.y - mean.y).length_squared();
                (-far / (2.0 * variance)).exp() / (2.0 * PI * variance)
            }
        }
    }
}

/// Order at which the zonal series of a lobe ends.
pub const SERIES_ORDER: usize = 16;

/// Sum of a lobe's zonal series, scaled by `Lambda_l = exp(-l² by/2)` of a lobe of normals, as printed for
/// small angles; ringing below zero is clamped to zero.
pub(super) fn series(rho: &[f64], by: SlopeVariance, u: f64) -> f64 {
    let term = |(l, (rho, p)): (usize, (&f64, f64))| {
        let (l, scale) = (l as f64, (2 * l + 1) as f64 / (4.0 * PI));
        scale * (-0.5 * l * l * by.get()).exp() * rho * p
    };
    rho.iter().zip(legendre(rho.len() - 1, u.clamp(-1.0, 1.0))).enumerate().map(term).sum::<f64>().max(0.0)
}

/// Cosine `w · n` of a normal as far from `w` as the two are in the plane: the argument of the BRDF's own
/// profile.
///
/// The plane is that of the upper hemisphere; below it nothing is reflected.
fn planar_cosine(w: DVec3, mu: DVec3) -> f64 {
    if w.z <= 0.0 {
        return -1.0;
    }
    let far = DVec2::new(w.x - mu.x, w.y - mu.y).length_squared();
    (1.0 - far).max(0.0).sqrt()
}

/// Lobes of normals before a BRDF: response, centres and variances.
struct Answers {
    response: Response,
    /// Weight, centre as the response takes it, and variance.
    lobes: Vec<(f64, DVec3, SlopeVariance)>,
}

/// Answers of lobes. Diffuse light is no narrow lobe in the half-vector: it takes the cosine to the mean
/// itself, on the sphere (Tan et al. 2005, section 4.1: `[mu · l]`, and as printed nothing widens it).
fn answers(lobes: &[NormalLobe], lobe: &dyn Lobe, response: Response) -> Answers {
    let diffuse = lobe.slope_variance().is_none();
    let of = |l: &NormalLobe| {
        let widens = !(diffuse && response == Response::PlanarGaussian);
        let variance = if widens { l.variance } else { SlopeVariance::ZERO };
        let lifted = diffuse && response != Response::Short;
        (l.weight, if lifted { l.direction() } else { l.mean }, variance)
    };
    Answers {
        response: if diffuse { Response::Sphere } else { response },
        lobes: lobes.iter().map(of).collect(),
    }
}

/// The effective lobe of a mixture: the BRDF widened by each lobe, around its mean.
pub(super) fn effective<'a>(
    lobes: &[NormalLobe],
    lobe: &'a dyn Lobe,
    response: Response,
) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
    let Answers { response, lobes } = answers(lobes, lobe, response);
    Box::new(move |w| lobes.iter().map(|(weight, mu, by)| weight * response.value(lobe, *by, (w, *mu))).sum())
}

/// Evaluates mixtures direction by direction, leaving out what lies beyond a lobe's reach.
pub(super) struct MixtureEvaluator<'a, L> {
    /// Decodes channels.
    pub(super) lobes: L,
    pub(super) response: Response,
    /// Zonal coefficients of the lobe, for the series.
    pub(super) rho: Vec<f64>,
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
        let Answers { response, lobes } = answers(&(self.lobes)(channels), self.lobe, self.response);
        for (weight, centre, variance) in lobes {
            let cosine = match response {
                Response::Sphere | Response::Short => |w: DVec3, mu: DVec3| w.dot(mu),
                Response::Plane => planar_cosine,
                Response::Series => {
                    for (out, w) in out.iter_mut().zip(self.directions) {
                        *out += weight * series(&self.rho, variance, w.dot(centre));
                    }
                    continue;
                }
                Response::PlanarGaussian => {
                    for (out, w) in out.iter_mut().zip(self.directions) {
                        *out += weight * response.value(self.lobe, variance, (*w, centre));
                    }
                    continue;
                }
            };
            let widened = self.lobe.widen(variance);
            let least = least_cosine(&*widened);
            places.clear();
            values.clear();
            for (i, w) in self.directions.iter().enumerate() {
                let u = cosine(*w, centre);
                if u >= least {
                    places.push(i);
                    values.push(u);
                }
            }
            widened.evaluate_all(&mut values);
            for (i, f) in places.iter().zip(&values) {
                out[*i] += weight * f;
            }
        }
    }
}
