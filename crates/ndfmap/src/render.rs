//! Pictures of a scene by every method, and their errors against the truth as a viewer sees them.

use std::time::Instant;

use ndfmap_core::compact::Storage;
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Observer;
use ndfmap_scene::metrics::{Picture, change, color_error, flip, relative_l2};
use ndfmap_scene::{Camera, Effort, Scene};
use ndfmap_trace::{DRIFT_FRAMES, drifted};
use serde::Serialize;

#[cfg(feature = "gpu")]
use crate::device::Gpu;
use crate::device::{Cpu, DeviceReport, Engine, RenderedPicture, TrueGeometry, View};
use crate::{Error, SceneSpec};

/// Render job: the scene, its frames, and the measures to take.
pub struct RenderJob<'a> {
    /// The scene.
    pub scene: &'a SceneSpec,
    /// Times of the frames, at least one.
    pub times: &'a [f64],
    /// Methods that the scene's maps are baked with.
    pub methods: &'a [AnyMethod],
    /// Size of the pictures.
    pub size: Size,
    /// Storage of a channel.
    pub storage: Storage,
    /// Look-ups of the maps.
    pub lookups: Lookups,
    /// Effort of the truth; `None` renders no truth.
    pub truth: Option<Effort>,
    /// True to measure sparkle, in every frame.
    pub sparkle: bool,
    /// True to keep every frame's pictures, for a contact sheet; a film would fill the memory.
    pub keep: bool,
    /// True to keep the first frame's pictures of the drift, where sparkle is measured.
    pub keep_drift: bool,
}

/// Frame, rendered: measures of the truth, where asked for, and of each method.
pub struct Frame {
    /// When, 0 to 1.
    pub time: f64,
    /// Camera of its pictures.
    pub camera: Camera,
    /// Factor on light, before display values take sRGB of it.
    pub exposure: f32,
    /// The truth, where there is one.
    pub truth: Option<FrameTruth>,
    /// Change of the truth as the camera drifts, where sparkle is measured.
    pub drifting: Option<DriftReport>,
    /// Each method's result.
    pub results: Vec<MethodResult>,
    /// Picture of the truth, where there is one, then of each method; empty when they are not kept.
    pub pictures: Vec<Picture>,
    /// Pictures of the drift, of the truth and of each method, where sparkle is measured; empty when they are
    /// not kept, and after the first frame.
    pub drifts: Vec<Vec<Picture>>,
}

/// Report on a frame's truth.
#[derive(Clone, Copy, Debug)]
pub struct FrameTruth {
    /// Rays a pixel.
    pub rays: usize,
    /// Relative L2 error for want of rays.
    pub noise: f64,
    /// Seconds that the truth took.
    pub seconds: f64,
}

/// Report on one method's picture.
#[derive(Clone, Copy, Debug)]
pub struct MethodResult {
    /// Milliseconds that the frame took.
    pub milliseconds: f64,
    /// Errors against the truth, where there is one.
    pub errors: Option<PictureErrors>,
}

/// Errors of a picture against the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PictureErrors {
    /// Relative L2 error of the radiance.
    pub relative_l2: f64,
    /// Mean difference of display values, by Han et al.'s definition.
    pub color_error: f64,
    /// Light of the whole picture over the truth's.
    pub brightness: f64,
    /// Mean FLIP of display values.
    pub flip: f64,
    /// Change from frame to frame of a drift, over the truth's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sparkle: Option<f64>,
}

/// Report of a rendering: every frame, and the times of the bakes.
pub struct RenderReport {
    /// Frames in order.
    pub frames: Vec<Frame>,
    /// Spellings of the methods.
    pub methods: Vec<String>,
    /// Seconds that each method's bake took.
    pub bake_seconds: Vec<f64>,
    /// Device that rendered.
    pub device: DeviceReport,
}

