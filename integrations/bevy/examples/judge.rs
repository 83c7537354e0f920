//! Pictures by Bevy of a model of `tests/engines`, stock and with lobes, and a truth of 256 samples a pixel.
//!
//! `cargo run --example judge -- FOLDER MAPS LIGHTS VARIANTS`, each but the first a list with commas, reads
//! `MAP_stock.glb`, `MAP_bevy.glb` (the model that `ndfmap gltf --for bevy` fixed) and `MAP_lobes8.ktx2` or
//! other maps; it writes `bevy_MAP_OBJECT_LIGHT_16x_VARIANT.f32`, rows from below, four 32-bit floats a
//! pixel. Lights are `sun`, `env` and `mix`; variants are `truth`, `stock`, `unmipped`, `fixed`, and names of
//! maps.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use bevy::app::{PluginsState, TaskPoolPlugin};
use bevy::asset::{AssetPlugin, LoadState, RenderAssetUsages, UnapprovedPathMode};
use bevy::camera::{Exposure, Hdr, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::image::{ImageSampler, ImageSamplerDescriptor};
use bevy::light::GeneratedEnvironmentMapLight;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureUsages, TextureViewDescriptor, TextureViewDimension,
};
use bevy_ndfmap::{NdfMap3d, NdfMaterial, NdfPlugin};
use half::f16;

/// Pixels on a side of a picture.
const SIDE: u32 = 256;

/// Samples of the truth along a side of a pixel.
const SAMPLES: u32 = 16;

/// Scene as `tests/engines/stage.mjs` has it.
struct Stage {
    name: &'static str,
    mesh: usize,
    fov: f32,
    eye: Vec3,
    target: Vec3,
    sun: Vec3,
}

const STAGES: [Stage; 2] = [
    Stage {
        name: "plane",
        mesh: 0,
        fov: 45.0,
        eye: Vec3::new(0.3, 1.6, 0.0),
        target: Vec3::new(0.6, 0.35, -4.0),
        sun: Vec3::new(-2.5, 2.2, -1.5),
    },
    Stage {
        name: "sphere",
        mesh: 1,
        fov: 24.0,
        eye: Vec3::new(0.0, 0.4, 7.0),
        target: Vec3::ZERO,
        sun: Vec3::new(2.0, 2.5, 3.0),
    },
];

/// A way of drawing the model.
struct Variant<'a> {
    name: &'a str,
    /// File of the model, behind the map's name.
    model: &'static str,
    lobes: bool,
    /// True for mips of box-filtered normals, which Bevy does not make itself.
    mips: bool,
    truth: bool,
}

impl<'a> Variant<'a> {
    fn of(name: &'a str) -> Self {
        let plain = Self { name, model: "_stock.glb", lobes: false, mips: false, truth: false };
        match name {
            "truth" => Self { truth: true, ..plain },
            "unmipped" => plain,
            "stock" => Self { mips: true, ..plain },
            "fixed" => Self { model: "_bevy.glb", ..plain },
            _ => Self { lobes: true, mips: true, ..plain },
        }
    }
}

/// Texels that came back from the device.
#[derive(Resource, Default)]
struct Seen(Option<Vec<u8>>);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, maps, lights, variants] = arguments.as_slice() else {
        return Err("FOLDER MAPS LIGHTS VARIANTS".into());
    };
    let folder = std::path::absolute(folder)?;
    let mut app = app(&folder);
    let room = app.world_mut().resource_mut::<Assets<Image>>().add(room());
    for map in maps.split(',') {
        for stage in &STAGES {
            for light in lights.split(',') {
                for variant in variants.split(',').map(Variant::of) {
                    let began = Instant::now();
                    let picture =
                        draw(&mut app, &Shot { map, stage, light, variant: &variant, room: &room })?;
                    let filter = if variant.truth { "" } else { "16x_" };
                    let name = format!("bevy_{map}_{}_{light}_{filter}{}.f32", stage.name, variant.name);
                    std::fs::write(folder.join(&name), picture)?;
                    println!("{name}: {:.1} s", began.elapsed().as_secs_f64());
                }
            }
        }
    }
    Ok(())
}

/// Bevy without a window.
fn app(folder: &Path) -> App {
    let mut app = App::new();
    let assets = AssetPlugin {
        file_path: folder.display().to_string(),
        unapproved_path_mode: UnapprovedPathMode::Allow,
        ..default()
    };
    let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
    app.add_plugins((DefaultPlugins.set(assets).set(render).set(TaskPoolPlugin::default()), NdfPlugin));
    app.init_resource::<Seen>();
    // Light comes from the sun and the room alone.
    app.insert_resource(GlobalAmbientLight { brightness: 0.0, ..default() });
    while app.plugins_state() == PluginsState::Adding {
        std::thread::yield_now();
    }
    app.finish();
    app.cleanup();
    app
}

