//! Profiles: GGX lobes that lie at an angle to a mean direction, averaged over the azimuth about it.
//!
//! A texel's one lobe is round about its mean normal, so all that it can meet of the texel's own distribution
//! is this average. A table by width, angle and distance from the mean makes a fit a sum of rows.

use std::f64::consts::{FRAC_PI_2, PI};

use rayon::prelude::*;

use crate::brdf::Microfacets;

/// Rings of half-vectors about the mean, out to the horizon.
pub(super) const RINGS: usize = 40;

/// Widths: alpha in equal factors.
pub(super) const WIDTHS: usize = 96;

/// Angles of a lobe to the mean, in equal steps to the horizon.
const ANGLES: usize = 160;

/// Least alpha of the table; engines clamp theirs above it (`engine.rs`).
const LEAST_ALPHA: f64 = 0.002;

/// Angles of the innermost ring but the centre, and of the outermost, in radians.
const INNERMOST: f64 = 0.003;
const OUTERMOST: f64 = 1.45;

/// Azimuths of half a turn, and places within a ring, that an entry averages.
const AZIMUTHS: usize = 32;
const WITHIN: [f64; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];

/// A profile: density of each ring.
pub(super) type Profile = [f32; RINGS];

/// Steps of the look-ups from roughness, and from the root of 1 less the cosine of an angle.
const STEPS: usize = 4096;

/// Table of profiles.
pub(super) struct Profiles {
    rows: Vec<Profile>,
    /// First row of each roughness, 0 to 1.
    widths: Vec<u32>,
    /// Row of each root, of angles from 0 to a right one.
    angles: Vec<u32>,
    /// Solid angle of each ring, times the cosine of its middle.
    pub(super) weights: Profile,
}

impl Profiles {
    pub(super) fn new() -> Self {
        let middle = |k: usize| match k {
            0 => 0.0,
            k => INNERMOST * (OUTERMOST / INNERMOST).powf((k - 1) as f64 / (RINGS - 2) as f64),
        };
        let edge = |k: usize| match k {
            0 => 0.0,
            RINGS => FRAC_PI_2,
            k => 0.5 * (middle(k - 1) + middle(k)),
        };
        let row = |i: usize| -> Profile {
            let (alpha, angle) = (alpha(i / ANGLES), angle(i % ANGLES));
            let (sin_angle, cos_angle) = angle.sin_cos();
            std::array::from_fn(|k| {
                let mut sum = 0.0;
                for part in WITHIN {
                    let (sin, cos) = (edge(k) + (edge(k + 1) - edge(k)) * part).sin_cos();
                    for azimuth in 0..AZIMUTHS {
                        let turn = PI * (azimuth as f64 + 0.5) / AZIMUTHS as f64;
                        let u = sin_angle * sin * turn.cos() + cos_angle * cos;
                        if u > 0.0 {
                            sum += Microfacets::Ggx.d(alpha * alpha, u * u, 1.0 - u * u);
                        }
                    }
                }
                (sum / (WITHIN.len() * AZIMUTHS) as f64) as f32
            })
        };
        let weight = |k: usize| ((edge(k).cos() - edge(k + 1).cos()) * middle(k).cos()) as f32;
        let step = |i: usize| (i as f64 + 0.5) / STEPS as f64;
        let width = |i: usize| {
            let alpha = step(i).powi(2).max(LEAST_ALPHA);
            let index = (alpha / LEAST_ALPHA).ln() / (1.0 / LEAST_ALPHA).ln() * (WIDTHS - 1) as f64;
            (index.round() as usize).min(WIDTHS - 1) * ANGLES
        };
        let turn = |i: usize| {
            // The root of 1 - cos, so that steps are even near the mean.
            let angle = (1.0 - step(i).powi(2)).acos();
            ((angle / FRAC_PI_2 * (ANGLES - 1) as f64).round() as usize).min(ANGLES - 1)
        };
        Self {
            rows: (0..WIDTHS * ANGLES).into_par_iter().map(row).collect(),
            widths: (0..STEPS).map(|i| width(i) as u32).collect(),
            angles: (0..STEPS).map(|i| turn(i) as u32).collect(),
            weights: std::array::from_fn(weight),
        }
    }

    /// Profile of a lobe of this width index about the mean itself.
    pub(super) fn central(&self, width: usize) -> &Profile {
        &self.rows[width * ANGLES]
    }

    /// Profile of a lobe of this roughness at an angle of this cosine to the mean.
    pub(super) fn lobe(&self, roughness: f32, cosine: f32) -> &Profile {
        let step = |x: f32| ((x * STEPS as f32) as usize).min(STEPS - 1);
        let (width, angle) =
            (self.widths[step(roughness)], self.angles[step((1.0 - cosine).max(0.0).sqrt())]);
        &self.rows[(width + angle) as usize]
    }
}

/// Width of an index, which may lie between two.
pub(super) fn alpha_at(index: f64) -> f64 {
    LEAST_ALPHA * (1.0 / LEAST_ALPHA).powf(index / (WIDTHS - 1) as f64)
}

fn alpha(index: usize) -> f64 {
    alpha_at(index as f64)
}

fn angle(index: usize) -> f64 {
    FRAC_PI_2 * index as f64 / (ANGLES - 1) as f64
}
