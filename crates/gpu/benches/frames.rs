//! Frames: what each method costs on this GPU, and its error; what alignment gains; what brute force costs
//! for the same error.
//!
//! Methods take turns in one run, so that ratios hold on a noisy machine; times are medians, by the device's
//! own clock where it has one. `NDFMAP_BENCH_SIZE` sets the picture's side (default 500), `NDFMAP_BENCH_RUNS`
//! the turns (default 15).

use std::time::Instant;

use ndfmap_core::grid::Size;
use ndfmap_core::light::environment::{SceneEnvironment, Technique, builtin};
use ndfmap_core::lookup::{Filtering, Lookups, Sampling};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Unobserved;
use ndfmap_core::pyramid::Precision;
use ndfmap_gpu::{
    Antialiasing, Canvas, Device, FinestMaps, Frame, Geometry, Maps, Meshes, Renderer, SceneView, TrueFrame,
};
use ndfmap_scene as scene;
use ndfmap_scene::metrics::{color_error, relative_l2};
use ndfmap_scene::{Effort, Scene, SceneOptions};

const METHODS: &[&str] = &[
    "toksvig",
    "fixed",
    "naive",
    "ndm",
    "ndm:plane",
    "slopes",
    "sh:4",
    "sh:7",
    "vmf:1",
    "vmf:2",
    "vmf:4",
    "vmf:6",
    "vmf:8",
    "gmm:4",
    "phong:4",
    "vmf:4:unaligned",
];

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn setting(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// A scene with maps no larger than the picture needs, 512 at most.
fn staged(name: &str, time: f64, size: Size) -> Outcome<Scene> {
    let row = scene::find(name).ok_or("no such scene")?;
    let side = size.width.next_power_of_two().min(512);
    Ok((row.build)(&SceneOptions { time, map_size: Size { width: side, height: side }, map: None }))
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Methods by their spellings.
fn parsed<'s>(spellings: &[&'s str]) -> Outcome<Vec<(&'s str, AnyMethod)>> {
    spellings.iter().map(|m| Ok((*m, m.parse::<AnyMethod>()?))).collect()
}

/// Look-ups of a method: lobes that are not aligned need every texel shaded.
fn lookups(spelling: &str, sampling: Sampling) -> Lookups {
    let neighbours = spelling.ends_with("unaligned");
    let sampling = if neighbours { Sampling::Taps(Filtering::TRILINEAR) } else { sampling };
    Lookups { sampling, neighbours, at_means: false }
}

/// A frame by the device's own sampler.
fn frame<'a>(view: SceneView<'a>, maps: &'a Maps) -> Frame<'a> {
    Frame { view, maps, lookups: Lookups::sampler(1) }
}

struct Bench<'a> {
    device: &'a Device,
    renderer: &'a Renderer,
    runs: usize,
}

