//! Models as people have them: sound files that went wrong once come out right (`tests/cases/README.md`).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use ndfmap_core::surface::SurfaceRow;
use ndfmap_maps::MapError;
use ndfmap_maps::model::{ModelOptions, model_of_bytes, read_model};
use ndfmap_scene::{Object, Scene, SceneOptions};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

fn case(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn options() -> ModelOptions {
    ModelOptions { staging: SceneOptions::default(), material: None }
}

fn read(name: &str) -> Result<(Scene, Vec<String>), MapError> {
    read_model(&case(name), &options())
}

/// The object under a place of the square from -1 to 1, its map coordinates and its normal there.
struct Hit<'a> {
    object: &'a Object,
    uv: Vec2,
    normal: Vec3,
}

/// Hit under (x, y), seen along z.
fn hit(scene: &Scene, at: Vec2) -> Option<Hit<'_>> {
    for object in &scene.objects {
        for triangle in &object.mesh.triangles {
            let [a, b, c] = triangle.map(|i| object.mesh.vertices[i as usize]);
            let flat = |p: Vec3| p.truncate();
            let area = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp_dot(r - p);
            let (p, q, r) = (flat(a.position), flat(b.position), flat(c.position));
            let whole = area(p, q, r);
            let shares = [area(at, q, r), area(p, at, r), area(p, q, at)].map(|part| part / whole);
            if whole != 0.0 && shares.iter().all(|s| *s >= 0.0) {
                let mixed = |f: fn(&ndfmap_scene::Vertex) -> Vec3| {
                    shares[0] * f(&a) + shares[1] * f(&b) + shares[2] * f(&c)
                };
                let uv = mixed(|v| v.uv.extend(0.0)).truncate();
                return Some(Hit { object, uv, normal: mixed(|v| v.normal).normalize() });
            }
        }
    }
    None
}

/// Diffuse colour under a place: the nearest texel's, as the map goes on beyond its edges.
fn diffuse(scene: &Scene, at: Vec2) -> Vec3 {
    let Hit { object, uv, .. } = hit(scene, at).unwrap();
    let material = &scene.materials[object.material];
    let Some(textures) = &material.textures else { return material.params.diffuse.as_vec3() };
    let (size, wraps) = (textures.diffuse_roughness.size(), material.map.wraps());
    let x = wraps.x.index((uv.x * size.width as f32).floor() as isize, size.width);
    let y = wraps.y.index((uv.y * size.height as f32).floor() as isize, size.height);
    let [r, g, b, _] = textures.diffuse_roughness.row(y)[x];
    Vec3::new(r, g, b)
}

/// The four corners, as a picture has them: upper left, upper right, lower left, lower right.
const CORNERS: [Vec2; 4] =
    [Vec2::new(-0.7, 0.7), Vec2::new(0.7, 0.7), Vec2::new(-0.7, -0.7), Vec2::new(0.7, -0.7)];

const RED: Vec3 = Vec3::new(1.0, 0.0, 0.0);
const GREEN: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const BLUE: Vec3 = Vec3::new(0.0, 0.0, 1.0);
const YELLOW: Vec3 = Vec3::new(1.0, 1.0, 0.0);

/// Colours of the four corners, full or nothing in each channel.
fn corner_colours(scene: &Scene) -> [Vec3; 4] {
    let full = |v: f32| if v > 0.3 { 1.0 } else { 0.0 };
    CORNERS.map(|at| Vec3::from_array(diffuse(scene, at).to_array().map(full)))
}

#[test]
fn textures_lie_where_the_file_says() {
    for (name, expected) in [
        // Shifted by half: the picture's corners are red, green / blue, yellow.
        ("b09_base_transform.gltf", [YELLOW, GREEN, BLUE, RED]),
        ("b11_clamp_base.gltf", [GREEN, YELLOW, RED, BLUE]),
        ("b11_mirror_base.gltf", [GREEN, YELLOW, RED, BLUE]),
        ("b12_tiny_normal.gltf", [GREEN, YELLOW, RED, BLUE]),
    ] {
        let (scene, warnings) = read(name).unwrap();
        assert_eq!(corner_colours(&scene), expected, "{name}");
        assert_eq!(warnings, [] as [&str; 0], "{name}");
    }
}

#[test]
fn colours_are_those_of_the_file() {
    let (scene, _) = read("b07_grey_base.gltf").unwrap();
    let grey = diffuse(&scene, Vec2::ZERO);
    assert!(grey.x > 0.1 && grey.x == grey.y && grey.y == grey.z, "{grey}");
    // Vertices that are all red, on a white base colour.
    let (scene, warnings) = read("b13_vertex_colours.gltf").unwrap();
    let red = diffuse(&scene, Vec2::ZERO);
    assert!(red.x > 0.3 && red.y == 0.0 && red.z == 0.0 && warnings.is_empty(), "{red} {warnings:?}");
}

