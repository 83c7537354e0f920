//! Shading a filtered texel: what its normals together send to the eye.
//!
//! The mean over normals of `f(wh·n) c(n)` (`reflection.rs`). f is the effective lobe's business. c varies slowly, and is
//! taken at the normals that answer: those of lobe j that f picks, of mean `mu_j/v_j + wh/b`, b the variance of f, as for a
//! product of two Gaussians. The papers take c at `mu_j`; for a lobe wider than f that is not where the light comes from.

use std::f64::consts::PI;

use glam::{DMat2, DVec3};

use super::{Representation, Shaded, direction_or_up, leadr};
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
pub struct FilteredTexel<'a> {
    /// Channels as filtered, four a layer.
    pub channels: &'a [f32],
    /// What it is made of: in the layer of a lobe, or (`None`) over all.
    pub finish: &'a dyn Fn(Option<usize>) -> Finish,
    /// What was prepared for the material.
    pub prepared: &'a Prepared,
    /// Shade as the papers print it: factors at the lobes' means; for displaced surfaces, the rational form of masking.
    pub at_means: bool,
    /// For a displaced surface, how slopes of the map lie on it; `None` for a normal map.
    pub relief: Option<DMat2>,
}

/// Light that a filtered texel sends to the eye.
pub(super) fn reflect<R: Representation + ?Sized>(
    representation: &R,
    texel: &FilteredTexel<'_>,
    reflection: &Reflection,
    lights: &[Lit],
) -> DVec3 {
    let decoded = representation.decode(&representation.unpack(texel.channels));
    if let (Some(by), Some((slopes, grid))) = (texel.relief, representation.displaced(&decoded)) {
        return leadr::reflect((&slopes.stretched(by), grid), texel, reflection, lights);
    }
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
pub(super) fn answering(lobe: &Shaded, mu: DVec3, base: SlopeVariance, wh: DVec3) -> DVec3 {
    (mu * base.get() + wh * lobe.variance.get()).try_normalize().unwrap_or(mu)
}

/// Puts colours on the specular and the diffuse part.
pub(super) fn together(
    reflection: &Reflection,
    finish: &Finish,
    way: &Way,
    (specular, diffuse): (f64, f64),
) -> DVec3 {
    let diffuse = finish.diffuse * (diffuse.max(0.0) / PI);
    if !reflection.is_specular() {
        return diffuse;
    }
    let fresnel = reflection.model.fresnel(finish.specular, way.u);
    reflection.lobe.tint(way.u) * fresnel * specular.max(0.0)
        + reflection.model.diffuse_share(fresnel) * diffuse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf;
    use crate::ndf;
    use crate::reflection::Model;
    use glam::Vec3;

    /// Normals of a Gaussian of slopes on an even lattice, some 30 degrees wide.
    fn normals() -> Vec<Vec3> {
        let axis = (0..41).map(|i| (f64::from(i) - 20.0) / 20.0 * 1.2);
        let lattice = axis.clone().flat_map(|x| axis.clone().map(move |y| (x, y)));
        // Density by repetition: a texel for each weight that exceeds its place in a fixed order.
        let keep = |(i, (x, y)): (usize, (f64, f64))| {
            let density = (-(x * x + y * y) / (2.0 * 0.25)).exp();
            let place = (i as f64 * 0.618_033_988_749_895).fract();
            (density > place).then(|| Vec3::new(-x as f32, -y as f32, 1.0).normalize())
        };
        lattice.enumerate().filter_map(keep).collect()
    }

    #[test]
    fn factors_belong_to_the_normals_that_answer() {
        // One wide lobe under a narrow BRDF: light comes from a few of its normals, not from the mean.
        let normals = normals();
        let finish = Finish { diffuse: DVec3::ZERO, specular: DVec3::ONE, gloss: SlopeVariance::ZERO };
        for model in Model::ALL {
            let reflection = Reflection { lobe: brdf::parse("blinn-phong:200").unwrap(), model };
            for method in ["vmf:1", "slopes"] {
                let method = ndf::parse(method).unwrap();
                let mut channels = vec![0.0; 4 * method.layers()];
                let row = |n: &Vec3| {
                    let mut row = crate::surface::SurfaceRow::flat(1);
                    row.set_normal(0, *n);
                    row
                };
                let mut one = vec![0.0; channels.len()];
                for n in &normals {
                    method.accumulate_row(&row(n), &mut one);
                    channels.iter_mut().zip(&one).for_each(|(sum, c)| *sum += c / normals.len() as f32);
                }
                let prepared = method.prepare(&reflection, SlopeVariance::ZERO);
                let (mut faithful, mut ours) = (0.0, 0.0);
                for k in 0..60 {
                    let (sin, cos) = (0.1 * f64::from(k)).sin_cos();
                    let wi = DVec3::new(0.7 * cos, 0.7 * sin, 0.6).normalize();
                    let wo = DVec3::new(0.5 * sin, -0.3, 0.8).normalize();
                    let way = Way::new(wi, wo).unwrap();
                    // The factor that the facets have together, each as bright as its lobe: mean f c over mean f.
                    let lobe = |n: &Vec3| reflection.lobe.evaluate(n.as_dvec3().dot(way.wh));
                    let bright = |n: &Vec3| lobe(n) * reflection.factor(n.as_dvec3(), &way, finish.gloss);
                    let exact =
                        normals.iter().map(bright).sum::<f64>() / normals.iter().map(lobe).sum::<f64>();
                    let by = |at_means| {
                        let texel = FilteredTexel {
                            channels: &channels,
                            finish: &|_| finish,
                            prepared: &prepared,
                            at_means,
                            relief: None,
                        };
                        let lit = Lit { way, irradiance: DVec3::ONE };
                        method.reflect(&texel, &reflection, &[lit]).x
                    };
                    // The method's own lobe is the same in both; the mean of these normals is the vertical.
                    let at_mean = reflection.factor(DVec3::Z, &way, finish.gloss);
                    faithful += (at_mean - exact).powi(2);
                    ours += (at_mean * by(false) / by(true) - exact).powi(2);
                }
                assert!(ours < 0.1 * faithful, "{model:?} {}: {ours} {faithful}", method.spelling());
            }
        }
    }
}
