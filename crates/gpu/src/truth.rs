//! The truth by the GPU: a sum of many pictures of the map as it is, each through another place in the pixel.
//!
//! The truth has the same limit as the CPU renderer's. A sample falls on the same place in all pixels of a
//! picture, stratified over 4 × 4 squares; each pixel draws by chance which of the nearest texels it shades.

use glam::{DVec2, DVec3};
use ndfmap_core::grid::Grid;
use ndfmap_core::observe::Observer;
use ndfmap_scene::metrics::relative_l2;
use ndfmap_scene::{Camera, Effort, Material, TruePicture};

use crate::canvas::{Antialiasing, Canvas};
use crate::maps::Textures;
use crate::renderer::{Pass, Renderer, SceneView, Weights};
use crate::uniforms::View;
use crate::{Device, GpuError};

/// Strata a pixel is cut into on each axis.
const STRATA: usize = 4;

/// Samples a pixel in the least truth: one through each stratum, for each of two halves whose difference is
/// the noise.
pub const LEAST_SAMPLES: usize = 2 * STRATA * STRATA;

/// Finest level of a scene's maps, for the truth.
pub struct FinestMaps {
    materials: Vec<Textures>,
}

impl FinestMaps {
    /// Uploads the maps.
    ///
    /// # Errors
    /// [`GpuError`] for maps that the device cannot hold.
    pub fn new(device: &Device, materials: &[Material]) -> Result<Self, GpuError> {
        let finest = |material| Textures::finest(device, material);
        Ok(Self { materials: materials.iter().map(finest).collect::<Result<_, _>>()? })
    }
}

/// Frame to be drawn by brute force: a scene, and its maps as they are.
#[derive(Clone, Copy)]
pub struct TrueFrame<'a> {
    /// The scene.
    pub view: SceneView<'a>,
    /// Finest level of its maps, uploaded to the renderer's device.
    pub finest: &'a FinestMaps,
}

impl Renderer {
    /// Renders the truth; rays are rounded up to a multiple of [`LEAST_SAMPLES`], and seeds make no
    /// difference.
    ///
    /// # Errors
    /// [`GpuError`], also where the observer cancels.
    ///
    /// # Panics
    /// When the canvas smooths outlines by itself: the truth does that with its samples.
    pub fn truth(
        &self,
        canvas: &Canvas,
        frame: &TrueFrame<'_>,
        effort: &Effort,
        observer: &dyn Observer,
    ) -> Result<TruePicture, GpuError> {
        let TrueFrame { view: shown, finest } = frame;
        assert_eq!(canvas.outlines, Antialiasing::Sharp, "the truth smooths outlines by itself");
        let bindings = self.bind_finest(shown.scene, &finest.materials)?;
        let rounds = effort.rays.div_ceil(LEAST_SAMPLES).max(1);
        let mut halves = [vec![DVec3::ZERO; canvas.size.area()], vec![DVec3::ZERO; canvas.size.area()]];
        let mut done = 0;
        loop {
            // Rounds double where a noise is asked for, so that measuring it costs little. They are never so
            // many at once that single floats lose what is added.
            let wanted = if effort.noise > 0.0 { done.max(1) } else { rounds };
            let more = wanted.min(rounds - done).min(MOST_ROUNDS);
            for (half, sums) in halves.iter_mut().enumerate() {
                for round in done..done + more {
                    observer.check()?;
                    let mut encoder = canvas.device.encoder();
                    for stratum in 0..STRATA * STRATA {
                        let number = (2 * round + half) * STRATA * STRATA + stratum;
                        let view = jittered(shown, canvas, stratum, number as u32);
                        let pass =
                            Pass { target: canvas.pass_target(), view, bindings: &bindings, clock: None };
                        self.pass(&mut encoder, shown, &pass)?;
                        let first = round == done && stratum == 0;
                        let weights = Weights { keep: if first { 0.0 } else { 1.0 }, add: 1.0 };
                        self.add(&mut encoder, canvas, weights, false);
                    }
                    canvas.device.submit(encoder);
                    // An endless queue would take endless memory.
                    canvas.device.wait()?;
                    let part = (half * more + round + 1 - done) as f64 / 2.0;
                    observer.progress((done as f64 + part) / rounds as f64);
                }
                for (sum, colour) in sums.iter_mut().zip(canvas.read()?.texels()) {
                    *sum += colour.as_dvec3();
                }
            }
            done += more;
            let share = 1.0 / (done * STRATA * STRATA) as f64;
            let [a, b] = halves.each_ref().map(|sums| {
                let colours = sums.iter().map(|sum| (*sum * share).as_vec3()).collect();
                Grid::from_vec(canvas.size, colours).unwrap_or_else(|| unreachable!("one colour a pixel"))
            });
            let noise = relative_l2(&a, &b) / 2.0;
            if done == rounds || noise <= effort.noise {
                observer.progress(1.0);
                let picture = Grid::from_fn(canvas.size, |x, y| 0.5 * (a.row(y)[x] + b.row(y)[x]));
                return Ok(TruePicture { picture, rays: done * LEAST_SAMPLES, noise });
            }
        }
    }
}

/// Most rounds of strata that single floats add up.
const MOST_ROUNDS: usize = 64;

/// View through a random place in a stratum of every pixel.
fn jittered(shown: &SceneView<'_>, canvas: &Canvas, stratum: usize, number: u32) -> View {
    let [u, v] = [0, 1].map(|axis| f64::from(scramble(number.wrapping_mul(2) + axis)) / f64::from(u32::MAX));
    let corner = DVec2::new((stratum % STRATA) as f64, (stratum / STRATA) as f64);
    let offset = (corner + DVec2::new(u, v)) / STRATA as f64 - 0.5;
    let camera = Camera { shift: shown.camera.shift - offset, ..*shown.camera };
    View { seed: scramble(number), ..View::new(&camera, canvas.size, shown.geometry) }
}

/// Pseudorandom number (the finaliser of MurmurHash3, Appleby 2011, of a counter).
fn scramble(counter: u32) -> u32 {
    let mut z = counter.wrapping_add(1).wrapping_mul(0x9e37_79b9);
    z = (z ^ (z >> 16)).wrapping_mul(0x85eb_ca6b);
    z = (z ^ (z >> 13)).wrapping_mul(0xc2b2_ae35);
    z ^ (z >> 16)
}
