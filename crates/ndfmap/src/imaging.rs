//! Pictures of a scene by every method, and how far each is from the truth as a viewer sees it.

use std::time::Instant;

use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::metrics::{Picture, change, color_error, relative_l2};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::scene::{Effort, Scene};
use ndfmap_trace::{DRIFT_FRAMES, drifted};
use serde_json::{Map, Value, json};

use crate::Failure;
use crate::engine::{Engine, RenderedPicture, TrueGeometry, View};
use crate::progress::Progress;
use crate::staging::SceneSpec;

/// What is to be rendered.
pub(crate) struct RenderJob<'a> {
    pub(crate) stage: &'a SceneSpec,
    /// Times of the frames, at least one.
    pub(crate) times: &'a [f64],
    pub(crate) methods: &'a [AnyMethod],
    pub(crate) size: Size,
    pub(crate) precision: Precision,
    pub(crate) lookups: Lookups,
    /// Render the truth too.
    pub(crate) truth: Option<Effort>,
    /// Measure sparkle, in every frame.
    pub(crate) sparkle: bool,
    /// Keep every frame's pictures, for a contact sheet; a film would fill the memory.
    pub(crate) keep: bool,
}

/// A frame: what is said of the truth, where asked for, and of each method.
pub(crate) struct Frame {
    pub(crate) time: f64,
    pub(crate) exposure: f32,
    pub(crate) truth: Option<TruthReport>,
    /// How the truth changes as the camera drifts, where sparkle is measured.
    pub(crate) drifting: Option<DriftReport>,
    pub(crate) takes: Vec<MethodResult>,
    /// The truth's picture, where there is one, then each method's; none when they are not kept.
    pub(crate) pictures: Vec<Picture>,
}

/// What is said of a truth.
#[derive(Clone, Copy)]
pub(crate) struct TruthReport {
    pub(crate) rays: usize,
    pub(crate) noise: f64,
    pub(crate) seconds: f64,
}

/// What is said of one method's picture.
#[derive(Clone, Copy)]
pub(crate) struct MethodResult {
    pub(crate) milliseconds: f64,
    /// Against the truth, where there is one.
    pub(crate) errors: Option<PictureErrors>,
}

/// How far a picture is from the truth.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PictureErrors {
    pub(crate) relative_l2: f64,
    pub(crate) color_error: f64,
    /// Light of the whole picture over the truth's.
    pub(crate) brightness: f64,
    /// `None` where the program is built without FLIP.
    pub(crate) flip: Option<f64>,
    pub(crate) sparkle: Option<f64>,
}

/// Every frame, and what baking took.
pub(crate) struct RenderReport {
    pub(crate) frames: Vec<Frame>,
    pub(crate) methods: Vec<String>,
    pub(crate) bake_seconds: Vec<f64>,
    /// What rendered, as JSON.
    pub(crate) engine: Value,
}

/// Renders and measures; `each` gets every frame as it is done.
pub(crate) fn shoot<E: Engine>(
    engine: &E,
    shot: &RenderJob<'_>,
    each: &mut dyn FnMut(usize, &Frame) -> Result<(), Failure>,
) -> Result<RenderReport, Failure> {
    let (mut baked, mut bake_seconds) = (Vec::new(), Vec::new());
    let first = shot.stage.set(shot.times[0])?;
    for method in shot.methods {
        let start = Instant::now();
        let progress = Progress::new(&format!("bake {}", method));
        baked.push(engine.bake(&first.materials, method, shot.precision, &progress)?);
        bake_seconds.push(start.elapsed().as_secs_f64());
    }
    let mut frames = Vec::new();
    let mut scene = first;
    for (at, time) in shot.times.iter().enumerate() {
        if at > 0 && shot.stage.moves() {
            scene = shot.stage.set(*time)?;
        }
        let mut frame = frame(engine, shot, (&scene, *time), &baked)?;
        each(at, &frame)?;
        if !shot.keep {
            frame.pictures = Vec::new();
        }
        frames.push(frame);
    }
    let methods = shot.methods.iter().map(|m| m.to_string()).collect();
    Ok(RenderReport { frames, methods, bake_seconds, engine: engine.describe() })
}

