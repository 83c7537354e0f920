//! ndfmap-trace: scenes of `ndfmap-core` as pictures, on the CPU, in two ways that share nothing but geometry
//! and BRDFs.
//!
//! [`truth`] is brute force: many rays a pixel, each shading one texel of the map as it is. [`filtered`]
//! shades each pixel once, through a baked representation, at the reach of its ray. Their difference is the
//! error of the representation. Pixels are worked out one by one, each from its own random numbers: the same
//! picture for any number of threads.

mod displacement;
mod drift;
pub mod filtered;
mod geometry;
pub mod truth;

pub use displacement::{DisplacedMeshes, Facet, FacetHit};
pub use drift::{DRIFT_FRAMES, drifted};
pub use geometry::{Geometry, Hit};

use glam::{DMat3, DVec3};
use ndfmap_core::brdf::Directions;
use ndfmap_core::light::Light;

/// Directions from each light that reaches a place to the eye, in the place's tangent frame, with the light's
/// irradiance; `between` makes [`Directions`] of two vectors.
fn incident_directions<'a>(
    lights: &'a [Light],
    (place, frame): (DVec3, DMat3),
    wo: DVec3,
    between: fn(DVec3, DVec3) -> Option<Directions>,
) -> impl Iterator<Item = (Directions, DVec3)> + 'a {
    lights.iter().filter_map(move |light| {
        let (towards, irradiance) = light.seen_from(place);
        between(frame.transpose() * towards, wo).map(|directions| (directions, irradiance))
    })
}