#[test]
fn coordinates_of_the_transform_count() {
    // The second set shows the texel that leans on the right half alone.
    let (scene, _) = read("b10_texcoord_override.gltf").unwrap();
    let normal = |x: f32| {
        let Hit { object, uv, .. } = hit(&scene, Vec2::new(x, 0.0)).unwrap();
        let map = &scene.materials[object.material].map;
        let mut row = SurfaceRow::flat(map.size().width);
        map.read_row(0, &mut row);
        row.normal((uv.x.rem_euclid(1.0) * row.width() as f32) as usize)
    };
    // 8 bits hold a normal to 1/255.
    assert!((normal(-0.5) - Vec3::Z).length() < 0.01, "{}", normal(-0.5));
    let leaning = Vec3::new(1.0, 0.0, 1.0).normalize();
    assert!((normal(0.5) - leaning).length() < 0.01, "{}", normal(0.5));
}

#[test]
fn triangles_without_normals_are_flat() {
    let (scene, _) = read("b14_no_normals.gltf").unwrap();
    let normal = |x: f32| hit(&scene, Vec2::new(x, 0.1)).unwrap().normal;
    assert_eq!(normal(-0.6), normal(-0.3));
    assert!((normal(-0.6) - normal(0.6)).length() > 0.1);
}

#[test]
fn the_whole_square_is_there() {
    for name in [
        "b28_trailing.glb",
        "b29_latin1.obj",
        "b30_usemtl_blank.obj",
        "b31_continued.obj",
        "b32_lines.obj",
        "b33_part_colours.obj",
        "b35_part_uv.obj",
        "b37_tristrips.ply",
        "b38_blank_lines.ply",
        "b39_latin1.ply",
        "b40_strip.gltf",
        "b41_quantised.gltf",
        "b47_meshopt.gltf",
    ] {
        let (scene, _) = read(name).unwrap_or_else(|e| panic!("{e}"));
        let triangle = |object: &Object, t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| object.mesh.vertices[i as usize].position);
            (b - a).cross(c - a) / 2.0
        };
        let areas = scene.objects.iter().flat_map(|o| o.mesh.triangles.iter().map(move |t| triangle(o, t)));
        // Single precision over four corners; quantised ones hold the square exactly.
        assert!((areas.sum::<Vec3>() - 4.0 * Vec3::Z).length() < 1e-5, "{name}");
        for at in CORNERS {
            let normal = hit(&scene, at).unwrap_or_else(|| panic!("{name}: nothing at {at}")).normal;
            assert!((normal - Vec3::Z).length() < 1e-6, "{name}: {normal}");
        }
    }
}

#[test]
fn notches_stay_open() {
    for name in ["b23_concave.obj", "b23_concave.ply"] {
        let (scene, _) = read(name).unwrap();
        // The notch reaches up to 0.6 in the middle; above it is the ridge.
        assert!(hit(&scene, Vec2::new(0.03, -0.65)).is_none(), "{name}");
        assert!(hit(&scene, Vec2::new(0.0, 0.8)).is_some(), "{name}");
    }
}

#[test]
fn coordinates_of_corners_are_those_of_vertices() {
    let (corners, warnings) = read("b36_wedge_uv.ply").unwrap();
    let (vertices, _) = read("b36_vertex_uv.ply").unwrap();
    assert_eq!(warnings, [] as [&str; 0]);
    for at in CORNERS {
        let uv = |scene| hit(scene, at).unwrap().uv;
        assert!((uv(&corners) - uv(&vertices)).length() < 1e-6, "{at}");
    }
}

#[test]
fn refusals_name_their_reason_first() {
    for (name, reason) in [("b42_gltf1.gltf", "is glTF 1.0"), ("b43_draco.gltf", "requires KHR_draco")] {
        let error = read(name).err().unwrap().to_string();
        let after = error.split(": ").nth(1).unwrap();
        assert!(after.starts_with(reason), "{error}");
    }
}

#[test]
fn compressed_models_are_what_another_decoder_makes_of_them() {
    for (name, plain) in [
        ("b48_meshopt_cc.glb", "b48_meshopt_cc_plain.gltf"),
        ("b49_meshopt_khr.glb", "b49_meshopt_khr_plain.gltf"),
    ] {
        let ((scene, warnings), (expected, _)) = (read(name).unwrap(), read(plain).unwrap());
        assert_eq!(warnings, [] as [&str; 0], "{name}");
        assert_eq!((scene.objects.len(), expected.objects.len()), (1, 1), "{name}");
        let [mesh, right] = [&scene, &expected].map(|scene| &scene.objects[0].mesh);
        assert_eq!((mesh.triangles.len(), mesh.vertices.len()), (162, 100), "{name}");
        assert_eq!(mesh.triangles, right.triangles, "{name}");
        let mut most = 0.0_f32;
        for (vertex, right) in mesh.vertices.iter().zip(&right.vertices) {
            assert_eq!((vertex.position, vertex.uv), (right.position, right.uv), "{name}");
            most = most.max(vertex.normal.distance(right.normal));
        }
        println!("{name}: {most}");
        assert!(most < 1e-6, "{name}: {most}");
        for at in CORNERS {
            assert_eq!(diffuse(&scene, at), diffuse(&expected, at), "{name}");
        }
    }
}

