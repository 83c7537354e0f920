//! Models for engines to render, and a judge of what they rendered.
//!
//! `cargo run --release -p ndfmap-figures --example engines -- models FOLDER NAME=NORMAL[,ROUGHNESS]...`
//! writes `NAME_stock.glb` for each: a plane to the horizon and a sphere of one metal, whose roughness is a
//! number or a grey picture. `... -- table FOLDER [WORST MEAN]` reads pictures that engines rendered
//! (`ENGINE_MAP_OBJECT_LIGHT_FILTER_VARIANT.f32`, and their `..._truth.f32`) and prints each variant's errors
//! and their ratios to stock; `... -- sheet FOLDER VARIANT,VARIANT CASE... FILE` draws variants beside the
//! truth.
//! `tests/engines/run` does both.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::f32::consts::{PI, TAU};
use std::path::Path;

use glam::{Vec2, Vec3};
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::surface::SurfaceRow;
use ndfmap::draw::{Panel, Sheet, SheetRow, Theme};
use ndfmap::maps::formats::{png, read_file, read_image};
use ndfmap::maps::source::{SourceOptions, read_source};
use ndfmap::scene::metrics::{FlipTruth, Picture, relative_l2, to_bytes};
use serde_json::{Value, json};

/// Pixels on a side of an engine's picture.
const SIDE: usize = 256;

/// Brightness of a truth's mean on the display, as `ndfmap gltf` judges.
const MIDDLE: f64 = 0.3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["models", folder, wanted @ ..] => wanted.iter().try_for_each(|spec| model(Path::new(folder), spec)),
        ["table", folder] => table(Path::new(folder), None),
        ["table", folder, worst, mean] => {
            table(Path::new(folder), Some(Passing { worst: worst.parse()?, mean: mean.parse()? }))
        }
        ["sheet", folder, variants, cases @ .., file] => {
            sheet(Path::new(folder), &variants.split(',').collect::<Vec<_>>(), cases, Path::new(file))
        }
        _ => Err(
            "models FOLDER NAME=NORMAL[,ROUGHNESS]..., table FOLDER [WORST MEAN], or sheet FOLDER VARIANT,VARIANT CASE... FILE"
                .into(),
        ),
    }
}

/// Mesh of glTF.
#[derive(Default)]
struct Mesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    tangents: Vec<[f32; 4]>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u16; 3]>,
}

/// Plane of 60 units on which the map repeats 30 times.
fn plane() -> Mesh {
    let mut mesh = Mesh::default();
    for (x, z) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        mesh.positions.push(Vec3::new(60.0 * x - 30.0, 0.0, 60.0 * z - 30.0));
        mesh.normals.push(Vec3::Y);
        mesh.tangents.push([1.0, 0.0, 0.0, 1.0]);
        mesh.uvs.push(30.0 * Vec2::new(x, z));
    }
    mesh.triangles = vec![[0, 2, 1], [1, 2, 3]];
    mesh
}

/// Unit sphere on which the map repeats 6 times around and 3 times from pole to pole.
fn sphere() -> Mesh {
    const AROUND: u16 = 96;
    const DOWN: u16 = 64;
    let mut mesh = Mesh::default();
    for i in 0..=DOWN {
        for j in 0..=AROUND {
            let (u, v) = (f32::from(j) / f32::from(AROUND), f32::from(i) / f32::from(DOWN));
            let (sin, cos) = (v * PI).sin_cos();
            let (x, z) = (u * TAU).sin_cos();
            let normal = Vec3::new(sin * x, cos, sin * z);
            mesh.positions.push(normal);
            mesh.normals.push(normal);
            mesh.tangents.push([z, 0.0, -x, 1.0]);
            mesh.uvs.push(Vec2::new(6.0 * u, 3.0 * v));
            if i < DOWN && j < AROUND {
                let a = i * (AROUND + 1) + j;
                let below = a + AROUND + 1;
                mesh.triangles.extend([[a, below, a + 1], [a + 1, below, below + 1]]);
            }
        }
    }
    mesh
}

