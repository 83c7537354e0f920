//! `phong:J`: a few Phong peaks a texel, by non-linear least squares. Fournier 1992; a baseline in Tan et al. 2005.
//!
//! A peak holds its weight, direction and exponent. None of these mixes: a filter shades every peak of every texel it
//! reads, up to 8 J of them, and blends the results (`measure/between.rs`). A peak of exponent s is the BRDF widened by `1/s`.

use glam::DVec3;

use super::mixture::{Cosine, LobeSums, MixtureEvaluator, NormalLobe, cosine, effective, mean_of};
use super::{Decoded, Evaluator, Method, MixtureLobe, Representation, Row, Sample};
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, LobeKind, MAX_LOBES, SHARPEST};
use crate::shader::Shader;
use crate::units::SlopeVariance;

/// Phong peaks.
#[derive(Clone, Copy, Debug)]
pub struct Phong {
    peaks: usize,
}

pub(super) const ROW: Row = Row {
    name: "phong",
    parameters: ":J",
    summary: "J = 1..8 Phong peaks by least squares; not filterable, every texel's peaks are shaded",
    paper: "Fournier 1992; baseline of Tan et al. 2005",
    parse,
    samples: &["phong:4", "phong:1"],
};

fn parse(words: &[&str]) -> Result<Box<dyn Method>, String> {
    match words {
        [peaks] => peaks.parse().ok().filter(|n| (1..=MAX_LOBES).contains(n)),
        _ => None,
    }
    .map(|peaks| Box::new(Phong { peaks }) as Box<dyn Method>)
    .ok_or_else(|| {
        format!("the number of peaks must be a whole number from 1 to {MAX_LOBES}, as in `phong:4`")
    })
}

/// The peaks of a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct PhongPeaks {
    /// Peaks of any weight.
    pub peaks: Vec<NormalLobe>,
}

impl From<PhongPeaks> for Decoded {
    fn from(peaks: PhongPeaks) -> Self {
        let peak = |p: &NormalLobe| MixtureLobe {
            layer: p.layer,
            weight: p.weight,
            mean: p.mean,
            variance: p.variance.get(),
        };
        Self::Peaks(peaks.peaks.iter().map(peak).collect())
    }
}

impl Phong {
    fn peaks(sums: &LobeSums) -> Vec<NormalLobe> {
        let peak = |(layer, &[weight, x, y, exponent]): (usize, &[f32; 4])| {
            // Held to the disk and to exponents that mean something, whatever a damaged file holds.
            let (x, y) = (f64::from(x), f64::from(y));
            let held = x.hypot(y).max(1.0);
            let (x, y) = (x / held, y / held);
            let mean = DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
            let variance =
                if exponent < SHARPEST * 0.999 { 1.0 / f64::from(exponent.max(1e-2)) } else { 0.0 };
            NormalLobe { layer, weight: f64::from(weight), mean, variance: SlopeVariance::clamped(variance) }
        };
        sums.alive().map(peak).collect()
    }
}

impl Representation for Phong {
    type Sums = LobeSums;
    type Lobes = PhongPeaks;

    fn spelling(&self) -> String {
        format!("{}:{}", ROW.name, self.peaks)
    }

    fn layers(&self) -> usize {
        self.peaks
    }

    fn encoding(&self) -> &'static str {
        "peaks"
    }

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

    fn mean(&self, lobes: &PhongPeaks) -> DVec3 {
        mean_of(&lobes.peaks)
    }

    fn effective<'a>(&'a self, peaks: &PhongPeaks, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective(&peaks.peaks, lobe, cosine)
    }

    fn shader(&self) -> Shader {
        Shader::new(&[
            include_str!("phong.wgsl"),
            include_str!("sphere_cosine.wgsl"),
            include_str!("mixture.wgsl"),
        ])
        .constant("SHARPEST", SHARPEST)
    }

    fn isotropic(&self, lobes: &PhongPeaks) -> Option<(Cosine, Vec<NormalLobe>)> {
        Some((cosine, lobes.peaks.clone()))
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        let lobes = |channels: &[f32]| Self::peaks(&self.unpack(channels));
        Box::new(MixtureEvaluator { lobes, cosine, lobe, directions })
    }

    fn fit(&self) -> Option<Fit> {
        Some(Fit { kind: LobeKind::Peaks, lobes: self.peaks, alignment: Alignment::Unaligned })
    }

    fn filterable(&self) -> bool {
        false
    }
}