/// Report on a method over all frames; its JSON form is each method's part of `ndfmap render --json`.
#[derive(Clone, Debug, Serialize)]
pub struct MethodReport {
    /// Seconds that the bake took.
    pub bake_seconds: f64,
    /// Milliseconds of its frames.
    pub frame_ms: FrameTimes,
    /// Mean errors, where there is a truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<PictureErrors>,
    /// Errors of each frame, where there is a truth.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameErrors>,
}

/// Statistics of the milliseconds of frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrameTimes {
    /// Median.
    pub median: f64,
    /// Least.
    pub min: f64,
    /// Most.
    pub max: f64,
}

/// Errors of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrameErrors {
    /// Errors of the picture.
    #[serde(flatten)]
    pub errors: PictureErrors,
    /// When, 0 to 1.
    pub time: f64,
}

/// Report on the truths of all frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruthReport {
    /// Most rays a pixel.
    pub rays_per_pixel: usize,
    /// Worst noise.
    pub noise: f64,
    /// Seconds of all frames.
    pub seconds: f64,
    /// Drift with the most noise, where sparkle was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift: Option<DriftReport>,
}

/// Device to render on.
#[derive(Clone)]
#[non_exhaustive]
pub enum Device {
    /// The processor.
    Cpu,
    /// A GPU, ours or the caller's own.
    #[cfg(feature = "gpu")]
    Gpu {
        /// The device.
        device: ndfmap_gpu::Device,
        /// Taps of the device's own sampler, in place of ours.
        sampler: Option<u16>,
        /// True to smooth outlines by four samples a pixel, as applications do, in place of 4 × 4 parts.
        multisample: bool,
    },
}

/// Renders and measures; `each` gets every frame as it is done.
///
/// # Errors
/// [`Error`] of the scene, of the device, or of `each`; [`Error::Cancelled`] by the observer.
pub fn render(
    job: &RenderJob<'_>,
    device: &Device,
    observer: &dyn Observer,
    each: &mut dyn FnMut(usize, &Frame) -> Result<(), Error>,
) -> Result<RenderReport, Error> {
    match device {
        Device::Cpu => render_on(&Cpu, job, observer, each),
        #[cfg(feature = "gpu")]
        Device::Gpu { device, sampler, multisample } => {
            render_on(&Gpu::new(device.clone(), *sampler, *multisample)?, job, observer, each)
        }
    }
}

fn render_on<E: Engine>(
    engine: &E,
    job: &RenderJob<'_>,
    observer: &dyn Observer,
    each: &mut dyn FnMut(usize, &Frame) -> Result<(), Error>,
) -> Result<RenderReport, Error> {
    let (mut baked, mut bake_seconds) = (Vec::new(), Vec::new());
    let time = *job.times.first().ok_or_else(|| Error::Request("there is no frame to render".to_owned()))?;
    let first = job.scene.build(time, observer)?;
    for method in job.methods {
        let start = Instant::now();
        observer.begin(&format!("bake {method}"));
        baked.push(engine.bake(&first.materials, method, job.storage, observer)?);
        bake_seconds.push(start.elapsed().as_secs_f64());
    }
    let mut frames = Vec::new();
    let mut scene = first;
    for (at, time) in job.times.iter().enumerate() {
        observer.check()?;
        if at > 0 && job.scene.moves() {
            scene = job.scene.build(*time, observer)?;
        }
        let shot = Shot { engine, job, observer, scene: &scene, time: *time, first: at == 0 };
        let mut frame = shot.frame(&baked)?;
        each(at, &frame)?;
        if !job.keep {
            frame.pictures = Vec::new();
        }
        frames.push(frame);
    }
    let methods = job.methods.iter().map(|m| m.to_string()).collect();
    Ok(RenderReport { frames, methods, bake_seconds, device: engine.describe() })
}

/// Frame to be rendered.
struct Shot<'a, E> {
    engine: &'a E,
    job: &'a RenderJob<'a>,
    observer: &'a dyn Observer,
    scene: &'a Scene,
    time: f64,
    /// True for the first frame.
    first: bool,
}