/// Binary chunk with its views.
#[derive(Default)]
struct Chunk {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Chunk {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn floats(&mut self, kind: &str, values: impl Iterator<Item = Vec<f32>>) -> usize {
        let values: Vec<Vec<f32>> = values.collect();
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let extreme = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..values[0].len()).map(|c| values.iter().map(|v| v[c]).reduce(pick).unwrap_or(0.0)).collect()
        };
        self.accessors.push(json!({ "bufferView": view, "componentType": 5126, "count": values.len(),
            "type": kind, "min": extreme(f32::min), "max": extreme(f32::max) }));
        self.accessors.len() - 1
    }

    fn mesh(&mut self, mesh: &Mesh) -> Value {
        let position = self.floats("VEC3", mesh.positions.iter().map(|v| v.to_array().to_vec()));
        let normal = self.floats("VEC3", mesh.normals.iter().map(|v| v.to_array().to_vec()));
        let tangent = self.floats("VEC4", mesh.tangents.iter().map(|v| v.to_vec()));
        let uv = self.floats("VEC2", mesh.uvs.iter().map(|v| v.to_array().to_vec()));
        let indices: Vec<u8> = mesh.triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&indices);
        self.accessors.push(json!({ "bufferView": view, "componentType": 5123,
            "count": 3 * mesh.triangles.len(), "type": "SCALAR" }));
        json!({ "primitives": [{ "attributes": { "POSITION": position, "NORMAL": normal, "TANGENT": tangent,
            "TEXCOORD_0": uv }, "indices": self.accessors.len() - 1, "material": 0 }] })
    }
}

/// Writes the stock model of a map.
fn model(folder: &Path, spec: &str) -> Result<(), Box<dyn Error>> {
    let (name, files) = spec.split_once('=').ok_or("a model is NAME=NORMAL[,ROUGHNESS]")?;
    let (normal, roughness) = files.split_once(',').unwrap_or((files, "0.3"));
    let map = read_source(Path::new(normal), &SourceOptions::default())?;
    let size = map.surface.size();
    let mut texels = Vec::with_capacity(size.area());
    let mut row = SurfaceRow::flat(size.width);
    for y in 0..size.height {
        map.surface.read_row(y, &mut row);
        texels.extend((0..size.width).map(|x| row.normal(x).to_array().map(byte_of_signed)));
    }
    let mut chunk = Chunk::default();
    let mut images =
        vec![json!({ "mimeType": "image/png", "bufferView": chunk.view(&png::encode(&texels, size)?) })];
    let mut pbr = json!({ "baseColorFactor": [0.95, 0.85, 0.75, 1.0], "metallicFactor": 1.0 });
    match roughness.parse::<f32>() {
        Ok(number) => pbr["roughnessFactor"] = number.into(),
        Err(_) => {
            let image = read_image(Path::new(roughness), &read_file(Path::new(roughness))?)?;
            let texel = |i: usize| (image.samples.get(i * image.channels) * 255.0).round() as u8;
            let orm: Vec<[u8; 3]> = (0..image.size.area()).map(|i| [255, texel(i), 255]).collect();
            let view = chunk.view(&png::encode(&orm, image.size)?);
            images.push(json!({ "mimeType": "image/png", "bufferView": view }));
            pbr["metallicRoughnessTexture"] = json!({ "index": 1 });
        }
    }
    let meshes = [plane(), sphere()].map(|mesh| chunk.mesh(&mesh));
    let textures: Vec<Value> = (0..images.len()).map(|i| json!({ "sampler": 0, "source": i })).collect();
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "name": "plane", "mesh": 0 }, { "name": "sphere", "mesh": 1 }], "meshes": meshes,
        "materials": [{ "name": name, "pbrMetallicRoughness": pbr, "normalTexture": { "index": 0 } }],
        "textures": textures, "images": images,
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }],
        "accessors": chunk.accessors, "bufferViews": chunk.views,
        "buffers": [{ "byteLength": chunk.bytes.len() }],
    });
    let path = folder.join(format!("{name}_stock.glb"));
    std::fs::write(&path, binary(&document.to_string(), chunk.bytes))?;
    println!("{}", path.display());
    Ok(())
}

