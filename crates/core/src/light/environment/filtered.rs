//! What shading looks up of an environment, made from it once.

use std::sync::{Arc, OnceLock};

use glam::DMat3;

use super::{Cube, Environment, HalfVectors, Irradiance, Suns, without_suns};
use crate::brdf::Microfacets;
use crate::light::Light;

/// How lobes of normals meet an environment's highlights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Technique {
    /// Each lobe looks up a cube that microfacets as wide as it have blurred, where what it reflects comes
    /// from.
    #[default]
    Prefiltered,
    /// Han et al.'s sum over spherical harmonics of the half-vector, to order 8.
    Harmonics,
}

impl Technique {
    /// Every technique.
    pub const ALL: [Self; 2] = [Self::Prefiltered, Self::Harmonics];

    /// As spelled on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Prefiltered => "prefiltered",
            Self::Harmonics => "harmonics",
        }
    }

    /// Its number in shaders.
    #[must_use]
    pub fn index(self) -> u32 {
        self as u32 + 1
    }
}

/// An environment as shading looks it up.
#[derive(Debug)]
pub struct FilteredEnvironment {
    /// Small bright sources, which shine as lights of their own. All else is without them.
    pub suns: Suns,
    /// What diffuse facets receive.
    pub irradiance: Irradiance,
    /// The light itself, at several widths.
    pub radiance: Cube,
    rest: Environment,
    beckmann: OnceLock<Cube>,
    ggx: OnceLock<Cube>,
    half_vectors: OnceLock<HalfVectors>,
}

impl FilteredEnvironment {
    /// Prepares an environment; what only some shading wants is made when first asked for.
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

    /// The cube that these microfacets have blurred.
    #[must_use]
    pub fn prefiltered(&self, microfacets: Microfacets) -> &Cube {
        let made = match microfacets {
            Microfacets::Beckmann => &self.beckmann,
            Microfacets::Ggx => &self.ggx,
        };
        made.get_or_init(|| microfacets.filter(&self.radiance))
    }

    /// Makes now what a technique wants of it. What is made when first asked for is made by all threads
    /// together, and must not be asked for first from within what they already do together.
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
    /// The same, filtered.
    pub filtered: Arc<FilteredEnvironment>,
    /// How far it is turned around the vertical, in radians: what was ahead moves to the right.
    pub rotation: f64,
    /// How highlights look it up.
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

    /// From directions of the world to the environment's own.
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
        // What is now seen on the right is what the picture has ahead.
        assert!((turned.to_environment() * DVec3::X - DVec3::NEG_Z).length() < 1e-15);
        assert!(turned.suns().is_empty());
    }
}
