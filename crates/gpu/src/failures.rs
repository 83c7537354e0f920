//! Tests: failures on a device come back as errors that say what failed.

use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::pyramid::Precision;
use ndfmap_scene as scene;
use ndfmap_scene::{Scene, SceneOptions};

use crate::{Antialiasing, Canvas, Device, Frame, Geometry, GpuError, Maps, Renderer, SceneView};
use ndfmap_core::ndf::AnyMethod;

/// Device with only some of the features we use; `None` skips tests that need not insist.
fn device(features: wgpu::Features) -> Option<Device> {
    match Device::open_with(features) {
        Err(e @ GpuError::NoAdapter) if std::env::var_os("NDFMAP_REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED: {e}");
            None
        }
        opened => Some(opened.unwrap_or_else(|e| panic!("{e}"))),
    }
}

fn foil(size: Size) -> Scene {
    let row = scene::find("foil").unwrap_or_else(|| panic!("foil is a scene"));
    (row.build)(&SceneOptions { time: 0.0, map_size: size, map: None })
}

const SMALL: Size = Size { width: 16, height: 16 };

#[test]
fn a_map_that_is_too_large_is_named() {
    let Some(device) = device(wgpu::Features::empty()) else { return };
    let scene = foil(Size { width: 40_000, height: 1 });
    let method = "naive".parse::<AnyMethod>().unwrap();
    let failed = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).err().unwrap();
    assert!(matches!(failed, GpuError::TooLarge { width: 40_000, .. }), "{failed}");
    let said = failed.to_string();
    assert!(said.starts_with("the map of material `foil` of 40000 × 1 in 2 layers is too large"), "{said}");
    let huge = Size { width: 100_000, height: 2 };
    assert!(matches!(Canvas::new(&device, huge, Antialiasing::Sharp), Err(GpuError::TooLarge { .. })));
}

#[test]
fn without_filtering_of_floats_half_floats_are_asked_for() {
    let Some(device) = device(wgpu::Features::empty()) else { return };
    let (scene, method) = (foil(SMALL), "naive".parse::<AnyMethod>().unwrap());
    let with = |precision| Maps::new(&device, &scene.materials, &method, precision, &|_| ());
    let failed = with(Precision::Single).err().unwrap();
    assert!(matches!(failed, GpuError::Unsupported { .. }));
    assert!(
        failed.to_string().ends_with("has no filtering of 32-bit floats: bake in half floats"),
        "{failed}"
    );
    assert!(with(Precision::Half).is_ok());
}

#[test]
fn frames_are_timed_with_and_without_a_clock_on_the_device() {
    for features in [wgpu::Features::empty(), wgpu::Features::TIMESTAMP_QUERY] {
        let Some(device) = device(features) else { return };
        let (scene, method) = (foil(SMALL), "naive".parse::<AnyMethod>().unwrap());
        let maps = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
        let geometry = Geometry::new(&device, &scene).unwrap();
        let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
        let canvas = Canvas::new(&device, SMALL, Antialiasing::Sharp).unwrap();
        let renderer = Renderer::new(&device).unwrap();
        let ms = renderer
            .time(&canvas, &Frame { view: shown, maps: &maps, lookups: Lookups::sampler(1) })
            .unwrap();
        assert!(ms > 0.0 && ms < 1e4, "{ms}");
    }
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(device) = device(wgpu::Features::empty()) else { return };
    let (scene, method) = (foil(SMALL), "naive".parse::<AnyMethod>().unwrap());
    let maps = Maps::new(&device, &scene.materials, &method, Precision::Half, &|_| ()).unwrap();
    let geometry = Geometry::new(&device, &scene).unwrap();
    let renderer = Renderer::new(&device).unwrap();
    let canvas = Canvas::new(&device, SMALL, Antialiasing::Sharp).unwrap();
    device.device.destroy();
    let shown = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
    let drawn = renderer.draw(&canvas, &Frame { view: shown, maps: &maps, lookups: Lookups::sampler(1) });
    let failed = drawn.and_then(|()| canvas.read()).err().unwrap();
    assert!(failed.to_string().contains("lost"), "{failed}");
}