fn byte_of_signed(v: f32) -> u8 {
    ((0.5 * v + 0.5).clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Binary form of glTF.
fn binary(json: &str, mut bin: Vec<u8>) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let words = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let length = (12 + 8 + json.len() + 8 + bin.len()) as u32;
    let head = [&b"glTF"[..], &words(&[2, length, json.len() as u32]), b"JSON", &json];
    [&head.concat()[..], &words(&[bin.len() as u32]), b"BIN\0", &bin].concat()
}

/// Picture that an engine wrote; rows come from below.
fn picture(path: &Path) -> Result<Picture, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    if bytes.len() != SIDE * SIDE * 16 {
        return Err(format!(
            "{}: has {} bytes for a picture of {SIDE} × {SIDE}",
            path.display(),
            bytes.len()
        )
        .into());
    }
    let floats: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let pixels: &[[f32; 4]] = floats.as_chunks().0;
    Ok(Grid::from_fn(Size { width: SIDE, height: SIDE }, |x, y| {
        let [r, g, b, _] = pixels[(SIDE - 1 - y) * SIDE + x];
        Vec3::new(r, g, b)
    }))
}

/// Pixels that the object fills, without its rim: the sphere's disk, or what the truth of a plane lights.
fn mask(object: &str, truth: &Picture) -> Grid<bool> {
    // Of the stage: seven units away and four tenths up, 24 degrees high.
    let distance = (49.0_f64 + 0.16).sqrt();
    let radius = (1.0 / distance).asin().tan() / 12.0_f64.to_radians().tan() * SIDE as f64 / 2.0 - 2.0;
    let middle = |i: usize| i as f64 + 0.5 - SIDE as f64 / 2.0;
    Grid::from_fn(truth.size(), |x, y| {
        if object == "sphere" {
            return middle(x).hypot(middle(y)) < radius;
        }
        (y.saturating_sub(2)..=y).all(|y| truth.row(y)[x] != Vec3::ZERO)
    })
}

/// Errors of a picture where a mask is.
struct Errors {
    l2: f64,
    flip: f64,
}

/// Truth where a mask is.
struct Judge {
    exposure: f32,
    truth: Picture,
    mask: Grid<bool>,
    pixels: f64,
    seen: FlipTruth,
}

impl Judge {
    fn new(object: &str, truth: &Picture) -> Self {
        let mask = mask(object, truth);
        let pixels = mask.texels().iter().filter(|m| **m).count() as f64;
        let truth = masked(truth, &mask);
        let mean = truth.texels().iter().map(|v| f64::from(v.element_sum()) / 3.0).sum::<f64>() / pixels;
        let exposure = (MIDDLE / mean) as f32;
        let seen = FlipTruth::new(&truth, exposure);
        Self { exposure, truth, mask, pixels, seen }
    }

    fn errors(&self, picture: &Picture) -> Errors {
        let picture = masked(picture, &self.mask);
        let map = self.seen.map(&picture);
        let inside = map.texels().iter().zip(self.mask.texels()).filter(|(_, m)| **m);
        let flip = inside.map(|(e, _)| f64::from(*e)).sum::<f64>() / self.pixels;
        Errors { l2: relative_l2(&picture, &self.truth), flip }
    }
}

fn masked(picture: &Picture, mask: &Grid<bool>) -> Picture {
    Grid::from_fn(picture.size(), |x, y| if mask.row(y)[x] { picture.row(y)[x] } else { Vec3::ZERO })
}

