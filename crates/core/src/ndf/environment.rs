//! Shading a filtered texel under an environment: the light from everywhere that its normals together send to
//! the eye.
//!
//! A sum of isotropic lobes is lit lobe by lobe. Diffuse: Han et al. 2007, equation 25. Specular: the mean
//! radiance that the lobe sees, by either [`Technique`], times the share of a white sky that it reflects
//! (`light/split_sum.rs`). A method that is no such sum is lit as one lobe, of its mean and spread. But a
//! Gaussian of slopes is lit over a grid of them, as LEADR has it (Dupuy et al. 2013, sections 3.5 and 3.6):
//! each slope mirrors the eye into the environment, looked up as wide as the solid angle that it stands for;
//! on a displaced surface it counts by what the eye sees of it, and on a normal map by its share of the map.
//! Small bright sources are lights, and none of this file's business.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::leadr::{SlopeGrid, SlopeSample};
use super::reflect::responding_normal;
use super::{FilteredTexel, Form, NormalLobe, Representation, SlopeGaussian};
use crate::brdf::{Brdf, Directions, Lobe, Microfacets, ShadingModel, SurfaceParams};
use crate::light::SplitSum;
use crate::light::environment::{FilteredEnvironment, HALF_VECTOR_ORDER, Technique};
use crate::units::SlopeVariance;

/// Environment, as a point of the surface sees it.
#[derive(Clone, Copy)]
pub struct LocalEnvironment<'a> {
    /// The light.
    pub light: &'a FilteredEnvironment,
    /// Technique by which highlights look it up.
    pub technique: Technique,
    /// Rotation from the tangent frame to the environment's.
    pub to_environment: DMat3,
    /// Unit vector to the eye, in the tangent frame.
    pub wo: DVec3,
    /// Light of a white sky that the material reflects.
    pub split_sum: &'a SplitSum,
}

/// Light that a filtered texel sends to the eye.
pub(super) fn reflect<R: Representation>(
    representation: &R,
    texel: &FilteredTexel<'_>,
    local: &LocalEnvironment<'_>,
) -> DVec3 {
    let decoded = representation.decode(&representation.unpack(texel.channels));
    let form = representation.form(&decoded);
    match &form {
        Form::Slopes(slopes, grid) => of_slopes(slopes, grid, texel, local),
        Form::Lobes(lobes, _) => {
            let of = |lobe: &NormalLobe| {
                lobe.weight * of_lobe(lobe, &(texel.params)(Some(lobe.index)), texel, local)
            };
            lobes.iter().map(of).sum()
        }
        Form::Whole(_) => of_lobe(&form.whole(), &(texel.params)(None), texel, local),
    }
}

/// Light of one lobe of normals.
fn of_lobe(
    lobe: &NormalLobe,
    params: &SurfaceParams,
    texel: &FilteredTexel<'_>,
    local: &LocalEnvironment<'_>,
) -> DVec3 {
    let (brdf, printed) = (&texel.prepared.brdf, texel.at_means);
    let mu = lobe.direction();
    let spread = lobe.variance.widen(params.roughness);
    let reflected = local.split_sum.lookup(mu.dot(local.wo), spread);
    let irradiance =
        local.light.irradiance.of_normals(local.to_environment * mu, lobe.variance.get(), printed);
    let diffuse = params.diffuse * irradiance / PI;
    if !brdf.is_specular() {
        return diffuse;
    }
    let seen = match local.technique {
        Technique::Prefiltered => {
            let cube = local.light.prefiltered(local.split_sum.microfacets);
            let towards = local.to_environment * reflected.towards(mu, local.wo);
            cube.lookup(towards, Microfacets::level(brdf.width(spread), reflected.blur, cube.levels()))
        }
        Technique::Harmonics if printed => {
            // Equation 26 alone, with what does not depend on the normal.
            let highlight = over_half_vectors(mu, spread, printed, local);
            let seen = brdf.fresnel(params.specular, mu.dot(local.wo).max(0.0)) * highlight;
            return seen + reflected.diffuse_share(brdf.shading, params.specular) * diffuse;
        }
        Technique::Harmonics => over_half_vectors(mu, spread, printed, local) / reflected.lobe.max(1e-9),
    };
    seen * (params.specular * reflected.scale + reflected.bias)
        + reflected.diffuse_share(brdf.shading, params.specular) * diffuse
}