fn frame<E: Engine>(
    engine: &E,
    shot: &RenderJob<'_>,
    (scene, time): (&Scene, f64),
    baked: &[E::Maps],
) -> Result<Frame, Failure> {
    let (size, exposure) = (shot.size, scene.exposure);
    let set = engine.set(scene, size)?;
    let view = View { scene, set: &set, camera: scene.camera, size };
    let start = Instant::now();
    let brute = |effort: Effort| {
        let progress = Progress::new("truth");
        engine.truth(&view, &effort, &progress)
    };
    let truth = shot.truth.map(brute).transpose()?;
    let seconds = start.elapsed().as_secs_f64();
    // A drifting truth is rendered in one go, which only the CPU renderer knows.
    let drift = |effort: Effort| -> Result<DriftReport, Failure> {
        let progress = Progress::new("truth, drifting");
        let geometry = TrueGeometry::new(scene);
        let truth = geometry.truth(scene);
        Ok(true_change(&truth.drift(&scene.camera, size, effort.rays, &progress)?, exposure))
    };
    let drifting = shot.truth.filter(|_| shot.sparkle).map(drift).transpose()?;
    let take = |maps: &E::Maps| -> Result<(MethodResult, Picture), Failure> {
        let progress = Progress::new("filtered");
        let draw = |view: &View<'_, E::Set>| engine.draw(view, maps, shot.lookups, &progress);
        let RenderedPicture { picture, milliseconds } = draw(&view)?;
        let sparkle = |drifting: DriftReport| -> Result<f64, Failure> {
            let moved = |i| draw(&View { camera: drifted(&scene.camera, i), ..view }).map(|d| d.picture);
            let pictures = (0..DRIFT_FRAMES).map(moved).collect::<Result<Vec<Picture>, _>>()?;
            Ok(change(&pictures, exposure) / drifting.change.max(f64::MIN_POSITIVE))
        };
        let sparkle = drifting.map(sparkle).transpose()?;
        let errors = truth.as_ref().map(|truth| PictureErrors {
            relative_l2: relative_l2(&picture, &truth.picture),
            color_error: color_error(&picture, &truth.picture, exposure),
            brightness: light_of(&picture) / light_of(&truth.picture).max(f64::MIN_POSITIVE),
            flip: flip(&picture, &truth.picture, exposure),
            sparkle,
        });
        Ok((MethodResult { milliseconds, errors }, picture))
    };
    let takes = baked.iter().map(take).collect::<Result<Vec<_>, _>>()?;
    let (takes, taken): (Vec<MethodResult>, Vec<Picture>) = takes.into_iter().unzip();
    let told = truth.as_ref().map(|t| TruthReport { rays: t.rays, noise: t.noise, seconds });
    let pictures = truth.map(|t| t.picture).into_iter().chain(taken).collect();
    Ok(Frame { time, exposure, truth: told, drifting, takes, pictures })
}

/// How much the truth changes over a drift: [`change`] of its display values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DriftReport {
    pub(crate) change: f64,
    /// How much of that a truth of the same noise would show if nothing moved.
    pub(crate) noise: f64,
}

fn true_change([a, b]: &[Vec<Picture>; 2], exposure: f32) -> DriftReport {
    let with = |weight: f32| -> Vec<Picture> {
        let mean = |(a, b): (&Picture, &Picture)| {
            Picture::from_fn(a.size(), |x, y| (a.row(y)[x] + weight * b.row(y)[x]) * 0.5)
        };
        a.iter().zip(b).map(mean).collect()
    };
    // Noise alone: the change of half the difference, on top of a picture that stands still.
    let (still, half) = (with(1.0), with(-1.0));
    let noisy: Vec<Picture> =
        half.iter().map(|d| Picture::from_fn(d.size(), |x, y| still[0].row(y)[x] + d.row(y)[x])).collect();
    DriftReport { change: change(&still, exposure), noise: change(&noisy, exposure) }
}

/// All light of a picture.
fn light_of(picture: &Picture) -> f64 {
    picture.texels().iter().map(|c| f64::from(c.element_sum())).sum()
}

/// Mean FLIP of display values, at the library's own distance to a screen.
#[cfg(feature = "flip")]
fn flip(picture: &Picture, truth: &Picture, exposure: f32) -> Option<f64> {
    let image = |p: &Picture| {
        let size = p.size();
        let bytes = ndfmap_maps::picture::to_bytes(p, exposure);
        nv_flip::FlipImageRgb8::with_data(
            size.width as u32,
            size.height as u32,
            bytes.texels().as_flattened(),
        )
    };
    let error = nv_flip::flip(image(truth), image(picture), nv_flip::DEFAULT_PIXELS_PER_DEGREE);
    Some(f64::from(nv_flip::FlipPool::from_image(&error).mean()))
}

#[cfg(not(feature = "flip"))]
fn flip(_picture: &Picture, _truth: &Picture, _exposure: f32) -> Option<f64> {
    None
}

