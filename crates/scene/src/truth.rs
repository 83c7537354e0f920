//! Truths by brute force: the effort that a renderer is asked for, and the picture that it gives back.

use crate::metrics::Picture;

/// Effort for a truth: when it is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Rays a pixel, at most; a renderer rounds them up to what it takes at once.
    pub rays: usize,
    /// Noise below which fewer rays are good enough, too; with 0 they never are.
    pub noise: f64,
    /// Different seeds give independent truths, where a renderer draws by chance.
    pub seed: u64,
}

impl Effort {
    /// Effort of so many rays, whatever the noise.
    #[must_use]
    pub fn rays(rays: usize) -> Self {
        Self { rays, noise: 0.0, seed: 0 }
    }
}

/// Picture by brute force.
#[derive(Clone, Debug)]
pub struct TruePicture {
    /// Linear RGB.
    pub picture: Picture,
    /// Number of rays a pixel that it took.
    pub rays: usize,
    /// Noise floor: relative L2 error of the picture for want of rays, from the difference of its two halves.
    pub noise: f64,
}