/// Han et al.'s equation 26 for the lobe alone; `Lambda_l` as printed, `exp(-l² variance/2)`, or `exp(-l(l+1)
/// variance/2)`, which is how a von Mises-Fisher lobe of small variance begins.
fn over_half_vectors(mu: DVec3, spread: SlopeVariance, printed: bool, local: &LocalEnvironment<'_>) -> DVec3 {
    let zonal: [f64; HALF_VECTOR_ORDER + 1] = std::array::from_fn(|l| {
        let rate = (l * if printed { l } else { l + 1 }) as f64;
        local.split_sum.zonal[l] * (-0.5 * rate * spread.get()).exp()
    });
    let (rotation, light) = (local.to_environment, local.light.half_vectors());
    let zonal = if printed { zonal } else { light.widened(zonal) };
    light.evaluate(rotation * local.wo, rotation * mu, &zonal)
}

/// Light of a Gaussian of slopes.
fn of_slopes(
    g: &SlopeGaussian,
    grid: &SlopeGrid,
    texel: &FilteredTexel<'_>,
    local: &LocalEnvironment<'_>,
) -> DVec3 {
    let brdf = &texel.prepared.brdf;
    let (wo, params) = (local.wo, (texel.params)(None));
    let displaced = texel.slope_map.is_some();
    let g = texel.slope_map.map_or(*g, |by| g.stretched(by));
    let mean = (-g.mean).extend(1.0).normalize();
    // Diffuse facets: what the map itself knows of slopes.
    let mut facets: Vec<(f64, DVec3)> = Vec::with_capacity(grid.len() * grid.len() + 1);
    g.samples(grid, |sample| {
        let weight =
            if displaced { sample.weight * sample.slope_normal.dot(wo).max(0.0) } else { sample.weight };
        if weight > 0.0 {
            facets.push((weight, sample.slope_normal.normalize()));
        }
    });
    if displaced {
        let (n, weight) = g.artificial(wo);
        facets.push((weight, n));
    }
    let seen: f64 = facets.iter().map(|(weight, _)| weight).sum();
    let shadowed = displaced && brdf.shading == ShadingModel::Shadowed;
    let open_sky = shadowed.then(|| OpenSky::new(&g, seen, brdf, local));
    let irradiance = |n: DVec3| {
        let all = local.light.irradiance.of_normals(local.to_environment * n, 0.0, false);
        all * open_sky.as_ref().map_or(DVec3::ONE, |sky| sky.share(n))
    };
    let lit: DVec3 = facets.iter().map(|(weight, n)| *weight * irradiance(*n)).sum();
    let diffuse = params.diffuse / PI * lit / seen;
    if !brdf.is_specular() {
        return diffuse;
    }
    let share = local
        .split_sum
        .lookup(mean.dot(wo), SlopeVariance::ZERO)
        .diffuse_share(brdf.shading, params.specular);
    let light = Mirrors { g: g.widen(brdf.width(params.roughness)), grid, mean, params, brdf, local };
    share * diffuse + if displaced { light.of_displaced() } else { light.of_map(g) }
}

/// Directions of a sky that facets shadow.
const BEAMS: usize = 32;

/// Direction k of an even lattice over the sphere (a Fibonacci lattice, González 2010).
fn beam(k: usize) -> DVec3 {
    let z = 1.0 - (2 * k + 1) as f64 / BEAMS as f64;
    let (y, x) = (TAU * GOLDEN_TURN * k as f64).sin_cos();
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * x, r * y, z)
}

/// The golden section of a turn.
const GOLDEN_TURN: f64 = 0.381_966_011_250_105;

