//! Light of an environment by chance: directions from where it is bright, from where the lobe is, and from where a diffuse facet looks.
//!
//! Each ray draws one direction of each kind, and every one counts by the sum of all their densities (the balance heuristic of Veach and
//! Guibas 1995): what is likely by any of them is never divided by little. The environment is the picture itself, its sun included.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3};
use ndfmap_core::light::environment::{Environment, EnvironmentSampler, Kernel, Surroundings};
use ndfmap_core::reflection::{Finish, Reflection, Way};
use ndfmap_core::sphere::frame;

/// Where directions are drawn from.
pub(super) struct Sky<'a> {
    environment: &'a Environment,
    sampler: EnvironmentSampler,
    to_environment: DMat3,
}

/// What the directions of one ray are drawn by: two numbers in [0, 1) for each kind.
pub(super) type Numbers = [DVec2; 3];

/// Numbers of a pixel's rays, one after the other spread more evenly than chance would have them: the sequence of Roberts 2018, of the
/// plastic number, begun at random.
pub(super) fn numbers(begin: [[f64; 2]; 3], ray: usize) -> Numbers {
    const STEP: DVec2 = DVec2::new(0.754_877_666_246_692_8, 0.569_840_290_998_053_2);
    begin.map(|at| (DVec2::from(at) + STEP * ray as f64).fract())
}

/// A facet that is lit: frame of the tangent space, in which all else is.
pub(super) struct Shown<'a> {
    pub(super) frame: DMat3,
    pub(super) wo: DVec3,
    pub(super) n: DVec3,
    pub(super) finish: &'a Finish,
    pub(super) reflection: &'a Reflection,
}

impl Shown<'_> {
    /// Width of facets that are drawn: GGX as wide as the lobe has weight wherever it has.
    fn alpha_squared(&self) -> f64 {
        (2.0 * self.reflection.width(self.finish.gloss).get()).max(1e-9)
    }

    /// A direction that the lobe may mirror.
    fn draw_mirror(&self, random: DVec2) -> DVec3 {
        let z = (1.0 + Kernel::Ggx.quantile(self.alpha_squared(), random.x)).sqrt().recip();
        let wh = around(self.n, z, random.y);
        wh * (2.0 * wh.dot(self.wo)) - self.wo
    }

    /// Density of those, per solid angle.
    fn mirror_density(&self, way: &Way) -> f64 {
        let z = way.wh.dot(self.n);
        if z <= 0.0 || way.u <= 0.0 {
            return 0.0;
        }
        Kernel::Ggx.facets(self.alpha_squared(), (1.0 - z * z).max(0.0) / (z * z)) * z / (4.0 * way.u)
    }
}

/// A direction around `n` at this cosine to it.
fn around(n: DVec3, z: f64, turn: f64) -> DVec3 {
    let ((x, y), (sin, cos)) = (frame(n), (TAU * turn).sin_cos());
    (x * cos + y * sin) * (1.0 - z * z).max(0.0).sqrt() + n * z
}

impl<'a> Sky<'a> {
    pub(super) fn new(surroundings: &'a Surroundings) -> Self {
        let environment = &*surroundings.environment;
        Self {
            environment,
            sampler: EnvironmentSampler::new(environment),
            to_environment: surroundings.to_environment(),
        }
    }

    /// An estimate of the light that a facet sends to the eye, of what comes from directions that are `open`.
    pub(super) fn light(&self, shown: &Shown<'_>, open: impl Fn(DVec3) -> bool, numbers: Numbers) -> DVec3 {
        let to_environment = self.to_environment * shown.frame;
        let specular = shown.reflection.is_specular();
        let [of_sky, of_cosine, of_lobe] = numbers;
        let from_sky = to_environment.transpose() * self.sampler.draw(self.environment, of_sky).0;
        let drawn = [
            Some(from_sky),
            Some(around(shown.n, of_cosine.x.sqrt(), of_cosine.y)),
            specular.then(|| shown.draw_mirror(of_lobe)),
        ];
        let mut sum = DVec3::ZERO;
        for wi in drawn.into_iter().flatten() {
            let Some(way) = Way::between(wi, shown.wo) else { continue };
            let towards = to_environment * wi;
            let mut density = self.sampler.density(self.environment, towards) + shown.n.dot(wi).max(0.0) / PI;
            if specular {
                density += shown.mirror_density(&way);
            }
            if density <= 0.0 {
                continue;
            }
            let reflected = shown.reflection.facet(shown.n, shown.finish, &way);
            if reflected != DVec3::ZERO && open(wi) {
                sum += self.environment.radiance(towards) * reflected / density;
            }
        }
        sum
    }
}
