//! How many normals point where: the contract every representation keeps, and the table of them.
//!
//! `bake → filter → decode → shade`. What is stored and filtered are **sums** ([`Representation::Sums`]),
//! which mix by plain weighted averaging; what is shaded are decoded parameters
//! ([`Representation::Lobes`]). They are two types, never one with flags. The typed contract is
//! [`Representation`]; every one of them is also a [`Method`], the same thing for callers that choose at
//! run time. [`TABLE`] has one row for each; a row buys the conformance suite in `conformance.rs`.
//! Notation: `docs/notation.md`.

mod environment;
mod fixed;
mod gmm;
mod leadr;
mod mixture;
mod naive;
mod ndm;
mod phong;
mod reflect;
mod sh;
mod slopes;
mod toksvig;
mod vmf;

#[cfg(test)]
mod conformance;

pub use environment::LocalEnvironment;
pub use fixed::Fixed;
pub use gmm::{GaussianMixture, Gmm};
pub use leadr::SlopeGrid;
pub use mixture::{Cosine, LobeSums, NormalLobe};
pub use naive::Naive;
pub use ndm::{Ndm, NdmKernel, NdmNormalisation};
pub use phong::{Phong, PhongPeaks};
pub use reflect::{FilteredTexel, IncidentLight, PreparedBrdf};
pub use sh::{Coefficients, Sh};
pub use slopes::{SlopeGaussian, SlopeMoments, Slopes};
pub use toksvig::{MeanLobe, Toksvig};
pub use vmf::{Vmf, VmfMixture};

use std::fmt::Debug;

use glam::{DMat3, DVec2, DVec3, Vec3};

use crate::brdf::{Brdf, Lambert, Lobe};
use crate::fit::Fit;
use crate::shader::Shader;
use crate::surface::SurfaceRow;
use crate::units::SlopeVariance;

/// One fine texel, as a representation sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit normal.
    pub normal: Vec3,
    /// Height in texture widths; zero where the map has none.
    pub height: f32,
    /// Covariance of the slopes within the texel: xx, yy, xy; zero where the map knows of none.
    pub spread: [f32; 3],
}

/// A way to store a distribution of normals in a texel.
pub trait Representation: Debug + Send + Sync {
    /// Linear quantities, what is stored and filtered: means over the area seen.
    type Sums: Clone + Debug + PartialEq;
    /// What they decode to, and what is shaded.
    type Lobes: Into<Decoded>;

    /// The method's spelling on the command line, in full.
    fn spelling(&self) -> String;

    /// RGBA layers it fills.
    fn layers(&self) -> usize;

