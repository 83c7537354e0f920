//! Whole pictures: the GPU's are the CPU's, for every method, and so is its truth.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;
mod inexact;

use common::device;
use inexact::inexact;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::environment::{SceneEnvironment, Technique, builtin};
use ndfmap_core::lookup::{Filtering, Lookups, Sampling};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Unobserved;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::{brdf, ndf};
use ndfmap_gpu::{
    Antialiasing, Canvas, Device, FinestMaps, Frame, Geometry, Maps, Meshes, Renderer, SceneView, TrueFrame,
};
use ndfmap_scene as scene;
use ndfmap_scene::metrics::{Picture, display, relative_l2};
use ndfmap_scene::{Effort, Scene, SceneOptions, SurfaceTextures};
use ndfmap_trace::filtered::{BakedMaps, Filtered};
use ndfmap_trace::truth::Truth;

/// A display value may be off by one step of a byte.
const STEP: f32 = 1.0 / 255.0;

/// Pixels that may be off by more: those in which a triangle's edge passes so near a sample that a rasteriser
/// and a ray decide otherwise, and those where the number of taps, a whole number, differs for a last digit.
const MAY_DIFFER: f64 = 1e-3;

/// Changes on inexact devices that a picture may differ by: tosses of coins are no worst case.
const SPREADS: f64 = 2.0;

/// Largest share of pixels that may change on an inexact device: with more, the bound would allow anything.
const MOST_SPREAD: f64 = 0.01;

/// Renderers of two devices, each as inexact as the standard allows, on top of the one given.
fn inexact_renderers(device: &Device) -> [Renderer; 2] {
    let rewrites: [fn(&str) -> String; 2] = [|shader| inexact(shader, 1), |shader| inexact(shader, 2)];
    rewrites.map(|rewrite| Renderer::new(&device.clone().rewriting_shaders(rewrite)).unwrap())
}

/// Share of pixels that may be off in a picture that this device drew, of which `share` are. Inexact devices
/// draw only where that is more than any picture may be off by: they compile every shader anew, and cannot
/// allow less.
fn may_be_off(inexact: &[Renderer], canvas: &Canvas, frame: &Frame<'_>, drawn: &Picture, share: f64) -> f64 {
    if share <= MAY_DIFFER {
        return MAY_DIFFER;
    }
    let spread = inexact.iter().map(|renderer| {
        renderer.draw(canvas, frame).unwrap();
        off(&canvas.read().unwrap(), drawn, frame.view.scene.exposure)
    });
    let spread = spread.fold(0.0, f64::max);
    assert!(spread < MOST_SPREAD, "{spread} of the pixels change on an inexact device");
    MAY_DIFFER + SPREADS * spread
}

fn staged(name: &str, time: f64, map: usize) -> Scene {
    let size = Size { width: map, height: map };
    (scene::find(name).unwrap().build)(&SceneOptions { time, map_size: size, map: None })
}

/// Share of pixels with a display value that is off by more than [`STEP`].
fn off(a: &Picture, b: &Picture, exposure: f32) -> f64 {
    let far = |(a, b): &(&glam::Vec3, &glam::Vec3)| {
        // A pixel that is no number is off.
        let apart = (display(**a, exposure) - display(**b, exposure)).abs();
        !apart.cmple(glam::Vec3::splat(STEP)).all()
    };
    a.texels().iter().zip(b.texels()).filter(far).count() as f64 / a.texels().len() as f64
}

