//! The fit: one GGX lobe about a texel's mean normal, nearest to what the lobes of its normals look like
//! together.
//!
//! Nearest in which measure decides. Light is shown through a tone curve, so the difference of two highlights
//! is seen by some power of their brightness, not by brightness itself: the fit minimises `Σ_k w_k (M_k^p -
//! D_k^p)²` over rings k of half-vectors about the mean, M the azimuth average of the texel's own lobes. A
//! power of one serves relative L2, where few bright pixels rule; a small one serves FLIP.

use std::sync::LazyLock;

use super::mips::filled;
use super::profile::{Profile, Profiles, RINGS, WIDTHS, alpha_at};
use super::{Mean, RoughSurface};
use crate::grid::{Grid, Size};
use crate::observe::{Cancelled, Observer};
use crate::surface::unit_or_up;

/// Samples that a level's fits read, all together.
const SAMPLES: usize = 1 << 22;

/// Widths between those that a search looks at first.
const COARSE: usize = 6;

/// Measure of the nearest lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Objective {
    /// Power of brightness by which differences count, above 0.
    pub power: f32,
}

impl Default for Objective {
    fn default() -> Self {
        Self { power: 0.25 }
    }
}

/// Table of profiles, worked out once.
static PROFILES: LazyLock<Profiles> = LazyLock::new(Profiles::new);

pub(super) fn fit(
    surface: &RoughSurface,
    objective: Objective,
    observer: &dyn Observer,
) -> Result<Vec<Grid<f32>>, Cancelled> {
    let profiles = &*PROFILES;
    let seen = |profile: &Profile| -> Profile { profile.map(|d| d.powf(objective.power)) };
    let lobes: Vec<Profile> = (0..WIDTHS).map(|i| seen(profiles.central(i))).collect();
    let mut levels = vec![filled(surface.size(), |x, y| surface.mean(0, x, y).roughness)];
    let sizes = surface.sizes();
    let last = (sizes.len() - 1) as f64;
    for (level, size) in sizes.enumerate().skip(1) {
        observer.check()?;
        levels.push(filled(size, |x, y| {
            let mean = surface.mean(level, x, y);
            let Some(mixture) = mixture(surface, profiles, size, (x, y), mean) else { return mean.roughness };
            nearest(&seen(&mixture), &lobes, &profiles.weights)
        }));
        // A level costs about as much as the one before it, until footprints are as large as samples allow.
        observer.progress(level as f64 / last);
    }
    Ok(levels)
}

/// Azimuth average of a texel's lobes about their mean normal; `None` where all normals are one, and all
/// roughness too.
fn mixture(
    surface: &RoughSurface,
    profiles: &Profiles,
    level: Size,
    at: (usize, usize),
    mean: Mean,
) -> Option<Profile> {
    let about = unit_or_up(mean.normal);
    let mut mixture = [0.0; RINGS];
    let mut varies = false;
    surface.under(level, at, surface.stride(level, SAMPLES), |weight, texel| {
        let cosine = texel.normal.dot(about);
        varies |= cosine < 1.0 - 1e-6 || (texel.roughness - mean.roughness).abs() > 1e-4;
        let lobe = profiles.lobe(texel.roughness, cosine);
        for (sum, d) in mixture.iter_mut().zip(lobe) {
            *sum += weight * d;
        }
    });
    varies.then_some(mixture)
}

/// Perceptual roughness of the nearest lobe, between the entries of the table too.
fn nearest(mixture: &Profile, lobes: &[Profile], weights: &Profile) -> f32 {
    let error = |lobe: &Profile| -> f32 {
        let each = mixture.iter().zip(lobe).zip(weights);
        each.map(|((m, d), w)| w * (m - d) * (m - d)).sum()
    };
    // The least of every few, then the least around it: valleys are wider than that.
    let least = |among: &mut dyn Iterator<Item = usize>| {
        among.map(|i| (error(&lobes[i]), i)).fold((f32::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a }).1
    };
    let about = least(&mut (0..WIDTHS).step_by(COARSE));
    let best = least(&mut (about.saturating_sub(COARSE - 1)..(about + COARSE).min(WIDTHS)));
    // The lowest point of the parabola through the three.
    let offset = if best == 0 || best + 1 == WIDTHS {
        0.0
    } else {
        let [a, b, c] = [best - 1, best, best + 1].map(|i| error(&lobes[i]));
        let bend = a - 2.0 * b + c;
        if bend > 0.0 { f64::from(0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    alpha_at(best as f64 + offset).sqrt() as f32
}