impl Bench<'_> {
    /// The maps of a scene, by each method.
    fn maps<'m, 's>(
        &self,
        scene: &Scene,
        methods: &'m [(&'s str, AnyMethod)],
    ) -> Outcome<Vec<(&'s str, Maps)>> {
        let bake = |(name, method): &'m (&'s str, AnyMethod)| {
            let maps = Maps::new(self.device, &scene.materials, method, Precision::Half, &|_| ())?;
            Ok((*name, maps))
        };
        methods.iter().map(bake).collect()
    }

    /// Median milliseconds of each method's frame, taking turns.
    fn times(
        &self,
        canvas: &Canvas,
        shown: &SceneView<'_>,
        all: &[(&str, Maps)],
        sampling: Sampling,
    ) -> Outcome<Vec<f64>> {
        let mut times = vec![Vec::new(); all.len()];
        for turn in 0..=self.runs {
            for (times, (name, maps)) in times.iter_mut().zip(all) {
                let ms = self
                    .renderer
                    .time(canvas, &Frame { view: *shown, maps, lookups: lookups(name, sampling) })?;
                // The first turn makes pipelines and warms up.
                if turn > 0 {
                    times.push(ms);
                }
            }
        }
        Ok(times.into_iter().map(median).collect())
    }

    fn methods(&self, name: &str, time: f64, size: Size) -> Outcome<()> {
        let scene = staged(name, time, size)?;
        let geometry = Geometry::new(self.device, &scene)?;
        let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
        let canvas = Canvas::new(self.device, size, Antialiasing::Sharp)?;
        let parts = Canvas::new(self.device, size, Antialiasing::Parts)?;
        let finest = FinestMaps::new(self.device, &scene.materials)?;
        let frame = TrueFrame { view: shown, finest: &finest };
        let brute = |rays| self.renderer.truth(&canvas, &frame, &Effort::rays(rays), &Unobserved);
        let truth = brute(512)?;
        let least = ndfmap_gpu::LEAST_SAMPLES;
        let once = || -> Outcome<f64> {
            let start = Instant::now();
            brute(least)?;
            Ok(start.elapsed().as_secs_f64() * 1e3 / least as f64)
        };
        let sample = median((0..self.runs.min(5)).map(|_| once()).collect::<Outcome<Vec<f64>>>()?);
        println!(
            "\n{name} at time {time}, {} x {}; truth of {} samples, noise {:.3}, {sample:.1} ms a sample",
            size.width, size.height, truth.rays, truth.noise
        );
        let parsed = parsed(METHODS)?;
        let all = self.maps(&scene, &parsed)?;
        let filters = [
            ("sampler", Sampling::Sampler(1)),
            ("trilinear", Sampling::Taps(Filtering::TRILINEAR)),
            ("fine:16", Sampling::Taps(Filtering::fine(16))),
        ];
        println!(
            "{:16} {:>10} {:>8} {:>9} {:>12} {:>12} {:>22}",
            "method", "filter", "ms", "/ toksvig", "color_error", "relative_l2", "truth of that error / ms"
        );
        for (filter, sampling) in filters {
            let times = self.times(&canvas, &shown, &all, sampling)?;
            for ((name, maps), ms) in all.iter().zip(&times) {
                self.renderer.draw(&parts, &Frame { view: shown, maps, lookups: lookups(name, sampling) })?;
                let picture = parts.read()?;
                let error = relative_l2(&picture, &truth.picture);
                // Noise falls with the root of the samples: so many have as much of it as the method has
                // error.
                let samples = truth.rays as f64 * (truth.noise / error).powi(2);
                println!(
                    "{name:16} {filter:>10} {ms:>8.2} {:>9.2} {:>12.4} {error:>12.3} {:>22.1}",
                    ms / times[0],
                    color_error(&picture, &truth.picture, scene.exposure),
                    samples.max(1.0) * sample / ms
                );
            }
        }
        Ok(())
    }

    /// A displaced scene: cutting it, and drawing what is cut, beside drawing it as a normal map.
    fn displaced(&self, name: &str, time: f64, size: Size) -> Outcome<()> {
        let flat = staged(name, time, size)?;
        let mut scene = staged(name, time, size)?;
        scene.displace(1.0, false)?;
        let canvas = Canvas::new(self.device, size, Antialiasing::Sharp)?;
        let method = "slopes".parse::<AnyMethod>()?;
        let maps =
            |scene: &Scene| Maps::new(self.device, &scene.materials, &method, Precision::Half, &|_| ());
        let (flat_maps, maps) = (maps(&flat)?, maps(&scene)?);
        let flat_geometry = Geometry::new(self.device, &flat)?;
        let meshes = Meshes::new(self.device, &scene)?;
        let (mut cut, mut drawn, mut plain) = (Vec::new(), Vec::new(), Vec::new());
        let mut triangles = 0;
        for turn in 0..=self.runs {
            let begin = Instant::now();
            let geometry = meshes.cut(&scene.camera, size)?;
            self.device.wait()?;
            let cutting = begin.elapsed().as_secs_f64() * 1e3;
            triangles = geometry.len();
            let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
            let drawing = self.renderer.time(&canvas, &frame(shown, &maps))?;
            let shown = SceneView { scene: &flat, geometry: &flat_geometry, camera: &flat.camera };
            let flat_drawing = self.renderer.time(&canvas, &frame(shown, &flat_maps))?;
            if turn > 0 {
                cut.push(cutting);
                drawn.push(drawing);
                plain.push(flat_drawing);
            }
        }
        let (cut, drawn, plain) = (median(cut), median(drawn), median(plain));
        println!(
            "{name} at {time}, displaced, slopes: {triangles} triangles ({:.2} a pixel), cut {cut:.2} ms, drawn {drawn:.2} ms; as a normal map \
             {plain:.2} ms: {:.2} times",
            triangles as f64 / size.area() as f64,
            (cut + drawn) / plain
        );
        Ok(())
    }

    /// Light from everywhere, by some techniques, over the scene's own lights with the same method.
    fn surrounded(
        &self,
        (name, time): (&str, f64),
        size: Size,
        spellings: &[&str],
        techniques: &[Technique],
    ) -> Outcome<()> {
        let mut scene = staged(name, time, size)?;
        let built = builtin::find("sky").ok_or("no such environment")?.build();
        let environment = SceneEnvironment::new(built);
        let geometry = Geometry::new(self.device, &scene)?;
        let canvas = Canvas::new(self.device, size, Antialiasing::Sharp)?;
        let parsed = parsed(spellings)?;
        let all = self.maps(&scene, &parsed)?;
        let times = |scene: &Scene| {
            let shown = SceneView { scene, geometry: &geometry, camera: &scene.camera };
            self.times(&canvas, &shown, &all, Sampling::Sampler(1))
        };
        let lit = times(&scene)?;
        scene.lights.clear();
        for technique in techniques {
            scene.environment = Some(SceneEnvironment { technique: *technique, ..environment.clone() });
            for (((spelling, _), lit), ms) in all.iter().zip(&lit).zip(times(&scene)?) {
                println!(
                    "{name} at {time}, {spelling}: {lit:.2} ms lit; in an environment, {}, {ms:.2} ms: {:.2} times",
                    technique.name(),
                    ms / lit
                );
            }
        }
        Ok(())
    }

    fn creature(&self, size: Size) -> Outcome<()> {
        let scene = staged("creature", 0.3, size)?;
        let geometry = Geometry::new(self.device, &scene)?;
        let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
        let method = "vmf:6".parse::<AnyMethod>()?;
        let all = [("vmf:6", Maps::new(self.device, &scene.materials, &method, Precision::Half, &|_| ())?)];
        for outlines in [Antialiasing::Sharp, Antialiasing::Multisampled] {
            let canvas = Canvas::new(self.device, size, outlines)?;
            let ms = self.times(&canvas, &shown, &all, Sampling::Sampler(1))?[0];
            let Size { width, height } = size;
            println!("creature, {width} x {height}, vmf:6, sampler, outlines {outlines:?}: {ms:.2} ms");
        }
        Ok(())
    }
}

