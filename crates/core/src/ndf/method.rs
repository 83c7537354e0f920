//! The contract of a method: its properties, how it stores and decodes, and all of this for callers that
//! choose at run time.

use std::any::Any;
use std::fmt::{self, Debug, Display};
use std::ops::Deref;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{
    Decoded, Encoding, FilteredTexel, Form, FormKind, IncidentLight, LobeLayout, LocalEnvironment,
    PreparedBrdf, environment, reflect,
};
use crate::brdf::{Brdf, Lambert, Lobe};
use crate::fit::Fit;
use crate::shader::{LobeTable, Shader, TABLE_ROUGHNESSES};
use crate::surface::SurfaceRow;
use crate::units::SlopeVariance;

/// Fine texel, as a method sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Unit normal.
    pub normal: Vec3,
    /// Height in texture widths; zero where the map has none.
    pub height: f32,
    /// Covariance of the slopes within the texel: xx, yy, xy; zero where the map knows of none.
    pub spread: [f32; 3],
}

/// Properties that a method states of itself. [`Display`] writes its spelling, in full.
pub trait Describe: Debug + Display + Send + Sync {
    /// Encoding of its channels.
    fn encoding(&self) -> Encoding;

    /// Form in which its texels are shaded.
    fn form_kind(&self) -> FormKind;

    /// Text of the twin of decoding and shading, in WGSL; see `crates/core/src/shader.rs` for how it is
    /// linked.
    fn shader(&self) -> Shader;

    /// True for channels that the method can read, though another method may have stored them.
    fn reads(&self, stored: &Encoding) -> bool {
        self.encoding() == *stored
    }

    /// Lobes to be fitted; `None` for a method whose sums come straight from the fine normals.
    fn fit(&self) -> Option<Fit> {
        None
    }

    /// False when channels of several texels must not be mixed, so that each texel is shaded by itself.
    fn filterable(&self) -> bool {
        true
    }

    /// Effective lobe of a flat map, where that is not the lobe itself.
    fn flat_lobe(&self, _lobe: &dyn Lobe) -> FlatLobe {
        FlatLobe::Exact
    }

    /// RGBA layers, without attributes.
    fn layers(&self) -> usize {
        self.encoding().layers()
    }

    /// RGBA layers with so many attributes.
    fn layers_with(&self, attributes: usize) -> usize {
        self.lobe_layout().map_or_else(|| self.layers(), |layout| layout.layers(attributes))
    }

    /// Layers of each lobe, for a method whose channels are lobes.
    fn lobe_layout(&self) -> Option<LobeLayout> {
        self.encoding().lobes()
    }

    /// True when lobes can carry attributes: fitted lobes, sums over normals that have values of their own.
    fn carries_attributes(&self) -> bool {
        self.form_kind() == FormKind::Lobes && self.fit().is_some() && self.filterable()
    }

    /// True when texels of a displaced surface are shaded as such.
    fn knows_displacement(&self) -> bool {
        self.form_kind() == FormKind::Slopes
    }
}

/// A method whose types are known: how it stores a distribution of normals in a texel, and reads it.
pub trait Representation: Describe + Clone + PartialEq + 'static {
    /// Linear quantities, which are stored and filtered: means over the area seen.
    type Sums: Clone + Debug + PartialEq;
    /// Parameters that sums decode to, which are shaded.
    type Lobes: Into<Decoded>;

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

    /// Form in which the distribution is shaded; always of the kind that [`Describe::form_kind`] says.
    fn form<'a>(&'a self, lobes: &Self::Lobes) -> Form<'a>;

    /// The effective lobe `w ↦ ∫ f(w·n) gamma(n) dn` under this distribution.
    fn effective<'a>(&'a self, lobes: &Self::Lobes, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a>;

    /// Numbers of a lobe that [`Self::effective_with`] takes, the same for all texels.
    fn table(&self, _lobe: &dyn Lobe) -> Vec<f64> {
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

    /// Sets channels that are computed from the filtered sums and are no sums themselves.
    fn finish(&self, _channels: &mut [f32]) {}

    /// True when [`Self::finish`] does something.
    fn has_finish(&self) -> bool {
        false
    }

    /// Writes a fitted lobe's sums as this method's channels, four for each of its layers; spare ones are 1.
    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]) {
        channels[..sums.len()].copy_from_slice(sums);
        channels[sums.len()..].fill(1.0);
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
    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        Box::new(OneByOne { representation: self, lobe, directions })
    }
}

/// Effective lobe of a flat map, by a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlatLobe {
    /// The lobe itself.
    Exact,
    /// The lobe cut off at this order of spherical harmonics.
    BandLimited(usize),
    /// A lobe of the method's own shape.
    OwnKernel,
}

/// Effective lobes of one texel after another, for one lobe at fixed directions.
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

/// Reader of texels' channels as effective lobes: a method, or the one lobe of an engine's own material
/// ([`crate::roughness::EngineLobe`]).
pub trait Shows: Send + Sync {
    /// Evaluator of texels for one lobe at fixed directions.
    fn show<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a>;

    /// True for channels of several texels that may be mixed before they are read.
    fn mixes(&self) -> bool {
        true
    }
}

impl<R: Representation> Shows for R {
    fn show<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        Representation::evaluator(self, lobe, directions)
    }

    fn mixes(&self) -> bool {
        self.filterable()
    }
}

/// A [`Representation`] chosen at run time; [`AnyMethod`] owns one.
pub trait Method: Describe + Shows {
    /// The channels of every fine texel of a row: layer after layer, each RGBA texels in order.
    fn accumulate_row(&self, row: &SurfaceRow, channels: &mut [f32]);

