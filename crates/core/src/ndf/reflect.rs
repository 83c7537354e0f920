//! Shading a filtered texel: the light that its normals together send to the eye.
//!
//! The mean over normals of `f(wh·n) c(n)` (`brdf/shading.rs`). f is the effective lobe's business. c varies
//! slowly, and is taken at the normals that answer: those of lobe j that f picks, of mean `mu_j/v_j + wh/b`,
//! b the variance of f, as for a product of two Gaussians. The papers take c at `mu_j`; for a lobe wider than
//! f that is not where the light comes from.

use std::f64::consts::PI;

use glam::{DMat2, DVec3};

use super::mixture::{SERIES_ORDER, series};
use super::{Form, NormalLobe, Representation, Response, leadr};
use crate::brdf::{AnyLobe, Brdf, Directions, Lambert, SurfaceParams, Widen};
use crate::units::SlopeVariance;

/// Incident light: its path to the eye, and its irradiance on a plane that faces it, in linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IncidentLight {
    /// Path from the light to the eye.
    pub directions: Directions,
    /// Irradiance that comes along it.
    pub irradiance: DVec3,
}

/// Material prepared for shading, made once by [`super::Method::prepare`].
pub struct PreparedBrdf {
    /// The material's BRDF.
    pub(super) brdf: Brdf,
    /// The roughness it is made for.
    pub(super) roughness: SlopeVariance,
    /// The lobe widened by it.
    pub(super) lobe: AnyLobe,
    /// The method's numbers for that lobe.
    pub(super) table: Vec<f64>,
    /// The method's numbers for the diffuse lobe.
    pub(super) diffuse_table: Vec<f64>,
    /// All that of each channel, for a lobe whose channels differ by more than a colour.
    pub(super) channels: Option<Box<[PreparedBrdf; 3]>>,
}

impl PreparedBrdf {
    /// The BRDF that was prepared.
    #[must_use]
    pub fn brdf(&self) -> &Brdf {
        &self.brdf
    }
}

/// A filtered texel.
#[derive(Clone, Copy)]
pub struct FilteredTexel<'a> {
    /// Channels as filtered, four a layer.
    pub channels: &'a [f32],
    /// Surface parameters: under one of its lobes, or (`None`) over all.
    pub params: &'a dyn Fn(Option<usize>) -> SurfaceParams,
    /// The material, prepared for shading.
    pub prepared: &'a PreparedBrdf,
    /// True to shade as the papers print it: factors and diffuse light at the lobes' means; highlights of an
    /// environment by Han et al.'s equation 26 alone; for displaced surfaces, the rational form of masking.
    pub at_means: bool,
    /// For a displaced surface, how slopes of the map lie on it; `None` for a normal map.
    pub slope_map: Option<DMat2>,
}

impl FilteredTexel<'_> {
    /// Light of the texel by a function, which is asked once a channel, with its number, where a lobe's
    /// channels differ by more than a colour.
    pub(super) fn by_channels(&self, light: impl Fn(&FilteredTexel<'_>, usize) -> DVec3) -> DVec3 {
        match &self.prepared.channels {
            None => light(self, 0),
            Some(channels) => {
                let of = |c: usize| light(&FilteredTexel { prepared: &channels[c], ..*self }, c)[c];
                DVec3::new(of(0), of(1), of(2))
            }
        }
    }
}

/// Light that a filtered texel sends to the eye.
pub(super) fn reflect<R: Representation>(
    representation: &R,
    texel: &FilteredTexel<'_>,
    lights: &[IncidentLight],
) -> DVec3 {
    let decoded = representation.decode(&representation.unpack(texel.channels));
    let form = representation.form(&decoded);
    match (&form, texel.slope_map) {
        (Form::Slopes(slopes, grid), Some(by)) => leadr::reflect(&slopes.stretched(by), grid, texel, lights),
        (Form::Lobes(lobes, response), _) => of_lobes(lobes, *response, texel, lights),
        (Form::Slopes(..) | Form::Whole(_), _) => {
            of_whole(representation, &decoded, &form.whole(), texel, lights)
        }
    }
}

/// Light of one distribution, through its effective lobe; `whole` is the isotropic lobe of normals most like
/// it.
fn of_whole<R: Representation>(
    representation: &R,
    decoded: &R::Lobes,
    whole: &NormalLobe,
    texel: &FilteredTexel<'_>,
    lights: &[IncidentLight],
) -> DVec3 {
    let params = (texel.params)(None);
    let PreparedBrdf { brdf, roughness, lobe, table, diffuse_table, .. } = texel.prepared;
    // Where a roughness map differs from the roughness prepared for, the lobe is made anew.
    let own = (params.roughness != *roughness).then(|| brdf.lobe.widen(params.roughness));
    let lobe = match &own {
        Some(own) => representation.effective(decoded, &**own),
        None => representation.effective_with(decoded, &**lobe, table),
    };
    let diffuse = representation.effective_with(decoded, &Lambert::SHARP, diffuse_table);
    let width = brdf.width(params.roughness);
    let of = |light: &IncidentLight| {
        let specular = if brdf.is_specular() {
            let n = if texel.at_means {
                whole.mean
            } else {
                responding_normal(whole, whole.mean, width, light.directions.wh)
            };
            lobe(light.directions.wh) * brdf.factor(n, &light.directions, params.roughness)
        } else {
            0.0
        };
        let answer = Answer { specular, diffuse: diffuse(light.directions.wi) };
        light.irradiance * answer.coloured(brdf, &params, &light.directions)
    };
    lights.iter().map(of).sum()
}

