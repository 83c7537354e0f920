//! Shading a filtered texel: what its normals together send to the eye.
//!
//! The mean over normals of `f(wh·n) c(n)` (`reflection.rs`). f is the effective lobe's business. c varies slowly, and is
//! taken at the normals that answer: those of lobe j that f picks, of mean `mu_j/v_j + wh/b`, b the variance of f, as for a
//! product of two Gaussians. The papers take c at `mu_j`; for a lobe wider than f that is not where the light comes from.

use std::f64::consts::PI;

use glam::DVec3;

use super::{Representation, Shaded, direction_or_up};
use crate::brdf::{Brdf, Lambert};
use crate::reflection::{Finish, Reflection, Way};
use crate::units::SlopeVariance;

/// A light's way to the eye, and its irradiance on a plane that faces it, in linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lit {
    /// The way.
    pub way: Way,
    /// The irradiance.
    pub irradiance: DVec3,
}

/// What shading wants to know of a material, made once by [`super::Method::prepare`].
pub struct Prepared {
    /// The gloss it is made for.
    pub(super) gloss: SlopeVariance,
    /// The lobe widened by it.
    pub(super) lobe: Box<dyn Brdf>,
    /// The method's tables for that lobe and for the diffuse one.
    pub(super) tables: [Vec<f64>; 2],
}

/// A filtered texel.
#[derive(Clone, Copy)]
pub struct Filtered<'a> {
    /// Channels as filtered, four a layer.
    pub channels: &'a [f32],
    /// What it is made of: in the layer of a lobe, or (`None`) over all.
    pub finish: &'a dyn Fn(Option<usize>) -> Finish,
    /// What was prepared for the material.
    pub prepared: &'a Prepared,
    /// Take factors at the lobes' means, as the papers print it.
    pub at_means: bool,
}

/// Light that a filtered texel sends to the eye.
pub(super) fn reflect<R: Representation + ?Sized>(
    representation: &R,
    texel: &Filtered<'_>,
    reflection: &Reflection,
    lights: &[Lit],
) -> DVec3 {
    let decoded = representation.decode(&representation.unpack(texel.channels));
    let Some((cosine, lobes)) = representation.isotropic(&decoded) else {
        let finish = (texel.finish)(None);
        let Prepared { gloss, lobe, tables: [table, diffuse_table] } = texel.prepared;
        // Where a gloss map says something else than what was prepared for, the lobe is made anew.
        let own = (finish.gloss != *gloss).then(|| reflection.lobe.widen(finish.gloss));
        let lobe = match &own {
            Some(own) => representation.effective(&decoded, &**own),
            None => representation.effective_with(&decoded, &**lobe, table),
        };
        let diffuse = representation.effective_with(&decoded, &Lambert::SHARP, diffuse_table);
        let width = reflection.width(finish.gloss);
        let mean = representation.mean(&decoded);
        let length = mean.length().clamp(1e-3, 1.0);
        let whole = Shaded::alone(direction_or_up(mean), SlopeVariance::clamped((1.0 - length) / length));
        let of = |light: &Lit| {
            let specular = if reflection.is_specular() {
                let n = if texel.at_means {
                    whole.mean
                } else {
                    answering(&whole, whole.mean, width, light.way.wh)
                };
                lobe(light.way.wh) * reflection.factor(n, &light.way, finish.gloss)
            } else {
                0.0
            };
            light.irradiance * together(reflection, &finish, &light.way, (specular, diffuse(light.way.wi)))
        };
        return lights.iter().map(of).sum();
    };
    let mut sum = DVec3::ZERO;
    for lobe in &lobes {
        let finish = (texel.finish)(Some(lobe.layer));
        let (mu, base) = (lobe.direction(), reflection.width(finish.gloss));
        let widening = lobe.variance.widen(finish.gloss);
        for Lit { way, irradiance } in lights {
            let f = if reflection.is_specular() {
                reflection.lobe.evaluate_widened(widening, cosine(way.wh, lobe.mean))
            } else {
                0.0
            };
            let specular = if f > 0.0 {
                let n = if texel.at_means { mu } else { answering(lobe, mu, base, way.wh) };
                f * reflection.factor(n, way, finish.gloss)
            } else {
                0.0
            };
            let diffuse = Lambert::SHARP.evaluate_widened(lobe.variance, way.wi.dot(mu));
            sum += *irradiance * lobe.weight * together(reflection, &finish, way, (specular, diffuse));
        }
    }
    sum
}

/// Mean direction of a lobe's normals that send light along the half-vector.
fn answering(lobe: &Shaded, mu: DVec3, base: SlopeVariance, wh: DVec3) -> DVec3 {
    (mu * base.get() + wh * lobe.variance.get()).try_normalize().unwrap_or(mu)
}

/// Puts colours on the specular and the diffuse part.
fn together(reflection: &Reflection, finish: &Finish, way: &Way, (specular, diffuse): (f64, f64)) -> DVec3 {
    let diffuse = finish.diffuse * (diffuse.max(0.0) / PI);
    if !reflection.is_specular() {
        return diffuse;
    }
    let fresnel = reflection.model.fresnel(finish.specular, way.u);
    fresnel * specular.max(0.0) + reflection.model.diffuse_share(fresnel) * diffuse
}
