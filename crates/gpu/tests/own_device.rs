//! Another program: its own device, its own commands, its own texture, and our maps drawn on it.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::Vec3;
use half::f16;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::lookup::Lookups;
use ndfmap_core::ndf::{AnyMethod, Vmf};
use ndfmap_core::observe::{Cancelled, Observer, Unobserved};
use ndfmap_core::pyramid::Precision;
use ndfmap_gpu::{
    Antialiasing, Canvas, Device, FinestMaps, Frame, Geometry, GpuError, Maps, Renderer, SceneView, Target,
    TrueFrame, wgpu,
};
use ndfmap_scene as scene;
use ndfmap_scene::metrics::{Picture, relative_l2};
use ndfmap_scene::{Effort, Scene, SceneOptions};

const SIZE: Size = Size { width: 128, height: 96 };

fn disk() -> Scene {
    let row = scene::find("disk").unwrap();
    (row.build)(&SceneOptions { time: 0.4, map_size: Size { width: 128, height: 128 }, map: None })
}

/// A device that the program opened, without a word from us.
fn opened() -> Option<(wgpu::Device, wgpu::Queue)> {
    common::device()?;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter =
        pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap();
    let descriptor = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
    Some(pollster::block_on(adapter.request_device(&descriptor)).unwrap())
}

/// The program's texture, which it can copy from.
fn texture(device: &wgpu::Device) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width: SIZE.width as u32,
            height: SIZE.height as u32,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

/// Reads a texture back with the program's own commands, which hold what was recorded before.
fn submit_and_read(
    (device, queue): (&wgpu::Device, &wgpu::Queue),
    mut encoder: wgpu::CommandEncoder,
    texture: &wgpu::Texture,
) -> Picture {
    let row = 8 * SIZE.width as u32;
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row) * SIZE.height as u64,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let bytes = buffer.get_mapped_range(..).unwrap().to_vec();
    let halves: Vec<[f16; 4]> = bytemuck::pod_collect_to_vec(&bytes);
    let colour = |[r, g, b, _]: &[f16; 4]| Vec3::new(r.to_f32(), g.to_f32(), b.to_f32());
    Grid::from_vec(SIZE, halves.iter().map(colour).collect()).unwrap()
}

#[test]
fn a_frame_is_recorded_into_the_callers_commands() {
    let Some((device, queue)) = opened() else { return };
    let ours = Device::from_wgpu(device.clone(), queue.clone());
    let scene = disk();
    let method = AnyMethod::from(Vmf::new(4).unwrap());
    let maps = Maps::new(&ours, &scene.materials, &method, Precision::Half, &Unobserved).unwrap();
    let geometry = Geometry::new(&ours, &scene).unwrap();
    let renderer = Renderer::new(&ours).unwrap();
    let view = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
    let frame = Frame { view, maps: &maps, lookups: Lookups::TRILINEAR };
    let canvas = Canvas::new(&ours, SIZE, Antialiasing::Sharp).unwrap();
    renderer.draw(&canvas, &frame).unwrap();
    let expected = canvas.read().unwrap();

    let texture = texture(&device);
    let own = texture.create_view(&wgpu::TextureViewDescriptor::default());
    // Twice in the same commands, with the second frame's groups made by the first: nothing of one is lost in
    // the other.
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for _ in 0..2 {
        renderer.record(&mut encoder, &Target::new(&own, texture.format()), &frame).unwrap();
    }
    let drawn = submit_and_read((&device, &queue), encoder, &texture);
    // Half floats have eleven bits, and a device may cut off the rest: a 1024th at most. Measured 0.0004,
    // where lavapipe cuts.
    let apart = relative_l2(&drawn, &expected);
    assert!(apart < 1.0 / 1024.0, "{apart}");

    // Over what is there: of a scene turned away from, nothing is drawn, and all is kept.
    let away = ndfmap_scene::Camera { target: 2.0 * scene.camera.eye - scene.camera.target, ..scene.camera };
    let view = SceneView { camera: &away, ..view };
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let over = Target { keep: true, ..Target::new(&own, texture.format()) };
    renderer.record(&mut encoder, &over, &Frame { view, ..frame }).unwrap();
    let kept = submit_and_read((&device, &queue), encoder, &texture);
    assert_eq!(kept.texels(), drawn.texels());
}

/// Observer that stops the work at the second look.
#[derive(Default)]
struct Impatient {
    looks: AtomicUsize,
    told: Mutex<Vec<f64>>,
}

impl Observer for Impatient {
    fn progress(&self, fraction: f64) {
        self.told.lock().unwrap().push(fraction);
    }

    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed) > 0
    }
}

#[test]
fn an_observer_stops_bakes_and_truths() {
    let Some(device) = common::device() else { return };
    let scene = disk();
    let method = AnyMethod::from(Vmf::new(4).unwrap());
    let stopped = Maps::new(&device, &scene.materials, &method, Precision::Half, &Impatient::default());
    assert_eq!(stopped.err(), Some(GpuError::Cancelled(Cancelled)));
    let geometry = Geometry::new(&device, &scene).unwrap();
    let finest = FinestMaps::new(&device, &scene.materials).unwrap();
    let view = SceneView { scene: &scene, geometry: &geometry, camera: &scene.camera };
    let canvas = Canvas::new(&device, SIZE, Antialiasing::Sharp).unwrap();
    let renderer = Renderer::new(&device).unwrap();
    let (frame, observer) = (TrueFrame { view, finest: &finest }, Impatient::default());
    let stopped = renderer.truth(&canvas, &frame, &Effort::rays(1 << 20), &observer);
    assert_eq!(stopped.err(), Some(GpuError::Cancelled(Cancelled)));
    assert!(observer.told.lock().unwrap().iter().all(|fraction| *fraction < 0.01));
}