/// Light of a sum of isotropic lobes, each shaded by itself.
fn of_lobes(
    lobes: &[NormalLobe],
    response: Response,
    texel: &FilteredTexel<'_>,
    lights: &[IncidentLight],
) -> DVec3 {
    let brdf = &texel.prepared.brdf;
    let mut sum = DVec3::ZERO;
    for lobe in lobes {
        let params = (texel.params)(Some(lobe.index));
        let (mu, base) = (lobe.direction(), brdf.width(params.roughness));
        let widening = lobe.variance.widen(params.roughness);
        // Where a roughness map differs from the roughness prepared for, the series is made anew.
        let anew = response == Response::Series && params.roughness != texel.prepared.roughness;
        let own = anew.then(|| brdf.lobe.widen(params.roughness).zonal(SERIES_ORDER));
        let rho = own.as_deref().unwrap_or(&texel.prepared.table);
        for IncidentLight { directions, irradiance } in lights {
            let f = match response {
                _ if !brdf.is_specular() => 0.0,
                Response::Series => series(rho, lobe.variance, directions.wh.dot(lobe.mean)),
                _ => response.value(&*brdf.lobe, widening, (directions.wh, lobe.mean)),
            };
            let specular = if f > 0.0 {
                let n = if texel.at_means { mu } else { responding_normal(lobe, mu, base, directions.wh) };
                f * brdf.factor(n, directions, params.roughness)
            } else {
                0.0
            };
            // The papers take the cosine at the mean.
            let spread = if texel.at_means { SlopeVariance::ZERO } else { lobe.variance };
            let diffuse_mean = if response == Response::Short { lobe.mean } else { mu };
            let diffuse = Lambert::SHARP.value_widened(spread, directions.wi.dot(diffuse_mean));
            let answer = Answer { specular, diffuse };
            sum += *irradiance * lobe.weight * answer.coloured(brdf, &params, directions);
        }
    }
    sum
}

/// Mean direction of a lobe's normals that send light along the half-vector.
pub(super) fn responding_normal(lobe: &NormalLobe, mu: DVec3, base: SlopeVariance, wh: DVec3) -> DVec3 {
    (mu * base.get() + wh * lobe.variance.get()).try_normalize().unwrap_or(mu)
}

/// Light of a texel before colour: what facets reflect, Fresnel's term apart, and the mean cosine to the
/// light.
pub(super) struct Answer {
    pub(super) specular: f64,
    pub(super) diffuse: f64,
}

impl Answer {
    /// Light of both parts, with their colours.
    pub(super) fn coloured(&self, brdf: &Brdf, params: &SurfaceParams, directions: &Directions) -> DVec3 {
        let diffuse = params.diffuse * (self.diffuse.max(0.0) / PI);
        if !brdf.is_specular() {
            return diffuse;
        }
        let fresnel = brdf.shading.fresnel(params.specular, directions.u);
        brdf.lobe.tint(directions.u) * fresnel * self.specular.max(0.0)
            + brdf.shading.diffuse_share(fresnel) * diffuse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::brdf::ShadingModel;

    use crate::ndf::AnyMethod;
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
        let params =
            SurfaceParams { diffuse: DVec3::ZERO, specular: DVec3::ONE, roughness: SlopeVariance::ZERO };
        for shading in ShadingModel::ALL {
            let brdf = Brdf { lobe: "blinn-phong:200".parse::<AnyLobe>().unwrap(), shading };
            for method in ["vmf:1", "slopes"] {
                let method = method.parse::<AnyMethod>().unwrap();
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
                let prepared = method.prepare(&brdf, SlopeVariance::ZERO);
                let (mut faithful, mut ours) = (0.0, 0.0);
                for k in 0..60 {
                    let (sin, cos) = (0.1 * f64::from(k)).sin_cos();
                    let wi = DVec3::new(0.7 * cos, 0.7 * sin, 0.6).normalize();
                    let wo = DVec3::new(0.5 * sin, -0.3, 0.8).normalize();
                    let directions = Directions::new(wi, wo).unwrap();
                    // The factor that the facets have together, each as bright as its lobe: mean f c over
                    // mean f.
                    let lobe = |n: &Vec3| brdf.lobe.evaluate(n.as_dvec3().dot(directions.wh));
                    let bright =
                        |n: &Vec3| lobe(n) * brdf.factor(n.as_dvec3(), &directions, params.roughness);
                    let exact =
                        normals.iter().map(bright).sum::<f64>() / normals.iter().map(lobe).sum::<f64>();
                    let by = |at_means| {
                        let texel = FilteredTexel {
                            channels: &channels,
                            params: &|_| params,
                            prepared: &prepared,
                            at_means,
                            slope_map: None,
                        };
                        let lit = IncidentLight { directions, irradiance: DVec3::ONE };
                        method.reflect(&texel, &[lit]).x
                    };
                    // The method's own lobe is the same in both; the mean of these normals is the vertical.
                    let at_mean = brdf.factor(DVec3::Z, &directions, params.roughness);
                    faithful += (at_mean - exact).powi(2);
                    ours += (at_mean * by(false) / by(true) - exact).powi(2);
                }
                assert!(ours < 0.1 * faithful, "{shading:?} {}: {ours} {faithful}", method);
            }
        }
    }
}
