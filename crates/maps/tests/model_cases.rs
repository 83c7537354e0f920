//! Models as people have them: sound files that went wrong once come out right (`tests/cases/README.md`).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use ndfmap_core::surface::SurfaceRow;
use ndfmap_maps::MapError;
use ndfmap_maps::model::{ModelOptions, read_model};
use ndfmap_scene::{Object, Scene, SceneOptions};

fn read(name: &str) -> Result<(Scene, Vec<String>), MapError> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name);
    read_model(&path, &ModelOptions { staging: SceneOptions::default(), material: None })
}

/// The object under a place of the square from -1 to 1, its map coordinates and its normal there.
struct Hit<'a> {
    object: &'a Object,
    uv: Vec2,
    normal: Vec3,
}

/// What lies under (x, y), seen along z.
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