impl<E: Engine> Shot<'_, E> {
    fn frame(&self, baked: &[E::Maps]) -> Result<Frame, Error> {
        let Self { engine, job, observer, scene, time, .. } = *self;
        let (size, exposure) = (job.size, scene.exposure);
        let keep_drift = job.keep_drift && self.first;
        let set = engine.set(scene, size)?;
        let view = View { scene, set: &set, camera: scene.camera, size };
        let start = Instant::now();
        let brute = |effort: Effort| {
            observer.begin("truth");
            engine.truth(&view, &effort, observer)
        };
        let truth = job.truth.map(brute).transpose()?;
        if let Some(truth) = &truth
            && truth.picture.texels().iter().all(|pixel| *pixel == scene.background)
        {
            let reason = "nothing is in view: every pixel shows the background, of which no error can be measured \
                          (`--camera` looks elsewhere)";
            return Err(Error::Request(reason.to_owned()));
        }
        let seconds = start.elapsed().as_secs_f64();
        // A drifting truth is rendered in one go, which only the CPU renderer can do.
        let drift = |effort: Effort| -> Result<(DriftReport, Vec<Picture>), Error> {
            observer.begin("truth, drifting");
            let geometry = TrueGeometry::new(scene, observer);
            let truth = geometry.truth(scene);
            let halves = truth.drift(&scene.camera, size, effort.rays, observer)?;
            Ok((true_change(&halves, exposure), mixed(&halves, 1.0)))
        };
        let (drifting, true_drift) = job.truth.filter(|_| job.sparkle).map(drift).transpose()?.unzip();
        let mut drifts: Vec<Vec<Picture>> = true_drift.filter(|_| keep_drift).into_iter().collect();
        let result = |maps: &E::Maps| -> Result<(MethodResult, Picture), Error> {
            observer.begin("filtered");
            // Every picture of a drift is a part of the same work.
            let pictures = if drifting.is_some() { 1.0 + DRIFT_FRAMES as f64 } else { 1.0 };
            let draw = |view: &View<'_, E::Set>, at: usize| {
                observer.check()?;
                let part = observer.part(at as f64 / pictures, (at + 1) as f64 / pictures);
                let drawn = engine.draw(view, maps, job.lookups, &part);
                part.progress(1.0);
                drawn
            };
            let RenderedPicture { picture, milliseconds } = draw(&view, 0)?;
            let mut sparkle = |drifting: DriftReport| -> Result<f64, Error> {
                let moved =
                    |i| draw(&View { camera: drifted(&scene.camera, i), ..view }, 1 + i).map(|d| d.picture);
                let pictures = (0..DRIFT_FRAMES).map(moved).collect::<Result<Vec<Picture>, _>>()?;
                let sparkle = change(&pictures, exposure) / drifting.change.max(f64::MIN_POSITIVE);
                drifts.extend(keep_drift.then_some(pictures));
                Ok(sparkle)
            };
            let sparkle = drifting.map(&mut sparkle).transpose()?;
            let errors = truth.as_ref().map(|truth| PictureErrors {
                relative_l2: relative_l2(&picture, &truth.picture),
                color_error: color_error(&picture, &truth.picture, exposure),
                brightness: light_of(&picture) / light_of(&truth.picture).max(f64::MIN_POSITIVE),
                flip: flip(&picture, &truth.picture, exposure),
                sparkle,
            });
            Ok((MethodResult { milliseconds, errors }, picture))
        };
        let results = baked.iter().map(result).collect::<Result<Vec<_>, _>>()?;
        let (results, drawn): (Vec<MethodResult>, Vec<Picture>) = results.into_iter().unzip();
        let said = truth.as_ref().map(|t| FrameTruth { rays: t.rays, noise: t.noise, seconds });
        let pictures = truth.map(|t| t.picture).into_iter().chain(drawn).collect();
        Ok(Frame { time, camera: scene.camera, exposure, truth: said, drifting, results, pictures, drifts })
    }
}