    /// What the channels are, as files name it.
    fn encoding(&self) -> &'static str {
        "sums"
    }

    /// Sums over nothing.
    fn zero(&self) -> Self::Sums;

    /// Adds a fine texel that covers the fraction `weight` of the area.
    fn accumulate(&self, sums: &mut Self::Sums, sample: &Sample, weight: f32);

    /// Adds the sums of a part that covers the fraction `weight` of the area.
    fn blend(&self, sums: &mut Self::Sums, part: &Self::Sums, weight: f32);

    /// Writes the sums as channels, four a layer. Spare channels are 1.
    fn pack(&self, sums: &Self::Sums, channels: &mut [f32]);

    /// Reads the sums back.
    fn unpack(&self, channels: &[f32]) -> Self::Sums;

    /// The distribution that the sums stand for; finite for any finite channels.
    fn decode(&self, sums: &Self::Sums) -> Self::Lobes;

    /// The effective lobe `w ↦ ∫ f(w·n) gamma(n) dn` under this distribution.
    fn effective<'a>(&'a self, lobes: &Self::Lobes, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a>;

    /// What [`Self::effective_with`] wants to know of a lobe, the same for all texels.
    fn table(&self, _brdf: &dyn Lobe) -> Vec<f64> {
        Vec::new()
    }

    /// [`Self::effective`] with the lobe's [`Self::table`] at hand.
    fn effective_with<'a>(
        &'a self,
        lobes: &Self::Lobes,
        lobe: &'a dyn Lobe,
        _table: &'a [f64],
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        self.effective(lobes, lobe)
    }

    /// The mean normal, whose length says how far the normals stray.
    fn mean(&self, lobes: &Self::Lobes) -> DVec3;

    /// The distribution as a sum of isotropic lobes, and the cosine that they are a function of, where it is one.
    fn isotropic(&self, _lobes: &Self::Lobes) -> Option<(Cosine, Vec<NormalLobe>)> {
        None
    }

    /// The slopes, and over which of them diffuse facets are averaged, for a method that knows of displacement.
    fn displaced<'a>(&'a self, _lobes: &'a Self::Lobes) -> Option<(&'a SlopeGaussian, &'a leadr::SlopeGrid)> {
        None
    }

    /// The twin of decoding and shading, in WGSL.
    fn shader(&self) -> Shader;

    /// Sets channels that are computed from the filtered sums and are no sums themselves.
    fn finish(&self, _channels: &mut [f32]) {}

    /// What is to be fitted, where sums do not come straight from the fine normals.
    fn fit(&self) -> Option<Fit> {
        None
    }

    /// Writes a fitted lobe's sums as this method's channels, four for each of its layers; spare ones are 1.
    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]) {
        channels[..sums.len()].copy_from_slice(sums);
        channels[sums.len()..].fill(1.0);
    }

    /// False when channels of several texels must not be mixed, and each texel be shaded by itself.
    fn filterable(&self) -> bool {
        true
    }

    /// True when [`Self::params`] does something.
    fn has_finish(&self) -> bool {
        false
    }

    /// The channels of every texel of a row, layer after layer; overridden where speed is worth a second way,
    /// which the conformance suite then holds to the first.
    fn pack_row(&self, row: &SurfaceRow, channels: &mut [f32]) {
        let (layers, width) = (self.layers(), row.width());
        let mut texel = vec![0.0; 4 * layers];
        for i in 0..width {
            let mut sums = self.zero();
            let spread = row.spread.get(i).copied().unwrap_or_default();
            self.accumulate(&mut sums, &Sample { normal: row.normal(i), height: row.height[i], spread }, 1.0);
            self.pack(&sums, &mut texel);
            for (layer, rgba) in texel.as_chunks::<4>().0.iter().enumerate() {
                channels[(layer * width + i) * 4..][..4].copy_from_slice(rgba);
            }
        }
    }

    /// An evaluator for one lobe and one set of directions, which may hold tables for them.
    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a>
    where
        Self: Sized,
    {
        Box::new(OneByOne { representation: self, lobe, directions })
    }

    /// How the flat map's effective lobe differs from the lobe itself, when it does.
    fn flat_lobe(&self, _brdf: &dyn Lobe) -> FlatLobe {
        FlatLobe::Exact
    }
}

/// What a representation makes of a map without any relief.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlatLobe {
    /// The lobe itself.
    Exact,
    /// The lobe cut off at this order of spherical harmonics.
    BandLimited(usize),
    /// The method's own kernel in place of the lobe's shape.
    OwnKernel,
}

/// A decoded texel, for people and scripts to look at.
#[derive(Clone, Debug, PartialEq)]
pub enum Decoded {
    /// A mean normal: unit length for `naive` and `fixed`, shorter for `toksvig`.
    Mean(DVec3),
    /// A Gaussian in space.
    Gaussian {
        /// Mean normal.
        mean: DVec3,
        /// Covariance of the normals.
        covariance: DMat3,
    },
    /// A Gaussian of slopes.
    Slopes {
        /// Mean height in texture widths.
        height: f64,
        /// Mean slope.
        mean: DVec2,
        /// Covariance of the slopes: xx, yy, xy.
        covariance: [f64; 3],
    },
    /// Real spherical-harmonic coefficients: l, then m from -l to l.
    Coefficients(Vec<f64>),
    /// Lobes on the sphere that are alive.
    Lobes(Vec<MixtureLobe>),
    /// Phong peaks, the exponent of each one over its variance.
    Peaks(Vec<MixtureLobe>),
    /// Lobes in the plane of `n.xy` that are alive.
    PlanarLobes(Vec<PlanarLobe>),
}

/// A lobe on the sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureLobe {
    /// The layer it is stored in.
    pub layer: usize,
    /// Share of the texel.
    pub weight: f64,
    /// Unit mean direction.
    pub mean: DVec3,
    /// `1/kappa`; 0 where the stored form can tell no spread.
    pub variance: f64,
}

/// A lobe in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarLobe {
    /// The layer it is stored in.
    pub layer: usize,
    /// Share of the texel.
    pub weight: f64,
    /// Mean of `n.xy`.
    pub mean: DVec2,
    /// `sigma²`, on one axis.
    pub variance: f64,
}

/// Effective lobes of one texel after another, for one BRDF at fixed directions.
pub trait Evaluator: Send + Sync {
    /// The effective lobe of the texel with these `channels` at every direction.
    fn evaluate(&self, channels: &[f32], out: &mut [f64]);
}