/// Picture to be drawn.
struct Shot<'a> {
    map: &'a str,
    stage: &'a Stage,
    light: &'a str,
    variant: &'a Variant<'a>,
    room: &'a Handle<Image>,
}

/// Loads an asset, and waits for it and all that it names.
fn load<A: Asset>(app: &mut App, path: String) -> Result<Handle<A>, Box<dyn Error>> {
    let server = app.world().resource::<AssetServer>().clone();
    let handle: Handle<A> = server.load(path.clone());
    loop {
        app.update();
        if let LoadState::Failed(error) = server.load_state(handle.id()) {
            return Err(format!("{path}: {error}").into());
        }
        if server.is_loaded_with_dependencies(handle.id()) {
            return Ok(handle);
        }
    }
}

/// Draws a picture: bytes of rows from below, four floats a pixel.
fn draw(app: &mut App, shot: &Shot) -> Result<Vec<u8>, Box<dyn Error>> {
    let Shot { map, stage, light, variant, room } = shot;
    let model = format!("{map}{}", variant.model);
    let mesh: Handle<Mesh> = load(app, format!("{model}#Mesh{}/Primitive0", stage.mesh))?;
    let loaded: Handle<StandardMaterial> = load(app, format!("{model}#Material0/std"))?;
    let material = material(app, &loaded, variant);
    println!("{model}: {} levels of roughness", levels(app, &material));
    let lobes = if variant.lobes { Some(load(app, format!("{map}_{}.ktx2", variant.name))?) } else { None };
    let world = app.world_mut();
    let body = world.spawn((Mesh3d(mesh), MeshMaterial3d(material))).id();
    if let Some(lobes) = lobes {
        world.entity_mut(body).insert(NdfMap3d(lobes));
    }
    let mut things = vec![body];
    if *light != "env" {
        let sun = DirectionalLight {
            illuminance: 2.0 * std::f32::consts::PI,
            shadow_maps_enabled: false,
            ..default()
        };
        things.push(
            world.spawn((sun, Transform::from_translation(stage.sun).looking_at(Vec3::ZERO, Vec3::Y))).id(),
        );
    }
    // Warmed up small: what is compiled and uploaded in the first frames is not drawn yet.
    let small = target(world, SIDE);
    let camera = world
        .spawn((
            Camera3d::default(),
            Camera { clear_color: ClearColorConfig::Custom(Color::BLACK), ..default() },
            RenderTarget::Image(small.clone().into()),
            Projection::Perspective(PerspectiveProjection {
                fov: stage.fov.to_radians(),
                near: 0.1,
                far: 200.0,
                ..default()
            }),
            Transform::from_translation(stage.eye).looking_at(stage.target, Vec3::Y),
            // An exposure of 1: a candela is a candela.
            (
                Hdr,
                Msaa::Off,
                Tonemapping::None,
                DebandDither::Disabled,
                Exposure { ev100: -(1.2_f32.log2()) },
            ),
        ))
        .id();
    if *light != "sun" {
        let intensity = if *light == "mix" { 0.35 } else { 1.0 };
        world.entity_mut(camera).insert(GeneratedEnvironmentMapLight {
            environment_map: (*room).clone(),
            intensity,
            ..default()
        });
    }
    things.push(camera);
    for _ in 0..6 {
        app.update();
    }
    if variant.lobes && app.world().get::<MeshMaterial3d<NdfMaterial>>(body).is_none() {
        return Err("lobes were not applied".into());
    }
    let samples = if variant.truth { SAMPLES } else { 1 };
    let wanted = if variant.truth { target(app.world_mut(), SIDE * samples) } else { small };
    app.world_mut().entity_mut(camera).insert(RenderTarget::Image(wanted.clone().into()));
    app.update();
    app.world_mut().resource_mut::<Seen>().0 = None;
    let keep = |event: On<ReadbackComplete>, mut seen: ResMut<Seen>| seen.0 = Some(event.data.clone());
    things.push(app.world_mut().spawn(Readback::texture(wanted)).observe(keep).id());
    let bytes = loop {
        app.update();
        if let Some(bytes) = app.world_mut().resource_mut::<Seen>().0.take() {
            break bytes;
        }
    };
    for thing in things {
        app.world_mut().despawn(thing);
    }
    app.update();
    Ok(picture(&bytes, samples as usize))
}

/// Picture in half floats to be drawn on.
fn target(world: &mut World, side: u32) -> Handle<Image> {
    let mut image = Image::new_target_texture(side, side, TextureFormat::Rgba16Float, None);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    world.resource_mut::<Assets<Image>>().add(image)
}

