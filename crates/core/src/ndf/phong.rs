//! `phong:J`: a few Phong peaks a texel, by non-linear least squares. Fournier 1992; a baseline in Tan et al.
//! 2005.
//!
//! A peak holds its weight, direction and exponent. None of these mixes: a filter shades every peak of every
//! texel it reads, up to 8 J of them, and blends the results (`measure/between.rs`). A peak of exponent s is
//! the BRDF widened by `1/s`.

use std::fmt::{self, Display};

use glam::DVec3;

use super::mixture::{LobeSums, MixtureEvaluator, NormalLobe, Response, effective};
use super::table::{count_of, counted};
use super::{
    AnyMethod, Decoded, Describe, Encoding, Evaluator, Form, FormKind, ParameterError, Representation, Row,
    Sample, StoredSums,
};
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, LobeKind, MAX_LOBES, SHARPEST};
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Phong peaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phong {
    peaks: usize,
}

pub(super) const ROW: Row = Row {
    name: "phong",
    aliases: &[],
    parameters: ":J",
    summary: "J = 1..8 Phong peaks by least squares; not filterable, every texel's peaks are shaded",
    paper: "Fournier 1992; baseline of Tan et al. 2005",
    parse,
    samples: &["phong:4", "phong:1"],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let [peaks] = words else { return Phong::new(0).map(AnyMethod::from) };
    Phong::new(count_of(Some(peaks))).map(AnyMethod::from)
}

/// The peaks of a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct PhongPeaks {
    /// Peaks of any weight.
    pub peaks: Vec<NormalLobe>,
}

impl From<PhongPeaks> for Decoded {
    fn from(peaks: PhongPeaks) -> Self {
        Self::Peaks(peaks.peaks)
    }
}

impl Phong {
    /// This many peaks a texel, 1 to [`MAX_LOBES`].
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another number.
    pub fn new(peaks: usize) -> Result<Self, ParameterError> {
        counted(peaks, "number of peaks", 1..=MAX_LOBES, "phong:4").map(|peaks| Self { peaks })
    }

    fn peaks(sums: &LobeSums) -> Vec<NormalLobe> {
        let peak = |(index, &[weight, x, y, exponent]): (usize, &[f32; 4])| {
            // Held to the disk and to exponents that mean something, whatever a damaged file holds.
            let (x, y) = (f64::from(x), f64::from(y));
            let held = x.hypot(y).max(1.0);
            let (x, y) = (x / held, y / held);
            let mean = DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
            let variance =
                if exponent < SHARPEST * 0.999 { 1.0 / f64::from(exponent.max(1e-2)) } else { 0.0 };
            NormalLobe { index, weight: f64::from(weight), mean, variance: SlopeVariance::clamped(variance) }
        };
        sums.alive().map(peak).collect()
    }
}

impl Display for Phong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", ROW.name, self.peaks)
    }
}

impl Describe for Phong {
    fn encoding(&self) -> Encoding {
        Encoding::Lobes { kind: LobeKind::Peaks, count: self.peaks, sums: StoredSums::Plain }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[include_str!("phong.wgsl"), include_str!("sphere_response.wgsl")])
            .constant("SHARPEST", SHARPEST)
    }

    fn fit(&self) -> Option<Fit> {
        Some(Fit { alignment: Alignment::Unaligned, ..Fit::new(LobeKind::Peaks, self.peaks) })
    }

    fn filterable(&self) -> bool {
        false
    }
}

impl Representation for Phong {
    type Sums = LobeSums;
    type Lobes = PhongPeaks;

    fn zero(&self) -> LobeSums {
        LobeSums::zero(self.peaks)
    }

    /// A normal is one sharp peak; several do not add up to anything.
    fn accumulate(&self, sums: &mut LobeSums, sample: &Sample, weight: f32) {
        sums.add(0, [1.0, sample.normal.x, sample.normal.y, SHARPEST], weight);
    }

    fn blend(&self, sums: &mut LobeSums, part: &LobeSums, weight: f32) {
        sums.blend(part, weight);
    }

    fn pack(&self, sums: &LobeSums, channels: &mut [f32]) {
        sums.to_channels(channels);
    }

    fn unpack(&self, channels: &[f32]) -> LobeSums {
        LobeSums::from_channels(self.peaks, channels)
    }

    fn decode(&self, sums: &LobeSums) -> PhongPeaks {
        PhongPeaks { peaks: Self::peaks(sums) }
    }

    fn form<'a>(&'a self, lobes: &PhongPeaks) -> Form<'a> {
        Form::Lobes(lobes.peaks.clone(), Response::Sphere)
    }

    fn effective<'a>(&'a self, peaks: &PhongPeaks, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective(&peaks.peaks, lobe, Response::Sphere)
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let lobes = |channels: &[f32]| Self::peaks(&self.unpack(channels));
        Box::new(MixtureEvaluator { lobes, response: Response::Sphere, rho: Vec::new(), lobe, directions })
    }
}