struct OneByOne<'a, R> {
    representation: &'a R,
    lobe: &'a dyn Lobe,
    directions: &'a [DVec3],
}

impl<R: Representation> Evaluator for OneByOne<'_, R> {
    fn evaluate(&self, channels: &[f32], out: &mut [f64]) {
        let lobes = self.representation.decode(&self.representation.unpack(channels));
        let effective = self.representation.effective(&lobes, self.lobe);
        for (out, w) in out.iter_mut().zip(self.directions) {
            *out = effective(*w);
        }
    }
}

/// A [`Representation`] chosen at run time.
pub trait Method: Debug + Send + Sync {
    /// The spelling on the command line, in full.
    fn spelling(&self) -> String;

    /// RGBA layers.
    fn layers(&self) -> usize;

    /// What the channels are, as files name it.
    fn encoding(&self) -> &'static str;

    /// The channels of every fine texel of a row: layer after layer, each RGBA texels in order.
    fn accumulate_row(&self, row: &SurfaceRow, channels: &mut [f32]);

    /// Sets, in a filtered row of that layout, the channels that are no sums.
    fn finish_row(&self, channels: &mut [f32]);

    /// Decodes one texel's channels for people and scripts.
    fn describe(&self, channels: &[f32]) -> Decoded;

    /// The mean normal of a texel with these channels, shorter the further its normals stray.
    fn mean_normal(&self, channels: &[f32]) -> DVec3;

    /// An evaluator for one BRDF at fixed directions.
    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a>;

    /// What shading wants to know of a material, the same for all its texels.
    fn prepare(&self, brdf: &Brdf, roughness: SlopeVariance) -> PreparedBrdf;

    /// The light that a texel with these filtered channels sends to the eye; see [`FilteredTexel`].
    fn reflect(&self, texel: &FilteredTexel<'_>, brdf: &Brdf, lights: &[IncidentLight]) -> DVec3;

    /// The light that it sends to the eye of an environment, but for its small bright sources.
    fn reflect_environment(
        &self,
        texel: &FilteredTexel<'_>,
        brdf: &Brdf,
        local: &LocalEnvironment<'_>,
    ) -> DVec3;

    /// What shading wants to know of a material whose roughness goes from `least` to `most`, as shaders take it: entry by entry, at the eleven
    /// roughnesses `least + (k/10)² (most - least)`, and then of the diffuse lobe.
    fn shader_table(&self, brdf: &Brdf, least: SlopeVariance, most: SlopeVariance) -> Vec<[f32; 12]>;

    /// The twin of decoding and shading, in WGSL; see `crates/core/src/shader.rs` for how it is linked.
    fn shader(&self) -> Shader;

    /// What it makes of a flat map.
    fn flat_lobe(&self, lobe: &dyn Lobe) -> FlatLobe;

    /// What is to be fitted; `None` for a method whose sums come straight from the fine normals.
    fn fit(&self) -> Option<Fit>;

    /// Writes a fitted lobe's sums as this method's channels, four for each of its layers.
    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]);

    /// False when channels of several texels must not be mixed, and each texel be shaded by itself.
    fn filterable(&self) -> bool;
}

impl<R: Representation> Method for R {
    fn spelling(&self) -> String {
        Representation::spelling(self)
    }

    fn layers(&self) -> usize {
        Representation::layers(self)
    }

