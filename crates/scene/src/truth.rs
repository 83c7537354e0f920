//! Truths: what a renderer by brute force is asked for, and what it gives back.

use crate::metrics::Picture;

/// When a truth is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Rays a pixel, at most; a renderer rounds them up to what it takes at once.
    pub rays: usize,
    /// Noise below which it is good enough, too; 0 never is.
    pub noise: f64,
    /// Different seeds give independent truths, where a renderer draws by chance.
    pub seed: u64,
}

impl Effort {
    /// So many rays, whatever the noise.
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
    /// Rays a pixel that it took.
    pub rays: usize,
    /// Noise floor: relative L2 error that the picture has for want of rays, from the difference of its two
    /// halves.
    pub noise: f64,
}