/// Draws cases: the truth, and each variant with its errors.
fn sheet(folder: &Path, variants: &[&str], cases: &[&str], file: &Path) -> Result<(), Box<dyn Error>> {
    let picture_of = |name: &str| picture(&folder.join(format!("{name}.f32")));
    let mut sheet = Sheet { columns: vec!["truth".to_owned()], ..Sheet::default() };
    sheet.columns.extend(variants.iter().map(|variant| (*variant).to_owned()));
    for case in cases {
        let parts: Vec<&str> = case.split('_').collect();
        let [engine, map, object, light, filter] = parts[..] else { return Err("no such case".into()) };
        let truth = picture_of(&format!("{engine}_{map}_{object}_{light}_truth"))?;
        let judge = Judge::new(object, &truth);
        let mut panels = vec![Some(Panel::of(to_bytes(&truth, judge.exposure)))];
        for variant in variants {
            let shown = picture_of(&format!("{case}_{variant}"))?;
            let Errors { l2, flip } = judge.errors(&shown);
            let panel = Panel::of(to_bytes(&shown, judge.exposure));
            panels.push(Some(panel.said([format!("relative L2 {l2:.2}, FLIP {flip:.2}")])));
        }
        let head = [engine, map, object, light, filter].map(str::to_owned).to_vec();
        sheet.rows.push(SheetRow { head, panels });
    }
    Ok(std::fs::write(file, sheet.draw(Theme::Light).to_png()?)?)
}

/// Ratios to stock that a fixed model may have: the worst of any picture, and the mean.
#[derive(Clone, Copy)]
struct Passing {
    worst: f64,
    mean: f64,
}

/// Prints the errors of every picture of a folder, and the means of their ratios to stock; fails where fixed
/// models have others than may pass, or there are none.
fn table(folder: &Path, passing: Option<Passing>) -> Result<(), Box<dyn Error>> {
    let mut cases: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        let Some(stem) = name.strip_suffix(".f32") else { continue };
        if let Some((case, variant)) = stem.rsplit_once('_').filter(|(_, variant)| *variant != "truth") {
            cases.entry(case.to_owned()).or_default().insert(variant.to_owned());
        }
    }
    println!("| engine, map, object, light, filter | variant | relative L2 | FLIP | of stock |");
    println!("|---|---|---|---|---|");
    let mut ratios: BTreeMap<(String, String), Vec<[f64; 2]>> = BTreeMap::new();
    for (case, variants) in &cases {
        let parts: Vec<&str> = case.split('_').collect();
        let [engine, map, object, light, filter] = parts[..] else {
            return Err(format!("{case}: is no ENGINE_MAP_OBJECT_LIGHT_FILTER").into());
        };
        let file = |name: &str| folder.join(format!("{name}.f32"));
        let truth = picture(&file(&format!("{engine}_{map}_{object}_{light}_truth")))?;
        let judge = Judge::new(object, &truth);
        let stock = judge.errors(&picture(&file(&format!("{case}_stock")))?);
        for variant in variants {
            let errors = judge.errors(&picture(&file(&format!("{case}_{variant}")))?);
            let [l2, flip] = [errors.l2 / stock.l2, errors.flip / stock.flip];
            println!(
                "| {engine}, {map}, {object}, {light}, {filter} | {variant} | {:.3} | {:.3} | {l2:.2}, {flip:.2} |",
                errors.l2, errors.flip
            );
            ratios.entry((format!("{engine}, {filter}"), variant.clone())).or_default().push([l2, flip]);
        }
    }
    println!("\n| engine, filter | variant | cases | mean of stock | worst |\n|---|---|---|---|---|");
    for ((engine, variant), all) in &ratios {
        let mean = |i: usize| all.iter().map(|r| r[i]).sum::<f64>() / all.len() as f64;
        let worst = |i: usize| all.iter().map(|r| r[i]).fold(0.0, f64::max);
        println!(
            "| {engine} | {variant} | {} | {:.2}, {:.2} | {:.2}, {:.2} |",
            all.len(),
            mean(0),
            mean(1),
            worst(0),
            worst(1)
        );
        let fails = |Passing { worst: most, mean: goal }: Passing| {
            worst(0).max(worst(1)) > most || mean(0).max(mean(1)) > goal
        };
        if variant == "fixed" && passing.is_some_and(fails) {
            return Err(format!("{engine}: fixed models are worse than they may be").into());
        }
    }
    if passing.is_some() && !ratios.keys().any(|(_, variant)| variant == "fixed") {
        return Err("no fixed model was rendered".into());
    }
    Ok(())
}