    /// Sets, in a filtered row of that layout, the channels that are no sums.
    fn finish_row(&self, channels: &mut [f32]);

    /// Writes a fitted lobe's sums as this method's channels, four for each of its layers.
    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]);

    /// Decodes one texel's channels for people and scripts.
    fn describe(&self, channels: &[f32]) -> Decoded;

    /// The mean normal of a texel with these channels, shorter the further its normals stray.
    fn mean_normal(&self, channels: &[f32]) -> DVec3;

    /// An evaluator for one lobe at fixed directions.
    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a>;

    /// A BRDF with everything that shading by this method needs of it, for texels of this roughness or
    /// others.
    fn prepare(&self, brdf: &Brdf, roughness: SlopeVariance) -> PreparedBrdf;

    /// The light that a texel sends to the eye; see [`FilteredTexel`].
    fn reflect(&self, texel: &FilteredTexel<'_>, lights: &[IncidentLight]) -> DVec3;

    /// Light of an environment, without its small bright sources, that a texel sends to the eye.
    fn reflect_environment(&self, texel: &FilteredTexel<'_>, local: &LocalEnvironment<'_>) -> DVec3;

    /// [`Representation::table`] of a BRDF whose roughness goes from `least` to `most`, as shaders take it.
    fn shader_table(&self, brdf: &Brdf, least: SlopeVariance, most: SlopeVariance) -> LobeTable;

    /// Form that a texel with these channels decodes to.
    #[cfg(test)]
    fn form_of(&self, channels: &[f32]) -> FormKind;

    /// True for the same method with the same options.
    fn equals(&self, other: &dyn Method) -> bool;

    /// The method as `Any`, to be cast down to its own type.
    fn as_any(&self) -> &dyn Any;
}

impl<R: Representation> Method for R {
    fn accumulate_row(&self, row: &SurfaceRow, channels: &mut [f32]) {
        self.pack_row(row, channels);
    }

    fn finish_row(&self, channels: &mut [f32]) {
        if !self.has_finish() {
            return;
        }
        let layers = self.layers();
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

    fn store_lobe(&self, sums: &[f32], channels: &mut [f32]) {
        Representation::store_lobe(self, sums, channels);
    }

    fn describe(&self, channels: &[f32]) -> Decoded {
        self.decode(&self.unpack(channels)).into()
    }

    fn mean_normal(&self, channels: &[f32]) -> DVec3 {
        self.form(&self.decode(&self.unpack(channels))).mean()
    }

    fn evaluator<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        Representation::evaluator(self, lobe, directions)
    }

    fn prepare(&self, brdf: &Brdf, roughness: SlopeVariance) -> PreparedBrdf {
        let lobe = brdf.lobe.widen(roughness);
        let (table, diffuse_table) = (self.table(&*lobe), self.table(&Lambert::SHARP));
        let channels = brdf.channels();
        let channels = channels.map(|own| Box::new(own.each_ref().map(|brdf| self.prepare(brdf, roughness))));
        PreparedBrdf { brdf: brdf.clone(), roughness, lobe, table, diffuse_table, channels }
    }

    fn reflect(&self, texel: &FilteredTexel<'_>, lights: &[IncidentLight]) -> DVec3 {
        texel.by_channels(|texel, _| reflect::reflect(self, texel, lights))
    }

    fn reflect_environment(&self, texel: &FilteredTexel<'_>, local: &LocalEnvironment<'_>) -> DVec3 {
        texel.by_channels(|texel, channel| {
            let split_sum = local.split_sum.channel(channel);
            environment::reflect(self, texel, &LocalEnvironment { split_sum, ..*local })
        })
    }

    fn shader_table(&self, brdf: &Brdf, least: SlopeVariance, most: SlopeVariance) -> LobeTable {
        if let Some(channels) = brdf.channels() {
            return LobeTable::concat(&channels.each_ref().map(|brdf| self.shader_table(brdf, least, most)));
        }
        let mut table = LobeTable::new(self.shader().entries());
        let span = most.get() - least.get();
        for k in 0..TABLE_ROUGHNESSES {
            // All alike where there is but one roughness.
            if k > 0 && span <= 0.0 {
                break;
            }
            let t = k as f64 / (TABLE_ROUGHNESSES - 1) as f64;
            let roughness = least.widen(SlopeVariance::clamped(span * t * t));
            table.set(k, &self.table(&*brdf.lobe.widen(roughness)));
        }
        table.set_diffuse(&self.table(&Lambert::SHARP));
        table
    }

    #[cfg(test)]
    fn form_of(&self, channels: &[f32]) -> FormKind {
        self.form(&self.decode(&self.unpack(channels))).kind()
    }

    fn equals(&self, other: &dyn Method) -> bool {
        other.as_any().downcast_ref::<R>() == Some(self)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl PartialEq for dyn Method {
    fn eq(&self, other: &Self) -> bool {
        self.equals(other)
    }
}

/// Method of any kind, shared. Cloning costs nothing. Methods compare by kind and options, and are read from
/// and written as their spelling.
#[derive(Clone)]
pub struct AnyMethod(Arc<dyn Method>);

impl<R: Representation> From<R> for AnyMethod {
    fn from(method: R) -> Self {
        Self(Arc::new(method))
    }
}

impl Deref for AnyMethod {
    type Target = dyn Method;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl PartialEq for AnyMethod {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Debug for AnyMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Debug::fmt(&*self.0, f)
    }
}

impl Display for AnyMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Display::fmt(&*self.0, f)
    }
}
