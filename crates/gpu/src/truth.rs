//! The truth by the GPU: many pictures of the map as it is, each seen from a little elsewhere in the pixel, added up.
//!
//! It tends to what the CPU renderer's truth tends to. Where a sample falls in a pixel is the same for all pixels of a picture, stratified over
//! 4 × 4 squares; which of the nearest texels it shades is each pixel's own chance.

use glam::{DVec2, Vec3};
use ndfmap_core::grid::Grid;
use ndfmap_core::metrics::{Picture, relative_l2};
use ndfmap_core::scene::{Camera, Material};

use crate::canvas::{Canvas, Outlines};
use crate::maps::Textures;
use crate::renderer::{Pass, Renderer, Shown};
use crate::uniforms::View;
use crate::{Device, GpuError};

/// Strata a pixel is cut into on each axis.
const STRATA: usize = 4;

/// Samples a pixel in the least truth: one through each stratum, for each of two halves whose difference is the noise.
pub const LEAST_SAMPLES: usize = 2 * STRATA * STRATA;

/// The finest level of a scene's maps, for the truth.
pub struct FinestMaps {
    materials: Vec<Textures>,
}

impl FinestMaps {
    /// Uploads them.
    ///
    /// # Errors
    /// [`GpuError`] for maps that the device cannot hold.
    pub fn new(device: &Device, materials: &[Material]) -> Result<Self, GpuError> {
        let finest = |material| Textures::finest(device, material);
        Ok(Self { materials: materials.iter().map(finest).collect::<Result<_, _>>()? })
    }
}

/// When a truth is good enough.
pub struct Effort<'a> {
    /// Samples a pixel, rounded up to a multiple of [`LEAST_SAMPLES`].
    pub samples: usize,
    /// Told the fraction done.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

/// A picture by brute force.
pub struct TruePicture {
    /// Linear RGB.
    pub picture: Picture,
    /// Samples a pixel.
    pub samples: usize,
    /// Relative L2 error that the picture has for want of samples, from the difference of its two halves.
    pub noise: f64,
}

impl Renderer<'_> {
    /// Renders the truth.
    ///
    /// # Errors
    /// [`GpuError`].
    ///
    /// # Panics
    /// When the canvas smooths outlines by itself: the truth does that with its samples.
    pub fn truth(
        &self,
        canvas: &Canvas<'_>,
        shown: &Shown<'_>,
        finest: &FinestMaps,
        effort: &Effort<'_>,
    ) -> Result<TruePicture, GpuError> {
        assert_eq!(canvas.outlines, Outlines::Sharp, "the truth smooths outlines by itself");
        let dressed = self.dress_finest(shown.scene, &finest.materials)?;
        let passes = effort.samples.div_ceil(LEAST_SAMPLES).max(1);
        let each = passes * STRATA * STRATA;
        let half = |half: usize| -> Result<Picture, GpuError> {
            for i in 0..each {
                let number = (half * each + i) as u32;
                let [u, v] = [0, 1].map(|axis| f64::from(scramble(2 * number + axis)) / f64::from(u32::MAX));
                let stratum = DVec2::new((i % STRATA) as f64, (i / STRATA % STRATA) as f64);
                let offset = (stratum + DVec2::new(u, v)) / STRATA as f64 - 0.5;
                let camera = Camera { shift: shown.camera.shift - offset, ..*shown.camera };
                let view = View::new(&camera, canvas.size, shown.geometry);
                let view = View { seed: scramble(number), ..view };
                self.pass(canvas, shown, &Pass { view, dressed: &dressed, clock: None });
                self.add(canvas, (if i == 0 { 0.0 } else { 1.0 }, 1.0 / each as f32), false);
                // A queue without end would be memory without end.
                if i % (STRATA * STRATA) == 0 {
                    canvas.device.wait()?;
                    (effort.progress)(f64::from(number) / (2 * each) as f64);
                }
            }
            canvas.read()
        };
        let (a, b) = (half(0)?, half(1)?);
        (effort.progress)(1.0);
        let mean = |a: Vec3, b: Vec3| 0.5 * (a + b);
        let picture = Grid::from_fn(canvas.size, |x, y| mean(a.row(y)[x], b.row(y)[x]));
        Ok(TruePicture { picture, samples: passes * LEAST_SAMPLES, noise: relative_l2(&a, &b) / 2.0 })
    }
}

/// A number that is as good as random (the finaliser of MurmurHash3, Appleby 2011, of a counter).
fn scramble(counter: u32) -> u32 {
    let mut z = counter.wrapping_add(1).wrapping_mul(0x9e37_79b9);
    z = (z ^ (z >> 16)).wrapping_mul(0x85eb_ca6b);
    z = (z ^ (z >> 13)).wrapping_mul(0xc2b2_ae35);
    z ^ (z >> 16)
}
