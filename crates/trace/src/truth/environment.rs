//! Light of an environment by Monte Carlo: directions are drawn where it is bright, where the lobe is, and
//! where a diffuse facet looks.
//!
//! Each ray draws one direction of each kind, and every one counts by the sum of all their densities (the
//! balance heuristic of Veach and Guibas 1995): a direction that is likely by any of them is never divided by
//! a small density. The environment is the picture itself, its sun included.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3};
use ndfmap_core::brdf::{Brdf, Directions, Microfacets, SurfaceParams};
use ndfmap_core::light::environment::{Environment, EnvironmentSampler, SceneEnvironment};
use ndfmap_core::sphere::frame;

/// Environment from which directions are drawn.
pub(super) struct SampledEnvironment<'a> {
    map: &'a Environment,
    sampler: EnvironmentSampler,
    to_environment: DMat3,
}

/// Numbers that draw the directions of one ray: two in [0, 1) for each kind.
pub(super) type Numbers = [DVec2; 3];

/// Numbers of a pixel's rays, one after the other spread more evenly than chance would have them: the
/// sequence of Roberts 2018, of the plastic number, begun at random.
pub(super) fn numbers(begin: [[f64; 2]; 3], ray: usize) -> Numbers {
    const STEP: DVec2 = DVec2::new(0.754_877_666_246_692_8, 0.569_840_290_998_053_2);
    begin.map(|at| (DVec2::from(at) + STEP * ray as f64).fract())
}

/// Lit facet: the frame of its tangent space, and all else in that frame.
pub(super) struct LitFacet<'a> {
    pub(super) frame: DMat3,
    pub(super) wo: DVec3,
    pub(super) n: DVec3,
    pub(super) params: &'a SurfaceParams,
    pub(super) brdf: &'a Brdf,
}

impl LitFacet<'_> {
    /// Squared width of the facets that are drawn: GGX as wide as the lobe, with weight wherever it has any.
    fn alpha_squared(&self) -> f64 {
        (2.0 * self.brdf.width(self.params.roughness).get()).max(1e-9)
    }

    /// A direction that the lobe may mirror.
    fn draw_mirror(&self, random: DVec2) -> DVec3 {
        let z = (1.0 + Microfacets::Ggx.quantile(self.alpha_squared(), random.x)).sqrt().recip();
        let wh = around(self.n, z, random.y);
        wh * (2.0 * wh.dot(self.wo)) - self.wo
    }

    /// Density of these directions, per solid angle.
    fn mirror_density(&self, directions: &Directions) -> f64 {
        let z = directions.wh.dot(self.n);
        if z <= 0.0 || directions.u <= 0.0 {
            return 0.0;
        }
        Microfacets::Ggx.d_of_tangent(self.alpha_squared(), (1.0 - z * z).max(0.0) / (z * z)) * z
            / (4.0 * directions.u)
    }
}

/// A direction around `n` at this cosine to it.
fn around(n: DVec3, z: f64, turn: f64) -> DVec3 {
    let ((x, y), (sin, cos)) = (frame(n), (TAU * turn).sin_cos());
    (x * cos + y * sin) * (1.0 - z * z).max(0.0).sqrt() + n * z
}

impl<'a> SampledEnvironment<'a> {
    pub(super) fn new(environment: &'a SceneEnvironment) -> Self {
        Self {
            map: &environment.map,
            sampler: EnvironmentSampler::new(&environment.map),
            to_environment: environment.to_environment(),
        }
    }

    /// Estimate of the light that a facet sends to the eye, from directions that are `open`.
    pub(super) fn light(
        &self,
        shown: &LitFacet<'_>,
        open: impl Fn(DVec3) -> bool,
        numbers: Numbers,
    ) -> DVec3 {
        let to_environment = self.to_environment * shown.frame;
        let specular = shown.brdf.is_specular();
        let [of_sky, of_cosine, of_lobe] = numbers;
        let from_sky = to_environment.transpose() * self.sampler.draw(self.map, of_sky).0;
        let drawn = [
            Some(from_sky),
            Some(around(shown.n, of_cosine.x.sqrt(), of_cosine.y)),
            specular.then(|| shown.draw_mirror(of_lobe)),
        ];
        let mut sum = DVec3::ZERO;
        for wi in drawn.into_iter().flatten() {
            let Some(directions) = Directions::between(wi, shown.wo) else { continue };
            let towards = to_environment * wi;
            let mut density = self.sampler.density(self.map, towards) + shown.n.dot(wi).max(0.0) / PI;
            if specular {
                density += shown.mirror_density(&directions);
            }
            if density <= 0.0 {
                continue;
            }
            let reflected = shown.brdf.true_facet(shown.n, shown.params, &directions);
            if reflected != DVec3::ZERO && open(wi) {
                sum += self.map.radiance(towards) * reflected / density;
            }
        }
        sum
    }
}
