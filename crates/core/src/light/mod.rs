//! Lights without extent; and, in [`environment`], light from everywhere.

pub mod environment;
mod split_sum;

pub use split_sum::{ENTRIES, Reflected, SplitSum};

use glam::DVec3;

/// A light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Light so far away that its direction is the same everywhere.
    Directional {
        /// Unit vector to the light.
        towards: DVec3,
        /// Irradiance on a plane that faces it, linear RGB.
        irradiance: DVec3,
    },
    /// Light at a place.
    Point {
        /// Place of the light.
        at: DVec3,
        /// Radiant intensity, linear RGB: irradiance at distance 1.
        intensity: DVec3,
    },
}

impl Light {
    /// Unit vector from `place` to the light, and its irradiance there on a plane that faces it.
    #[must_use]
    pub fn seen_from(&self, place: DVec3) -> (DVec3, DVec3) {
        match *self {
            Self::Directional { towards, irradiance } => (towards, irradiance),
            Self::Point { at, intensity } => {
                let to_light = at - place;
                // A light that touches a surface would be infinitely bright there.
                let square = to_light.length_squared().max(1e-12);
                (to_light / square.sqrt(), intensity / square)
            }
        }
    }
}