/// From nothing to the first picture, baking apart.
fn start(spelling: &str, size: Size) -> Outcome<()> {
    let scene = staged("disk", 0.1, size)?;
    let method = spelling.parse::<AnyMethod>()?;
    let begin = Instant::now();
    let device = Device::open()?;
    let opened = begin.elapsed();
    let renderer = Renderer::new(&device)?;
    let geometry = Geometry::new(&device, &scene)?;
    let baking = Instant::now();
    let maps = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ())?;
    let baked = baking.elapsed();
    let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
    let canvas = Canvas::new(&device, size, Antialiasing::Multisampled)?;
    renderer.draw(&canvas, &Frame { view: shown, maps: &maps, lookups: Lookups::sampler(1) })?;
    canvas.read()?;
    let all = begin.elapsed();
    println!(
        "{spelling}: first picture {:.2} s after the start: device {:.2} s, bake and upload {:.2} s",
        all.as_secs_f64(),
        opened.as_secs_f64(),
        baked.as_secs_f64()
    );
    Ok(())
}

fn main() -> Outcome<()> {
    let (side, runs) = (setting("NDFMAP_BENCH_SIZE", 500), setting("NDFMAP_BENCH_RUNS", 15));
    let size = Size { width: side, height: side };
    let device = match Device::open() {
        Ok(device) => device,
        Err(e) => {
            println!("SKIPPED: {e}");
            return Ok(());
        }
    };
    println!("{}, clock: {}", device.description(), if device.has_timestamps() { "device" } else { "wall" });
    for spelling in ["toksvig", "vmf:4", "phong:4"] {
        start(spelling, size)?;
    }
    let renderer = Renderer::new(&device)?;
    let bench = Bench { device: &device, renderer: &renderer, runs };
    // 640 x 480 for the default size, as in Han et al.
    bench.creature(Size { width: side * 32 / 25, height: side * 24 / 25 })?;
    for (name, time) in [
        ("noise-sphere", 0.0),
        ("noise-sphere", 0.5),
        ("noise-sphere", 1.0),
        ("armour", 0.0),
        ("armour", 0.5),
        ("desert", 0.5),
    ] {
        bench.displaced(name, time, size)?;
    }
    for place in [("sphere", 0.0), ("armour", 0.5)] {
        bench.surrounded(place, size, &["toksvig", "vmf:6"], &Technique::ALL)?;
        // Grids of slopes look the light itself up, whatever the technique.
        bench.surrounded(place, size, &["slopes", "slopes:9", "slopes:32"], &[Technique::Prefiltered])?;
    }
    for (name, time) in [("disk", 0.15), ("armour", 0.5)] {
        bench.methods(name, time, size)?;
    }
    Ok(())
}