/// Means of each pixel's samples, rows from below, in 32-bit floats.
fn picture(bytes: &[u8], samples: usize) -> Vec<u8> {
    let side = SIDE as usize;
    let row = side * samples;
    let half = |at: usize| f16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]]).to_f32();
    // Bevy's own light has no value now and then, where a normal has no length: of the truth's samples such
    // are left out, and what half floats cannot hold counts for their largest.
    let mean = |x: usize, y: usize, c: usize| {
        let at = |i: usize| ((y * samples + i / samples) * row + x * samples + i % samples) * 4 + c;
        let seen = (0..samples * samples).map(|i| half(at(i))).filter(|value| !value.is_nan());
        let (sum, count) =
            seen.fold((0.0, 0.0), |(sum, count), value: f32| (sum + value.min(65504.0), count + 1.0));
        assert!(count > 0.0, "pixel {x}, {y} has no value");
        sum / count
    };
    (0..side * side * 4)
        .flat_map(|i| mean(i / 4 % side, side - 1 - i / 4 / side, i % 4).to_le_bytes())
        .collect()
}

/// Material of a variant: its pictures filtered by 16 taps, or by one of the finest level for the truth.
fn material(app: &mut App, loaded: &Handle<StandardMaterial>, variant: &Variant) -> Handle<StandardMaterial> {
    let world = app.world_mut();
    let mut material = world.resource::<Assets<StandardMaterial>>().get(loaded).cloned().unwrap_or_default();
    let mut images = world.resource_mut::<Assets<Image>>();
    for texture in [&mut material.normal_map_texture, &mut material.metallic_roughness_texture] {
        let Some(mut image) = texture.as_ref().and_then(|texture| images.get(texture)).cloned() else {
            continue;
        };
        if variant.mips {
            add_mips(&mut image);
        }
        let taps = if variant.truth { 1 } else { 16 };
        let repeat = bevy::image::ImageAddressMode::Repeat;
        image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
            address_mode_u: repeat,
            address_mode_v: repeat,
            anisotropy_clamp: taps,
            ..ImageSamplerDescriptor::linear()
        });
        *texture = Some(images.add(image));
    }
    world.resource_mut::<Assets<StandardMaterial>>().add(material)
}

/// Levels of a material's roughness picture, 0 without one.
fn levels(app: &App, material: &Handle<StandardMaterial>) -> u32 {
    let material = app.world().resource::<Assets<StandardMaterial>>().get(material);
    let picture = material.and_then(|material| material.metallic_roughness_texture.as_ref());
    let image = picture.and_then(|picture| app.world().resource::<Assets<Image>>().get(picture));
    image.map_or(0, |image| image.texture_descriptor.mip_level_count)
}

/// Adds levels by means of four texels, as engines make them.
fn add_mips(image: &mut Image) {
    let mut size = [image.width() as usize, image.height() as usize];
    let Some(mut bytes) = image.data.take() else { return };
    let mut from = 0;
    let mut levels = 1;
    while size != [1, 1] {
        let half = size.map(|side| (side / 2).max(1));
        for i in 0..half[0] * half[1] * 4 {
            let (x, y, c) = (i / 4 % half[0], i / 4 / half[0], i % 4);
            let at = |dx: usize, dy: usize| {
                let (x, y) = ((2 * x + dx).min(size[0] - 1), (2 * y + dy).min(size[1] - 1));
                u32::from(bytes[from + (y * size[0] + x) * 4 + c])
            };
            let mean = (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4;
            bytes.push(mean as u8);
        }
        from += size[0] * size[1] * 4;
        size = half;
        levels += 1;
    }
    image.data = Some(bytes);
    image.texture_descriptor.mip_level_count = levels;
}

/// Cube of a room: dim walls, lighter above, with three windows.
fn room() -> Image {
    const TEXELS: u32 = 64;
    let mut data = Vec::new();
    for face in 0..6 {
        for i in 0..TEXELS * TEXELS {
            let at = |k: u32| 2.0 * (k as f32 + 0.5) / TEXELS as f32 - 1.0;
            let (u, v) = (at(i % TEXELS), at(i / TEXELS));
            let towards = match face {
                0 => Vec3::new(1.0, -v, -u),
                1 => Vec3::new(-1.0, -v, u),
                2 => Vec3::new(u, 1.0, v),
                3 => Vec3::new(u, -1.0, -v),
                4 => Vec3::new(u, -v, 1.0),
                _ => Vec3::new(-u, -v, -1.0),
            };
            let windows = [Vec3::new(1.0, 0.6, 0.3), Vec3::new(-0.6, 0.8, -0.6), Vec3::new(0.1, 1.0, 0.1)];
            let inside = windows.iter().any(|w| towards.normalize().dot(w.normalize()) > 0.95);
            let bright = if inside { 12.0 } else { 0.25 + 0.2 * towards.normalize().y };
            for value in [bright, bright, bright, 1.0] {
                data.extend(f16::from_f32(value).to_le_bytes());
            }
        }
    }
    let size = Extent3d { width: TEXELS, height: TEXELS, depth_or_array_layers: 6 };
    let usage = RenderAssetUsages::default();
    let mut image = Image::new(size, TextureDimension::D2, data, TextureFormat::Rgba16Float, usage);
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() });
    image
}