#[test]
fn compressed_views_that_contradict_themselves_are_refused() {
    let name = "b47_meshopt.gltf";
    let refused = |change: &dyn Fn(&mut Value)| {
        let mut json: Value = serde_json::from_slice(&std::fs::read(case(name)).unwrap()).unwrap();
        change(&mut json);
        let read = model_of_bytes(&case(name), json.to_string().as_bytes(), &options());
        read.err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert_eq!(refused(&|_| ()), "");
    let set = |key: &str, value: Value| {
        refused(&|json| {
            let view = &mut json["bufferViews"][2]["extensions"]["EXT_meshopt_compression"];
            view[key] = value.clone();
        })
    };
    for (key, value, reason) in [
        ("count", json!(26), "contradicts itself"),
        ("count", json!(-1), "has a damaged compressed view"),
        ("count", json!(1_u64 << 63), "contradicts itself"),
        ("byteStride", json!(4), "contradicts itself"),
        ("buffer", json!(2), "contradicts itself"),
        ("byteLength", json!(90), "ends too early"),
        ("byteLength", json!(111), "has bytes left over"),
        ("byteOffset", json!(161), "is of another mode"),
        ("byteOffset", json!(u64::MAX), "outside its buffer"),
        ("mode", json!("TRIANGLES"), "does not allow"),
        ("mode", json!("POINTS"), "unknown variant `POINTS`"),
        ("filter", json!("WAVELET"), "unknown variant `WAVELET`"),
    ] {
        let error = set(key, value.clone());
        assert!(error.contains(reason), "{key} {value}: {error}");
    }
}

#[test]
fn views_that_share_their_bytes_decode_to_no_more_than_the_file_can_hold() {
    use base64::Engine;
    // 4096 blocks of zeros, a kilobyte each from one byte; one view is within bounds, two are not.
    let stream = [&[0xA1], [0xAA; 4096].as_slice(), &[0; 24]].concat();
    let view = |buffer: usize| {
        json!({ "buffer": buffer, "byteLength": 1 << 22, "extensions": {
            "KHR_meshopt_compression": {
                "buffer": 0, "byteLength": stream.len(), "byteStride": 4, "mode": "ATTRIBUTES", "count": 1 << 20
            }
        } })
    };
    let data = base64::engine::general_purpose::STANDARD.encode(&stream);
    for (views, reason) in [(1, "holds no triangles"), (2, "decompresses to more than")] {
        let json = json!({
            "asset": { "version": "2.0" },
            "extensionsRequired": ["KHR_meshopt_compression"],
            "buffers": [
                { "byteLength": stream.len(), "uri": format!("data:application/octet-stream;base64,{data}") },
                { "byteLength": 1 << 23 }
            ],
            "bufferViews": (0..views).map(|_| view(1)).collect::<Vec<_>>(),
        });
        let error = model_of_bytes("a.gltf".as_ref(), json.to_string().as_bytes(), &options());
        let error = error.err().unwrap().to_string();
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn damaged_compressed_models_are_errors_or_models() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    for name in ["b47_meshopt.gltf", "b48_meshopt_cc.glb", "b49_meshopt_khr.glb"] {
        let bytes = std::fs::read(case(name)).unwrap();
        let read = |bytes: &[u8]| model_of_bytes(&case(name), bytes, &options());
        for end in (0..bytes.len()).step_by(37) {
            assert!(read(&bytes[..end]).is_err(), "{name}: {end}");
        }
        // The bytes of a binary file behind its JSON, whose damage is none of the decoders'.
        let binary = bytes.windows(4).position(|four| four == b"BIN\0").map_or(0, |at| at + 4);
        let mut refused = 0;
        for _ in 0..300 {
            let mut copy = bytes.clone();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(binary..copy.len());
                copy[at] ^= 1 << random.random_range(0..8);
            }
            let error = read(&copy).err().map(|e| e.to_string()).unwrap_or_default();
            refused += usize::from(!error.is_empty());
            // That is what is said of panics.
            assert!(binary == 0 || !error.contains("in a way that"), "{name}: {error}");
        }
        println!("{name}: {refused}");
        assert!((50..300).contains(&refused), "{name}: {refused}");
    }
}