/// Change of the truth over a drift: [`change`] of its display values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DriftReport {
    /// Change from a step to the next, of display values.
    pub change: f64,
    /// Part of that change that a truth of the same noise would show if nothing moved.
    pub noise: f64,
}

/// Half the sum of two halves of a drift's pictures, the second times a weight.
fn mixed([a, b]: &[Vec<Picture>; 2], weight: f32) -> Vec<Picture> {
    let mean = |(a, b): (&Picture, &Picture)| {
        Picture::from_fn(a.size(), |x, y| (a.row(y)[x] + weight * b.row(y)[x]) * 0.5)
    };
    a.iter().zip(b).map(mean).collect()
}

fn true_change(halves: &[Vec<Picture>; 2], exposure: f32) -> DriftReport {
    // Noise alone: the change of half the difference, on top of a picture that stands still.
    let (still, half) = (mixed(halves, 1.0), mixed(halves, -1.0));
    let noisy: Vec<Picture> =
        half.iter().map(|d| Picture::from_fn(d.size(), |x, y| still[0].row(y)[x] + d.row(y)[x])).collect();
    DriftReport { change: change(&still, exposure), noise: change(&noisy, exposure) }
}

/// Sum of a picture's light.
fn light_of(picture: &Picture) -> f64 {
    picture.texels().iter().map(|c| f64::from(c.element_sum())).sum()
}

impl RenderReport {
    /// Mean over frames of a method's errors; `None` without a truth.
    #[must_use]
    pub fn mean_errors(&self, method: usize) -> Option<PictureErrors> {
        let all: Option<Vec<PictureErrors>> = self.frames.iter().map(|f| f.results[method].errors).collect();
        let all = all?;
        let mean = |of: fn(&PictureErrors) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        Some(PictureErrors {
            relative_l2: mean(|e| e.relative_l2),
            color_error: mean(|e| e.color_error),
            brightness: mean(|e| e.brightness),
            flip: mean(|e| e.flip),
            sparkle: all[0].sparkle.map(|_| mean(|e| e.sparkle.unwrap_or(0.0))),
        })
    }

    /// Milliseconds of a method's frames.
    #[must_use]
    pub fn frame_ms(&self, method: usize) -> FrameTimes {
        let mut all: Vec<f64> = self.frames.iter().map(|f| f.results[method].milliseconds).collect();
        all.sort_by(f64::total_cmp);
        FrameTimes { median: all[all.len() / 2], min: all[0], max: all[all.len() - 1] }
    }

    /// Report on each method, with its spelling.
    pub fn methods(&self) -> impl Iterator<Item = (&str, MethodReport)> {
        self.methods.iter().enumerate().map(|(at, name)| {
            let error = self.mean_errors(at);
            let frame =
                |f: &Frame| FrameErrors { errors: f.results[at].errors.unwrap_or_default(), time: f.time };
            let frames = error.map_or_else(Vec::new, |_| self.frames.iter().map(frame).collect());
            let (bake_seconds, frame_ms) = (self.bake_seconds[at], self.frame_ms(at));
            (name.as_str(), MethodReport { bake_seconds, frame_ms, error, frames })
        })
    }

    /// Report on the truth, where there is one.
    #[must_use]
    pub fn truth(&self) -> Option<TruthReport> {
        let all = || self.frames.iter().filter_map(|f| f.truth);
        let drifts = self.frames.iter().filter_map(|f| f.drifting);
        Some(TruthReport {
            rays_per_pixel: all().map(|t| t.rays).max()?,
            noise: all().map(|t| t.noise).fold(0.0, f64::max),
            seconds: all().map(|t| t.seconds).sum(),
            drift: drifts.max_by(|a, b| a.noise.total_cmp(&b.noise)),
        })
    }
}