impl PictureErrors {
    /// As JSON.
    pub(crate) fn to_json(self) -> Value {
        let mut value = json!({ "relative_l2": self.relative_l2, "color_error": self.color_error, "brightness": self.brightness });
        if let Some(flip) = self.flip {
            value["flip"] = flip.into();
        }
        if let Some(sparkle) = self.sparkle {
            value["sparkle"] = sparkle.into();
        }
        value
    }
}

impl RenderReport {
    /// Mean over frames of a method's errors.
    pub(crate) fn mean_errors(&self, method: usize) -> Option<PictureErrors> {
        let all: Option<Vec<PictureErrors>> = self.frames.iter().map(|f| f.takes[method].errors).collect();
        let all = all?;
        let mean = |of: fn(&PictureErrors) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        Some(PictureErrors {
            relative_l2: mean(|e| e.relative_l2),
            color_error: mean(|e| e.color_error),
            brightness: mean(|e| e.brightness),
            flip: all[0].flip.map(|_| mean(|e| e.flip.unwrap_or(0.0))),
            sparkle: all[0].sparkle.map(|_| mean(|e| e.sparkle.unwrap_or(0.0))),
        })
    }

    /// Milliseconds of a method's frames: median, least, most.
    pub(crate) fn frame_ms(&self, method: usize) -> [f64; 3] {
        let mut all: Vec<f64> = self.frames.iter().map(|f| f.takes[method].milliseconds).collect();
        all.sort_by(f64::total_cmp);
        [all[all.len() / 2], all[0], all[all.len() - 1]]
    }

    /// What is said about each method.
    pub(crate) fn to_json(&self) -> Map<String, Value> {
        let method = |(at, name): (usize, &String)| {
            let [median, min, max] = self.frame_ms(at);
            let mut value = json!({
                "bake_seconds": self.bake_seconds[at],
                "frame_ms": { "median": median, "min": min, "max": max },
            });
            if let Some(errors) = self.mean_errors(at) {
                value["error"] = errors.to_json();
                let frame = |f: &Frame| {
                    let mut one = f.takes[at].errors.unwrap_or_default().to_json();
                    one["time"] = f.time.into();
                    one
                };
                value["frames"] = self.frames.iter().map(frame).collect();
            }
            (name.clone(), value)
        };
        self.methods.iter().enumerate().map(method).collect()
    }

    /// What is said about the truth, where there is one: rays a pixel, the worst noise, and the time of all frames.
    pub(crate) fn truth_json(&self) -> Option<Value> {
        let all = || self.frames.iter().filter_map(|f| f.truth);
        let rays = all().map(|t| t.rays).max()?;
        let noise = all().map(|t| t.noise).fold(0.0, f64::max);
        let seconds: f64 = all().map(|t| t.seconds).sum();
        let mut value = json!({ "rays_per_pixel": rays, "noise": noise, "seconds": seconds });
        if let Some(drifting) =
            self.frames.iter().filter_map(|f| f.drifting).max_by(|a, b| a.noise.total_cmp(&b.noise))
        {
            value["drift"] = json!({ "change": drifting.change, "noise": drifting.noise });
        }
        Some(value)
    }

    /// The table for a terminal: a row a method.
    pub(crate) fn to_table(&self) -> String {
        let name = self.methods.iter().map(String::len).max().unwrap_or(0).max("method".len());
        let mut text =
            format!("{:name$}  frame ms  color_error  relative_l2  brightness    FLIP  sparkle\n", "method");
        for (at, method) in self.methods.iter().enumerate() {
            let [median, ..] = self.frame_ms(at);
            text += &format!("{method:name$} {median:>9.1}");
            if let Some(e) = self.mean_errors(at) {
                let or_dash = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
                text += &format!(
                    "  {:>11.4}  {:>11.3}  {:>10.3}  {:>6}  {:>7}",
                    e.color_error,
                    e.relative_l2,
                    e.brightness,
                    or_dash(e.flip),
                    or_dash(e.sparkle)
                );
            }
            text.push('\n');
        }
        for f in &self.frames {
            if let Some(truth) = f.truth {
                text += &format!(
                    "truth at time {}: {} rays a pixel, noise {:.4}, {:.1} s\n",
                    f.time, truth.rays, truth.noise, truth.seconds
                );
            }
            if let Some(DriftReport { change, noise }) = f.drifting {
                text += &format!("drifting: it changes by {change:.4} a step, {noise:.4} of that by noise\n");
            }
        }
        text
    }
}