#[test]
fn every_method_draws_what_the_cpu_draws() {
    let Some(device) = device() else { return };
    let (renderer, size) = (Renderer::new(&device).unwrap(), Size { width: 240, height: 200 });
    let canvas = Canvas::new(&device, size, Antialiasing::Parts).unwrap();
    let inexact = inexact_renderers(&device);
    let scenes = [("disk", 0.4), ("armour", 0.3), ("plane", 0.0)];
    let scenes = scenes.map(|(name, time)| (name, staged(name, time, 128)));
    let methods = ndf::TABLE.iter().flat_map(|row| &row.samples[..1]);
    let methods = methods.copied().chain(["ndm:plane", "sh:7", "vmf:4:unaligned", "gmm:4:prior"]);
    let mut failed = Vec::new();
    for spelling in methods {
        let method = spelling.parse::<AnyMethod>().unwrap();
        for (name, scene) in &scenes {
            let ours = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
            let theirs = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ()).unwrap();
            let on_cpu = ndfmap_trace::Geometry::new(scene);
            let on_gpu = Geometry::new(&device, scene).unwrap();
            let shown = SceneView { scene, geometry: &on_gpu, camera: &scene.camera };
            let traced = Filtered { scene, geometry: &on_cpu, maps: &theirs };
            for (filtering, neighbours) in
                [(Filtering::TRILINEAR, false), (Filtering::anisotropic(8), spelling.contains("unaligned"))]
            {
                let lookups = Lookups { sampling: Sampling::Taps(filtering), neighbours, at_means: false };
                let frame = Frame { view: shown, maps: &ours, lookups };
                renderer.draw(&canvas, &frame).unwrap();
                let drawn = canvas.read().unwrap();
                let traced = traced.render(&scene.camera, size, lookups, &Unobserved).unwrap();
                let share = off(&drawn, &traced, scene.exposure);
                let allowed = may_be_off(&inexact, &canvas, &frame, &drawn, share);
                let taps = filtering.max_taps;
                eprintln!("{spelling} {name} {taps} taps: {share:.5} off, allowed {allowed:.5}");
                if share > allowed {
                    failed.push((spelling, *name, share, allowed));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn the_truth_is_the_truth() {
    let Some(device) = device() else { return };
    let (renderer, size) = (Renderer::new(&device).unwrap(), Size { width: 120, height: 100 });
    let sharp = Canvas::new(&device, size, Antialiasing::Sharp).unwrap();
    let parts = Canvas::new(&device, size, Antialiasing::Parts).unwrap();
    let method = "vmf:4".parse::<AnyMethod>().unwrap();
    for (name, time) in [("disk", 0.2), ("armour", 0.5), ("v-groove", 0.5)] {
        let scene = staged(name, time, 128);
        let on_gpu = Geometry::new(&device, &scene).unwrap();
        let shown = SceneView { scene: &scene, geometry: &on_gpu, camera: &scene.camera };
        let finest = FinestMaps::new(&device, &scene.materials).unwrap();
        let ours = renderer
            .truth(&sharp, &TrueFrame { view: shown, finest: &finest }, &Effort::rays(512), &Unobserved)
            .unwrap();
        let on_cpu = ndfmap_trace::Geometry::new(&scene);
        let truth = Truth::new(&scene, &on_cpu);
        let effort = Effort { seed: 3, ..Effort::rays(512) };
        let theirs = truth.render(&scene.camera, size, &effort, &Unobserved).unwrap();
        let apart = relative_l2(&ours.picture, &theirs.picture);
        let expected = ours.noise.hypot(theirs.noise);
        // The noise of both is itself known to a tenth or so, from one difference of halves over 12 000
        // pixels of uneven weight.
        assert!(apart < 1.25 * expected, "{name}: {apart} apart, noise {} and {}", ours.noise, theirs.noise);
        // A bias would stand out of the noise in the mean over all pixels, which has a hundredth of it.
        let mean =
            |p: &Picture| p.texels().iter().sum::<glam::Vec3>().element_sum() / p.texels().len() as f32;
        let ratio = f64::from(mean(&ours.picture) / mean(&theirs.picture));
        assert!((ratio - 1.0).abs() < 5.0 * expected / 100.0, "{name}: means are {ratio} apart");
        // Errors of a method are the same on both devices, to the noise of either truth.
        let maps = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
        let taps = Sampling::Taps(Filtering::fine(16));
        let lookups = Lookups { sampling: taps, neighbours: false, at_means: false };
        renderer.draw(&parts, &Frame { view: shown, maps: &maps, lookups }).unwrap();
        let drawn = relative_l2(&parts.read().unwrap(), &ours.picture);
        let maps = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ()).unwrap();
        let traced = Filtered { scene: &scene, geometry: &on_cpu, maps: &maps };
        let traced =
            relative_l2(&traced.render(&scene.camera, size, lookups, &Unobserved).unwrap(), &theirs.picture);
        eprintln!(
            "{name}: apart {apart:.4}, noise {expected:.4}; vmf:4 is off by {drawn:.4} and {traced:.4}"
        );
        assert!((drawn - traced).abs() < expected, "{name}: {drawn} and {traced}");
    }
}

#[test]
fn the_sampler_is_near_our_taps() {
    // A sampler may do as it likes; but one that is far from a plain trilinear filter would be a
    // bug of ours.
    let Some(device) = device() else { return };
    let (renderer, size) = (Renderer::new(&device).unwrap(), Size { width: 200, height: 200 });
    let scene = staged("disk", 0.3, 256);
    let method = "vmf:4".parse::<AnyMethod>().unwrap();
    let maps = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
    let geometry = Geometry::new(&device, &scene).unwrap();
    let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
    let canvas = Canvas::new(&device, size, Antialiasing::Multisampled).unwrap();
    let draw = |sampling| {
        renderer
            .draw(
                &canvas,
                &Frame { view: shown, maps: &maps, lookups: Lookups { sampling, ..Lookups::TRILINEAR } },
            )
            .unwrap();
        canvas.read().unwrap()
    };
    let ours = draw(Sampling::Taps(Filtering::TRILINEAR));
    let theirs = draw(Sampling::Sampler(1));
    let apart = relative_l2(&theirs, &ours);
    eprintln!("sampler and taps are {apart:.4} apart");
    // Samplers may take the longer of a pixel's two sides for its reach and mix levels over half the way
    // only: a few hundredths. Software Vulkan does neither: measured 0.002.
    let bound = if device.is_software() { 0.004 } else { 0.1 };
    assert!(apart < bound, "{apart}");
}

#[test]
fn colours_and_roughness_of_maps_are_drawn_too() {
    let Some(device) = device() else { return };
    let (renderer, size) = (Renderer::new(&device).unwrap(), Size { width: 160, height: 160 });
    let canvas = Canvas::new(&device, size, Antialiasing::Parts).unwrap();
    let mut scene = staged("foil", 0.5, 64);
    let map = Size { width: 64, height: 64 };
    let wave = |x: usize, k: f32| 0.5 + 0.5 * (x as f32 * k).sin();
    // As glTF has it, roughness from 0.3 to 0.95: slope variances to 0.4.
    let roughness = |x: usize, y: usize| (0.3 + 0.65 * wave(x + 2 * y, 0.5)).powi(4) / 2.0;
    let diffuse_roughness = Grid::from_fn(map, |x, y| [wave(x, 0.7), 0.3, wave(y, 0.2), roughness(x, y)]);
    let specular = Grid::from_fn(map, |x, y| [0.4, wave(x, 0.1), wave(y, 0.3), 1.0]);
    scene.materials[0].textures = Some(SurfaceTextures {
        diffuse_roughness: diffuse_roughness.into(),
        specular: Some(specular.into()),
    });
    let on_gpu = Geometry::new(&device, &scene).unwrap();
    let on_cpu = ndfmap_trace::Geometry::new(&scene);
    let shown = SceneView { scene: &scene, geometry: &on_gpu, camera: &scene.camera };
    let inexact = inexact_renderers(&device);
    let filtering = Filtering::anisotropic(4);
    for spelling in ["vmf:2", "gmm:3", "slopes", "toksvig", "ndm", "ndm:gaussian", "phong:1", "sh:4", "sh:7"]
    {
        let method = spelling.parse::<AnyMethod>().unwrap();
        let ours = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
        let lookups = Lookups { sampling: Sampling::Taps(filtering), neighbours: false, at_means: false };
        let frame = Frame { view: shown, maps: &ours, lookups };
        renderer.draw(&canvas, &frame).unwrap();
        let drawn = canvas.read().unwrap();
        let theirs = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ()).unwrap();
        let traced = Filtered { scene: &scene, geometry: &on_cpu, maps: &theirs };
        let traced = traced.render(&scene.camera, size, lookups, &Unobserved).unwrap();
        let (share, apart) = (off(&drawn, &traced, scene.exposure), relative_l2(&drawn, &traced));
        let allowed = may_be_off(&inexact, &canvas, &frame, &drawn, share);
        eprintln!("{spelling}: {share:.5} off, allowed {allowed:.5}, {apart:.5} apart");
        assert!(share <= allowed, "{spelling}: {share} off, {allowed} allowed, {apart} apart");
    }
}

#[test]
fn displaced_scenes_are_the_cpus() {
    let Some(device) = device() else { return };
    let (renderer, size) = (Renderer::new(&device).unwrap(), Size { width: 240, height: 200 });
    let canvas = Canvas::new(&device, size, Antialiasing::Parts).unwrap();
    for (name, time, shadows) in
        [("noise-sphere", 0.1, false), ("armour", 0.2, true), ("desert", 0.4, false), ("plane", 0.0, true)]
    {
        let mut scene = staged(name, time, 128);
        scene.displace(1.0, shadows).unwrap();
        let on_cpu = ndfmap_trace::Geometry::displaced(&scene, &scene.camera, size);
        let on_gpu = Meshes::new(&device, &scene).unwrap().cut(&scene.camera, size).unwrap();
        assert_eq!(on_gpu.len(), on_cpu.len(), "{name}");
        let shown = SceneView { scene: &scene, geometry: &on_gpu, camera: &scene.camera };
        for spelling in ["slopes", "vmf:4"] {
            let method = spelling.parse::<AnyMethod>().unwrap();
            let ours = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
            let theirs = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ()).unwrap();
            let traced = Filtered { scene: &scene, geometry: &on_cpu, maps: &theirs };
            let filtering = Filtering::TRILINEAR;
            let sampling = Sampling::Taps(filtering);
            let lookups = Lookups { sampling, neighbours: false, at_means: false };
            renderer.draw(&canvas, &Frame { view: shown, maps: &ours, lookups }).unwrap();
            let drawn = canvas.read().unwrap();
            let traced = traced.render(&scene.camera, size, lookups, &Unobserved).unwrap();
            let share = off(&drawn, &traced, scene.exposure);
            eprintln!("{name} displaced, {spelling}: {share:.5} off, {} triangles", on_gpu.len());
            // Triangles are of a few pixels, and so edges are many.
            assert!(share < 5.0 * MAY_DIFFER, "{name} {spelling}: {share}");
        }
    }
}

/// The shares of pixels that are off, of a scene by a method on both devices.
fn off_by(device: &Device, scene: &Scene, spelling: &str, size: Size) -> f64 {
    let (renderer, method) = (Renderer::new(device).unwrap(), spelling.parse::<AnyMethod>().unwrap());
    let canvas = Canvas::new(device, size, Antialiasing::Parts).unwrap();
    let ours = Maps::new(device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
    let theirs = BakedMaps::new(&scene.materials, &method, Precision::Half, &|_| ()).unwrap();
    let on_cpu = ndfmap_trace::Geometry::displaced(scene, &scene.camera, size);
    let on_gpu = Meshes::new(device, scene).unwrap().cut(&scene.camera, size).unwrap();
    let shown = SceneView { scene, geometry: &on_gpu, camera: &scene.camera };
    let traced = Filtered { scene, geometry: &on_cpu, maps: &theirs };
    let filtering = Filtering::anisotropic(4);
    let lookups = Lookups { sampling: Sampling::Taps(filtering), neighbours: false, at_means: false };
    renderer.draw(&canvas, &Frame { view: shown, maps: &ours, lookups }).unwrap();
    off(
        &canvas.read().unwrap(),
        &traced.render(&scene.camera, size, lookups, &Unobserved).unwrap(),
        scene.exposure,
    )
}

/// Lit by a built-in environment alone, turned, at an exposure that shows it.
fn surrounded(mut scene: Scene, environment: &str, technique: Technique) -> Scene {
    let built = builtin::find(environment).unwrap().build();
    scene.lights.clear();
    scene.environment = Some(SceneEnvironment { technique, rotation: 0.7, ..SceneEnvironment::new(built) });
    scene.exposure = 0.8;
    scene
}

#[test]
fn environments_light_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let size = Size { width: 120, height: 100 };
    let methods = ndf::TABLE.iter().map(|row| row.samples[0]);
    let cases =
        methods.chain(["sh:7", "slopes:9", "slopes:9:drawn"]).enumerate().flat_map(|(at, spelling)| {
            let environment = ["studio", "sky"][at % 2];
            Technique::ALL.map(|technique| (spelling, environment, technique))
        });
    let mut failed = Vec::new();
    for (spelling, environment, technique) in cases {
        let scene = surrounded(staged("disk", 0.4, 128), environment, technique);
        let share = off_by(&device, &scene, spelling, size);
        eprintln!("{spelling} {environment} {}: {share:.5} off", technique.name());
        // Twice as many as without an environment: samplers keep eight bits of where between two texels they
        // are, which edges of lamps show.
        if share > 2.0 * MAY_DIFFER {
            failed.push((spelling, environment, technique, share));
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn every_lobe_is_lit_by_environments_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let size = Size { width: 120, height: 100 };
    let mut failed = Vec::new();
    for (at, lobe) in brdf::TABLE.iter().map(|row| row.samples[0]).enumerate() {
        for spelling in ["vmf:4", "slopes"] {
            let mut scene = surrounded(staged("sphere", 0.0, 128), "studio", Technique::ALL[at % 2]);
            scene.set_brdf(&*lobe.parse::<AnyLobe>().unwrap());
            let share = off_by(&device, &scene, spelling, size);
            eprintln!("{spelling} {lobe}: {share:.5} off");
            if share > 2.0 * MAY_DIFFER {
                failed.push((spelling, lobe, share));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn displaced_surfaces_in_environments_are_lit_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let size = Size { width: 120, height: 100 };
    for (spelling, shadows) in [("slopes", false), ("slopes:9", true)] {
        let mut scene = surrounded(staged("noise-sphere", 0.5, 128), "studio", Technique::Prefiltered);
        scene.displace(1.0, shadows).unwrap();
        let share = off_by(&device, &scene, spelling, size);
        eprintln!("{spelling}: {share:.5} off");
        // As displaced pictures under lights: edges of small triangles.
        assert!(share < 5.0 * MAY_DIFFER, "{spelling}: {share}");
    }
}