    fn encoding(&self) -> &'static str {
        Representation::encoding(self)
    }

    fn accumulate_row(&self, row: &SurfaceRow, channels: &mut [f32]) {
        self.pack_row(row, channels);
    }

    fn finish_row(&self, channels: &mut [f32]) {
        if !self.has_finish() {
            return;
        }
        let layers = Representation::layers(self);
        let width = channels.len() / (4 * layers);
        let mut texel = vec![0.0; 4 * layers];
        for i in 0..width {
            for (layer, rgba) in texel.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                rgba.copy_from_slice(&channels[(layer * width + i) * 4..][..4]);
            }
            self.finish(&mut texel);
            for (layer, rgba) in texel.as_chunks::<4>().0.iter().enumerate() {
                channels[(layer * width + i) * 4..][..4].copy_from_slice(rgba);
            }
        }
    }

    fn describe(&self, channels: &[f32]) -> Decoded {
        self.decode(&self.unpack(channels)).into()
    }

    fn mean_normal(&self, channels: &[f32]) -> DVec3 {
        self.mean(&self.decode(&self.unpack(channels)))
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        Representation::evaluator(self, lobe, directions)
    }

    fn prepare(&self, brdf: &Brdf, roughness: SlopeVariance) -> PreparedBrdf {
        let lobe = brdf.lobe.widen(roughness);
        let tables = [self.table(&*lobe), self.table(&Lambert::SHARP)];
        PreparedBrdf { roughness, lobe, tables }
    }

    fn reflect(&self, texel: &FilteredTexel<'_>, brdf: &Brdf, lights: &[IncidentLight]) -> DVec3 {
        reflect::reflect(self, texel, brdf, lights)
    }

    fn reflect_environment(
        &self,
        texel: &FilteredTexel<'_>,
        brdf: &Brdf,
        local: &LocalEnvironment<'_>,
    ) -> DVec3 {
        environment::reflect(self, texel, brdf, local)
    }

    fn shader_table(&self, brdf: &Brdf, least: SlopeVariance, most: SlopeVariance) -> Vec<[f32; 12]> {
        let mut entries = vec![[0.0; 12]; Representation::shader(self).table];
        let mut set = |k: usize, table: Vec<f64>| {
            entries.iter_mut().zip(table).for_each(|(entry, value)| entry[k] = value as f32);
        };
        let span = most.get() - least.get();
        for k in 0..11 {
            // All alike where there is but one roughness.
            if k > 0 && span <= 0.0 {
                break;
            }
            let t = k as f64 / 10.0;
            set(k, self.table(&*brdf.lobe.widen(least.widen(SlopeVariance::clamped(span * t * t)))));
        }
        set(11, self.table(&Lambert::SHARP));
        entries
    }

    fn shader(&self) -> Shader {
        Representation::shader(self)
    }

    fn flat_lobe(&self, lobe: &dyn Lobe) -> FlatLobe {
        Representation::flat_lobe(self, lobe)
    }

    fn fit(&self) -> Option<Fit> {
        Representation::fit(self)
    }

    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]) {
        Representation::store_lobe(self, sums, channels);
    }

    fn filterable(&self) -> bool {
        Representation::filterable(self)
    }
}

/// Reads what follows a method's name, split at colons; the error says what is wrong.
pub type Parse = fn(&[&str]) -> Result<Box<dyn Method>, String>;

/// A row of [`TABLE`].
pub struct Row {
    /// The word before the first colon.
    pub name: &'static str,
    /// What may follow it, for help.
    pub parameters: &'static str,
    /// One line for help and docs.
    pub summary: &'static str,
    /// Where it was published.
    pub paper: &'static str,
    /// Reads what follows the name, split at colons.
    pub parse: Parse,
    /// Spellings that the conformance suite runs, the plain one first.
    pub samples: &'static [&'static str],
}

/// Every representation there is.
pub static TABLE: &[Row] =
    &[fixed::ROW, naive::ROW, toksvig::ROW, ndm::ROW, slopes::ROW, sh::ROW, vmf::ROW, gmm::ROW, phong::ROW];

/// A spelling that names no representation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ParseMethodError {
    /// No row of the table has this name.
    #[error("there is no method called `{0}`")]
    Unknown(String),
    /// What follows the name is wrong.
    #[error("method `{spelling}`: {reason}")]
    Parameter {
        /// What was written.
        spelling: String,
        /// What is wrong.
        reason: String,
    },
}

/// Reads a spelling such as `toksvig`, `sh:7` or `ndm:pearson:integrated`.
///
/// # Errors
/// [`ParseMethodError`], naming what is wrong.
pub fn parse(spelling: &str) -> Result<Box<dyn Method>, ParseMethodError> {
    let words: Vec<&str> = spelling.split(':').collect();
    let row = TABLE
        .iter()
        .find(|row| row.name == words[0])
        .ok_or_else(|| ParseMethodError::Unknown(words[0].to_owned()))?;
    (row.parse)(&words[1..])
        .map_err(|reason| ParseMethodError::Parameter { spelling: spelling.to_owned(), reason })
}

/// For rows without parameters.
fn no_parameters(words: &[&str], method: impl Method + 'static) -> Result<Box<dyn Method>, String> {
    if words.is_empty() { Ok(Box::new(method)) } else { Err("takes no parameter".to_owned()) }
}

/// A direction, or `(0,0,1)` for a vector that is none.
fn direction_or_up(v: DVec3) -> DVec3 {
    v.try_normalize().unwrap_or(DVec3::Z)
}