/// Sky over facets that hide each other from it: LEADR's Algorithm 2 in full, `E(n) = ∫ L(wi) max(n·wi, 0)/(1
/// + Lambda(wo) + Lambda(wi)) dwi`, as a share of what an open sky sends.
struct OpenSky {
    /// Directions, their radiance, and the part of it that facets let through.
    beams: [(DVec3, DVec3, f64); BEAMS],
}

impl OpenSky {
    /// Sky over a Gaussian of slopes, of which the eye sees `seen`, in units in which slopes weigh one.
    fn new(g: &SlopeGaussian, seen: f64, brdf: &Brdf, local: &LocalEnvironment<'_>) -> Self {
        let cube = &local.light.radiance;
        // A texel of this level has a beam's solid angle.
        let lod = (cube.side() as f64 * (6.0 / BEAMS as f64).sqrt()).log2();
        let area = g.projected_area(local.wo).max(0.0);
        let of = |k: usize| {
            let wi = beam(k);
            let hidden = area * g.lambda(&*brdf.lobe, wi);
            // Where no facet can be seen along a direction, none is lit along it.
            let through = if hidden.is_finite() { seen / (seen + hidden) } else { 0.0 };
            (wi, cube.lookup(local.to_environment * wi, lod), through)
        };
        Self { beams: std::array::from_fn(of) }
    }

    /// Share of the open sky's light that reaches a facet of this normal.
    fn share(&self, n: DVec3) -> DVec3 {
        let (mut through, mut all) = (DVec3::ZERO, DVec3::ZERO);
        for (wi, radiance, part) in &self.beams {
            let received = *radiance * n.dot(*wi).max(0.0);
            all += received;
            through += received * *part;
        }
        through / all.max(DVec3::splat(1e-30))
    }
}

/// Facets of a Gaussian of slopes, the lobe's own width in it, that mirror an environment.
struct Mirrors<'a> {
    g: SlopeGaussian,
    grid: &'a SlopeGrid,
    mean: DVec3,
    params: SurfaceParams,
    brdf: &'a Brdf,
    local: &'a LocalEnvironment<'a>,
}

impl Mirrors<'_> {
    /// Light that a facet shows: the environment in the mirror direction, as wide as the slopes that it
    /// stands for, and Fresnel's term.
    fn shown(&self, sample: &SlopeSample) -> Option<(Directions, DVec3)> {
        let n = sample.slope_normal.normalize();
        let u = n.dot(self.local.wo);
        if u <= 0.0 {
            return None;
        }
        let directions = Directions { wi: 2.0 * u * n - self.local.wo, wo: self.local.wo, wh: n, u };
        let cube = &self.local.light.radiance;
        let radiance = cube.lookup(
            self.local.to_environment * directions.wi,
            self.g.level(self.grid, sample, u, cube.side()),
        );
        Some((directions, radiance * self.brdf.fresnel(self.params.specular, u)))
    }

    /// Light of a displaced surface: LEADR's sum, in which each facet weighs by what the eye sees of it, over
    /// what it sees in all.
    fn of_displaced(&self) -> DVec3 {
        let wo = self.local.wo;
        let lobe = &*self.brdf.lobe;
        let mut seen = 0.0;
        let mut facets = Vec::with_capacity(self.grid.len() * self.grid.len());
        self.g.samples(self.grid, |sample| {
            let weight = profile(lobe, &sample) * sample.slope_normal.dot(wo).max(0.0);
            if weight > 0.0 {
                seen += weight;
                facets.push((weight, sample));
            }
        });
        let (n, weight) = self.g.artificial(wo);
        seen += weight;
        facets.push((
            weight,
            SlopeSample { slope_normal: n, weight, square: 0.0, step: SlopeGrid::step(self.grid.len()) },
        ));
        // Facets that others hide from the light: `seen` is a (1 + Lambda(wo)), and a Lambda(wi) more is in
        // shadow.
        let hidden = |wi: DVec3| {
            if self.brdf.shading != ShadingModel::Shadowed {
                return 0.0;
            }
            self.g.projected_area(wo).max(0.0) * self.g.lambda(lobe, wi)
        };
        let total = self.total(lobe);
        let of = |(weight, sample): &(f64, SlopeSample)| {
            let Some((directions, shown)) = self.shown(sample) else { return DVec3::ZERO };
            let shadow = hidden(directions.wi) * total;
            if shadow.is_finite() { shown * *weight / (seen + shadow) } else { DVec3::ZERO }
        };
        facets.iter().map(of).sum()
    }

    /// Light of a normal map: the integral over half-vectors of what `reflect` gives for a light, `4 u` for
    /// the light's directions. `narrow` is the Gaussian without the lobe's own width.
    fn of_map(&self, narrow: SlopeGaussian) -> DVec3 {
        let lobe = &*self.brdf.lobe;
        let base = self.brdf.width(self.params.roughness);
        let [xx, yy, _] = narrow.covariance;
        // As `reflect` has it for a method that is no sum of lobes.
        let length = (1.0 / (1.0 + 0.5 * (xx + yy))).clamp(1e-3, 1.0);
        let whole = NormalLobe::alone(self.mean, SlopeVariance::clamped((1.0 - length) / length));
        let total = self.total(lobe);
        let mut sum = DVec3::ZERO;
        self.g.samples(self.grid, |sample| {
            let Some((directions, shown)) = self.shown(&sample) else { return };
            let n = responding_normal(&whole, self.mean, base, directions.wh);
            // The profile counts facet area; a normal map's texels weigh by map area.
            let share = self.local.split_sum.facets * profile(lobe, &sample) / total
                * (1.0 + base.get() * sample.square).sqrt();
            sum += shown
                * (share * 4.0 * directions.u * self.brdf.factor(n, &directions, self.params.roughness));
        });
        sum
    }

    /// Total weight of the grid's slopes.
    fn total(&self, lobe: &dyn Lobe) -> f64 {
        let mut total = 0.0;
        self.g.samples(self.grid, |sample| total += profile(lobe, &sample));
        total
    }
}

