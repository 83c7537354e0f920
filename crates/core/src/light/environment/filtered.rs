//! Environments, filtered once for shading to look up.

use std::sync::{Arc, OnceLock};

use glam::DMat3;

use super::{Cube, Environment, HalfVectors, Irradiance, Suns, without_suns};
use crate::brdf::Microfacets;
use crate::light::Light;
use crate::words;

/// Technique by which lobes of normals reflect an environment in highlights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Technique {
    /// Cubes blurred by microfacets: each lobe looks up one blurred as wide as itself, in the direction that
    /// its light comes from.
    #[default]
    Prefiltered,
    /// Han et al.'s sum over spherical harmonics of the half-vector, to order 8.
    Harmonics,
}

words!(Technique { Prefiltered => "prefiltered", Harmonics => "harmonics" });

impl Technique {
    /// Number of the technique in shaders.
    #[must_use]
    pub fn index(self) -> u32 {
        self as u32 + 1
    }
}

/// An environment as shading looks it up.
#[derive(Debug)]
pub struct FilteredEnvironment {
    /// Small bright sources, which shine as lights of their own. Everything else here leaves them out.
    pub suns: Suns,
    /// Irradiance that diffuse facets receive.
    pub irradiance: Irradiance,
    /// The light itself, at several widths.
    pub radiance: Cube,
    rest: Environment,
    beckmann: OnceLock<Cube>,
    ggx: OnceLock<Cube>,
    half_vectors: OnceLock<HalfVectors>,
}

impl FilteredEnvironment {
    /// Prepares an environment; parts that only some shading needs are made when first asked for.
    #[must_use]
    pub fn new(environment: &Environment) -> Self {
        let (rest, suns) = without_suns(environment);
        Self {
            suns,
            irradiance: Irradiance::of(&rest),
            radiance: Cube::of(&rest),
            rest,
            beckmann: OnceLock::new(),
            ggx: OnceLock::new(),
            half_vectors: OnceLock::new(),
        }
    }

    /// Cube blurred by these microfacets.
    #[must_use]
    pub fn prefiltered(&self, microfacets: Microfacets) -> &Cube {
        let made = match microfacets {
            Microfacets::Beckmann => &self.beckmann,
            Microfacets::Ggx => &self.ggx,
        };
        made.get_or_init(|| microfacets.filter(&self.radiance))
    }

    /// Makes all that a technique needs, ahead of time. Call this before a parallel section: parts are made,
    /// when first asked for, by all threads together, so the first request must not come from within other
    /// work that the threads share.
    pub fn make(&self, technique: Technique, microfacets: Microfacets) {
        match technique {
            Technique::Prefiltered => drop(self.prefiltered(microfacets)),
            Technique::Harmonics => drop(self.half_vectors()),
        }
    }

    /// Light over half-vectors.
    #[must_use]
    pub fn half_vectors(&self) -> &HalfVectors {
        self.half_vectors.get_or_init(|| HalfVectors::of(&self.rest))
    }
}

/// The environment that a scene stands in.
#[derive(Clone, Debug)]
pub struct SceneEnvironment {
    /// The light itself, as a picture by latitude and longitude.
    pub map: Arc<Environment>,
    /// The light, filtered for shading.
    pub filtered: Arc<FilteredEnvironment>,
    /// Rotation around the vertical, in radians: what was ahead moves to the right.
    pub rotation: f64,
    /// Technique by which highlights look it up.
    pub technique: Technique,
}

impl SceneEnvironment {
    /// An environment around a scene.
    #[must_use]
    pub fn new(environment: Environment) -> Self {
        Self {
            filtered: FilteredEnvironment::new(&environment).into(),
            map: environment.into(),
            rotation: 0.0,
            technique: Technique::default(),
        }
    }

    /// Rotation from directions of the world to the environment's own.
    #[must_use]
    pub fn to_environment(&self) -> DMat3 {
        DMat3::from_rotation_y(self.rotation)
    }

    /// The small bright sources, as lights of the world.
    #[must_use]
    pub fn suns(&self) -> Vec<Light> {
        let back = self.to_environment().transpose();
        let turned = |light: &Light| match *light {
            Light::Directional { towards, irradiance } => {
                Light::Directional { towards: back * towards, irradiance }
            }
            point @ Light::Point { .. } => point,
        };
        self.filtered.suns.lights.iter().map(turned).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::smooth;
    use super::*;
    use crate::grid::Size;
    use glam::DVec3;

    #[test]
    fn what_was_ahead_turns_to_the_right() {
        let turned = SceneEnvironment {
            rotation: std::f64::consts::FRAC_PI_2,
            ..SceneEnvironment::new(smooth(Size { width: 32, height: 16 }))
        };
        // The right now shows what the picture has ahead.
        assert!((turned.to_environment() * DVec3::X - DVec3::NEG_Z).length() < 1e-15);
        assert!(turned.suns().is_empty());
    }
}