/// Weight of a slope, for facets distributed as a lobe's: Gaussian ones weigh as the grid says.
fn profile(lobe: &dyn Lobe, sample: &SlopeSample) -> f64 {
    match lobe.microfacets() {
        Microfacets::Beckmann => sample.weight,
        Microfacets::Ggx => sample.weight * lobe.slope_profile(sample.square) / (-0.5 * sample.square).exp(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::brdf::AnyLobe;
    use crate::light::environment::{SceneEnvironment, builtin};

    use crate::ndf::AnyMethod;
    use glam::DMat2;
    use std::sync::OnceLock;

    /// A built-in environment, made once.
    fn built(name: &str) -> &'static SceneEnvironment {
        static BUILT: [OnceLock<SceneEnvironment>; 2] = [const { OnceLock::new() }; 2];
        let make = || SceneEnvironment::new(builtin::find(name).unwrap().build());
        BUILT[usize::from(name == "white")].get_or_init(make)
    }

    /// Light of a Gaussian of slopes, of deviations along x and y, to an eye at a cosine to the base surface.
    fn light(method: &str, brdf: &Brdf, (x, y): (f64, f64), (environment, cosine): (&str, f64)) -> DVec3 {
        let method = method.parse::<AnyMethod>().unwrap();
        let environment = built(environment);
        let split_sum = SplitSum::new(brdf);
        environment.filtered.make(Technique::Prefiltered, split_sum.microfacets);
        let prepared = method.prepare(brdf, SlopeVariance::ZERO);
        let params =
            SurfaceParams { diffuse: DVec3::ONE, specular: DVec3::ONE, roughness: SlopeVariance::ZERO };
        let channels =
            [0.0, 0.1, -0.05, 1.0, x * x + 0.01, y * y + 0.0025, -0.005, 1.0].map(|c: f64| c as f32);
        let texel = FilteredTexel {
            channels: &channels,
            params: &|_| params,
            prepared: &prepared,
            at_means: false,
            slope_map: Some(DMat2::IDENTITY),
        };
        let local = LocalEnvironment {
            light: &environment.filtered,
            technique: Technique::Prefiltered,
            // The base surface faces the viewer of the picture, not the zenith.
            to_environment: DMat3::from_rotation_y(0.4),
            wo: DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine),
            split_sum: &split_sum,
        };
        method.reflect_environment(&texel, &local)
    }

    const DEVIATIONS: [(f64, f64); 5] = [(0.1, 0.1), (0.25, 0.25), (0.5, 0.5), (0.5, 0.1), (0.1, 0.5)];

    #[test]
    fn five_by_five_slopes_are_enough_for_diffuse_facets() {
        // Dupuy et al. 2013, section 2.3: 5 × 5 has all that matters, 9 × 9 is the converged result. Asked
        // for: within 1 %.
        let brdf = Brdf { lobe: "lambert".parse::<AnyLobe>().unwrap(), shading: ShadingModel::Masked };
        for deviations in DEVIATIONS {
            for cosine in [1.0, 0.8, 0.5, 0.2] {
                let by = |method| light(method, &brdf, deviations, ("studio", cosine));
                let converged = by("slopes:128");
                for (method, bound) in [("slopes", 0.01), ("slopes:9", 0.002)] {
                    let off = (by(method) - converged).length() / converged.length();
                    // At a grazing angle, at roughness 0.5 and a fifth, five slopes are few across those that
                    // the eye sees.
                    let bound = if cosine < 0.3 { 3.0 * bound } else { bound };
                    assert!(off < bound, "{method} {deviations:?} {cosine}: {off}");
                }
            }
        }
    }

    #[test]
    fn mirrors_that_hide_each_other_reflect_a_white_sky_whole() {
        // Whatever the slopes, facets that mirror everything look white.
        for lobe in ["beckmann:0.1", "ggx:0.2"] {
            let brdf = Brdf { lobe: lobe.parse::<AnyLobe>().unwrap(), shading: ShadingModel::Masked };
            for deviations in DEVIATIONS {
                for (method, cosine) in
                    [("slopes", 0.9), ("slopes:9", 0.3), ("slopes:9:drawn", 0.6), ("slopes:32", 0.05)]
                {
                    let white = light(method, &brdf, deviations, ("white", cosine));
                    assert!(
                        (white - DVec3::ONE).length() < 1e-5,
                        "{method} {deviations:?} {cosine}: {white}"
                    );
                }
            }
        }
        // Shadows take some of it, and more where the surface is rough.
        let brdf = Brdf { lobe: "beckmann:0.1".parse::<AnyLobe>().unwrap(), shading: ShadingModel::Shadowed };
        let shadowed = |deviation| light("slopes:32", &brdf, (deviation, deviation), ("white", 0.5)).x;
        assert!(shadowed(0.1) < 1.0 && shadowed(0.5) < shadowed(0.25), "{} {}", shadowed(0.1), shadowed(0.5));
    }

    #[test]
    fn more_slopes_are_nearer_to_the_converged_mirror() {
        let brdf = Brdf { lobe: "beckmann:0.07".parse::<AnyLobe>().unwrap(), shading: ShadingModel::Masked };
        // Over twelve views, of isotropic roughness; across scratches the paper too asks for more.
        for deviation in [0.1, 0.25, 0.5] {
            let (mut off, mut all) = ([0.0; 3], 0.0);
            for view in 0..12 {
                let cosine = 0.3 + 0.06 * f64::from(view);
                let by = |method| light(method, &brdf, (deviation, deviation), ("studio", cosine));
                let converged = by("slopes:128");
                all += converged.length_squared();
                for (sum, method) in off.iter_mut().zip(["slopes", "slopes:9", "slopes:32"]) {
                    *sum += (by(method) - converged).length_squared();
                }
            }
            let [five, nine, thirty_two] = off.map(|sum: f64| (sum / all).sqrt());
            assert!(thirty_two < nine && nine < five, "{deviation}: {five} {nine} {thirty_two}");
            // With 32 × 32 slopes, each is looked up a level wider than its solid angle, as the paper has it:
            // lamps' edges are softer by that much.
            assert!(thirty_two < 0.1, "{deviation}: {thirty_two}");
        }
    }
}
