//! Models: what comes out of sound files, and that damaged ones are refused.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use ndfmap_maps::MapError;
use ndfmap_maps::model::{ModelOptions, TABLE, model_of_bytes, read_model};
use ndfmap_scene::{MaterialMap, Scene, SceneOptions};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn options() -> ModelOptions {
    ModelOptions { staging: SceneOptions::default(), material: None }
}

fn read(name: &str, bytes: &[u8]) -> Result<(Scene, Vec<String>), MapError> {
    model_of_bytes(Path::new(name), bytes, &options())
}

/// A square of two triangles that faces +z, its map upright on it.
const OBJ: &str =
    "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty double y\nproperty float z\n\
    property float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    -1 -1 0 0 0\n1 -1 0 1 0\n1 1 0 1 1\n-1 1 0 0 1\n4 0 1 2 3\n";

/// Square of the same kind, as FBX.
const FBX: &str = r#"; FBX 7.4.0 project file
FBXHeaderExtension: { FBXHeaderVersion: 1003
 FBXVersion: 7400 }
GlobalSettings: { Version: 1000 }
Objects: {
 Geometry: 10, "Geometry::square", "Mesh" {
  Vertices: *12 { a: -1,-1,0,1,-1,0,1,1,0,-1,1,0 }
  PolygonVertexIndex: *4 { a: 0,1,2,-4 }
  GeometryVersion: 124
  LayerElementUV: 0 { Version: 101
   Name: "map"
   MappingInformationType: "ByPolygonVertex"
   ReferenceInformationType: "Direct"
   UV: *8 { a: 0,0,1,0,1,1,0,1 } }
  Layer: 0 { Version: 100
   LayerElement: { Type: "LayerElementUV"
    TypedIndex: 0 } } }
 Model: 20, "Model::square", "Mesh" { Version: 232 }
}
Connections: {
 C: "OO",20,0
 C: "OO",10,20
}
"#;

/// The same square as glTF: positions, coordinates (v down), indices, a two by one normal map and a base
/// colour.
fn gltf() -> Vec<u8> {
    let floats: [f32; 20] =
        [-1., -1., 0., 1., -1., 0., 1., 1., 0., -1., 1., 0., 0., 1., 1., 1., 1., 0., 0., 0.];
    let mut buffer: Vec<u8> = floats.iter().flat_map(|f| f.to_le_bytes()).collect();
    buffer.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let png = |pixels: &[u8]| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(pixels).unwrap();
        writer.finish().unwrap();
        bytes
    };
    let normals = png(&[128, 128, 255, 218, 128, 218]);
    let colours = png(&[255, 0, 0, 0, 0, 255]);
    let (at_normals, at_colours) = (buffer.len(), buffer.len() + normals.len());
    buffer.extend(&normals);
    buffer.extend(&colours);
    let data = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &buffer);
    serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": [0.0, 0.0, 5.0] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] }],
        "materials": [{
            "normalTexture": { "index": 0, "scale": 0.5 },
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 }, "metallicFactor": 0.25, "roughnessFactor": 0.6 },
        }],
        "textures": [{ "source": 0 }, { "source": 1 }],
        "images": [{ "bufferView": 2, "mimeType": "image/png" }, { "bufferView": 3, "mimeType": "image/png" }],
        "buffers": [{ "byteLength": buffer.len(), "uri": format!("data:application/octet-stream;base64,{data}") }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 80 },
            { "buffer": 0, "byteOffset": 80, "byteLength": 12 },
            { "buffer": 0, "byteOffset": at_normals, "byteLength": normals.len() },
            { "buffer": 0, "byteOffset": at_colours, "byteLength": colours.len() },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0] },
            { "bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC2" },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
    })
    .to_string()
    .into_bytes()
}

#[test]
fn one_square_comes_out_of_every_format() {
    let files = [
        ("a.obj", OBJ.as_bytes()),
        ("a.fbx", FBX.as_bytes()),
        ("a.ply", PLY.as_bytes()),
        ("a.gltf", &gltf()),
    ];
    for (name, bytes) in files {
        let (scene, warnings) = read(name, bytes).unwrap();
        assert_eq!(warnings, [] as [&str; 0], "{name}");
        let mesh = &scene.objects[0].mesh;
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 2), "{name}");
        for v in &mesh.vertices {
            // x to the right, y up, v down: the frame is that of the world.
            assert!((v.normal - Vec3::Z).length() < 1e-6, "{name}");
            assert!(
                (v.tangent.truncate() - Vec3::X).length() < 1e-6 && v.tangent.w == 1.0,
                "{name} {}",
                v.tangent
            );
            let expected = Vec2::new(v.position.x + 1.0, 1.0 - v.position.y) / 2.0;
            assert!((v.uv - expected).length() < 1e-6, "{name}");
        }
        let middle = DVec3::new(0.0, 0.0, if name == "a.gltf" { 5.0 } else { 0.0 });
        assert!((scene.camera.target - middle).length() < 1e-6, "{name}");
    }
}

#[test]
fn gltf_materials_are_read() {
    let (scene, _) = read("a.gltf", &gltf()).unwrap();
    let material = &scene.materials[scene.objects[0].material];
    let mut row = ndfmap_core::surface::SurfaceRow::flat(2);
    material.map.read_row(0, &mut row);
    // 218 is 0.71: a normal at 45 degrees, whose x is then halved by the texture's scale. 8 bits: 1/255.
    let expected = Vec3::new(0.5, 0.0, 1.0).normalize();
    assert!((row.normal(0) - Vec3::Z).length() < 0.01 && (row.normal(1) - expected).length() < 0.01);
    let map = material.textures.as_ref().unwrap();
    // glTF 2.0, appendix B: alpha = roughness²; slopes of variance alpha²/2.
    let roughness = 0.6_f32.powi(4) / 2.0;
    let close = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(close(map.diffuse_roughness.row(0)[0], [0.75, 0.0, 0.0, roughness]));
    assert!(close(map.diffuse_roughness.row(0)[1], [0.0, 0.0, 0.75, roughness]));
    assert!(close(map.specular.as_ref().unwrap().row(0)[0], [0.03 + 0.25, 0.03, 0.03, 1.0]));
}

#[test]
fn what_a_mesh_lacks_is_made() {
    let ball = "v 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\nv 0 -1 0\nv 0 0 -1\n\
        f 1 2 3\nf 1 3 4\nf 1 4 5\nf 1 5 2\nf 6 3 2\nf 6 4 3\nf 6 5 4\nf 6 2 5\n";
    let (scene, warnings) = read("ball.obj", ball.as_bytes()).unwrap();
    assert!(warnings[0].contains("no map coordinates"), "{warnings:?}");
    for v in &scene.objects[0].mesh.vertices {
        assert!((v.normal - v.position).length() < 1e-5, "{} {}", v.normal, v.position);
        assert!(v.tangent.truncate().dot(v.normal).abs() < 1e-5);
    }
}

#[test]
fn errors_name_the_file_and_what_is_wrong() {
    let mut far = PLY.replace("element vertex 4", "element vertex 4000000000");
    let cases: [(&str, Vec<u8>, &str); 8] = [
        ("a.obj", Vec::new(), "no triangles"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n".to_vec(), "a.obj"),
        ("a.obj", b"v 0 0 0\nv nan 0 0\nv 1 0 0\nf 1 2 3\n".to_vec(), "no places"),
        ("a.ply", far.split_off(0).into_bytes(), "more elements than the file can hold"),
        ("a.ply", PLY.replace("4 0 1 2 3", "4 0 1 2 9").into_bytes(), "vertex that is not there"),
        ("a.glb", b"glTF".to_vec(), "a.glb"),
        (
            "a.gltf",
            String::from_utf8(gltf()).unwrap().replace("\"count\":4", "\"count\":400000000").into_bytes(),
            "more vertices than",
        ),
        ("a.stl", Vec::new(), "is no model"),
    ];
    for (name, bytes, reason) in cases {
        let error = read(name, &bytes).err().unwrap().to_string();
        assert!(error.starts_with(name) && error.contains(reason), "{error}");
    }
    let error = read_model(Path::new("no-such.glb"), &options()).err().unwrap().to_string();
    assert!(error.starts_with("no-such.glb"), "{error}");
    let named = String::from_utf8(gltf())
        .unwrap()
        .replace("data:application/octet-stream;base64,", "gone%20away.bin?");
    assert!(read("a.gltf", named.as_bytes()).err().unwrap().to_string().contains("gone away.bin"));
}

#[test]
fn damaged_models_are_errors_or_models() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let sound = [
        ("a.obj", OBJ.as_bytes().to_vec()),
        ("a.fbx", FBX.as_bytes().to_vec()),
        ("a.ply", PLY.as_bytes().to_vec()),
        ("a.gltf", gltf()),
    ];
    assert!(TABLE.len() == sound.len());
    let mut refused = 0;
    for (name, bytes) in &sound {
        for end in (0..bytes.len()).step_by(bytes.len() / 100 + 1) {
            refused += usize::from(read(name, &bytes[..end]).is_err());
        }
        for _ in 0..400 {
            let mut copy = bytes.clone();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(0..copy.len());
                copy[at] ^= 1 << random.random_range(0..8);
            }
            refused += usize::from(read(name, &copy).is_err());
        }
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn gltf_that_would_never_end_is_refused() {
    let text = String::from_utf8(gltf()).unwrap();
    // Nodes that each have the next one twice: 2^40 ways through a file of forty.
    let node = |i: usize| serde_json::json!({ "children": [i + 1, i + 1] });
    let mut nodes: Vec<serde_json::Value> = (0..40).map(node).collect();
    nodes.push(serde_json::json!({ "mesh": 0 }));
    let mut document: serde_json::Value = serde_json::from_str(&text).unwrap();
    document["nodes"] = nodes.into();
    let error = read("a.gltf", document.to_string().as_bytes()).err().unwrap().to_string();
    assert!(error.contains("two places"), "{error}");
    for uri in ["/dev/zero", "file:/dev/zero", "https://example.org/a.bin"] {
        let mut document: serde_json::Value = serde_json::from_str(&text).unwrap();
        document["buffers"][0]["uri"] = uri.into();
        let error = read("a.gltf", document.to_string().as_bytes()).err().unwrap().to_string();
        assert!(error.contains("not a file beside it"), "{error}");
    }
}

#[test]
fn a_map_of_ones_own_leaves_the_mean_colour() {
    let map = ndfmap_core::procedural::find("foil").unwrap().build;
    let map = map(ndfmap_core::grid::Size::new(4, 4).unwrap());
    let staging = SceneOptions { map: Some(MaterialMap::Surface(map.into())), ..SceneOptions::default() };
    let (scene, warnings) =
        model_of_bytes(Path::new("a.gltf"), &gltf(), &ModelOptions { staging, material: None }).unwrap();
    assert!(warnings[0].contains("left out"), "{warnings:?}");
    let params = scene.materials[0].params;
    // Half red, half blue, of metalness 0.25.
    assert!((params.diffuse - DVec3::new(0.375, 0.0, 0.375)).length() < 1e-5, "{params:?}");
}

/// The square of [`gltf`] with its JSON changed.
fn changed(change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let mut json: serde_json::Value = serde_json::from_slice(&gltf()).unwrap();
    change(&mut json);
    json.to_string().into_bytes()
}

#[test]
fn strips_and_fans_are_the_same_square() {
    let (list, _) = read("a.gltf", &gltf()).unwrap();
    let corners = |scene: &ndfmap_scene::Scene| {
        let mesh = &scene.objects[0].mesh;
        let place = |i: u32| mesh.vertices[i as usize].position;
        let area = |t: &[u32; 3]| (place(t[1]) - place(t[0])).cross(place(t[2]) - place(t[0])) / 2.0;
        mesh.triangles.iter().map(area).sum::<Vec3>()
    };
    // Indices as little-endian words: a strip in zigzag, and a fan round the first corner.
    for (mode, indices) in [(5, [0_u16, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let bytes = changed(|json| {
            use base64::Engine;
            use base64::engine::general_purpose::STANDARD;
            let data: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
            let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&data));
            let length = serde_json::json!({ "byteLength": 8, "uri": uri });
            json["buffers"].as_array_mut().unwrap().push(length);
            let view = serde_json::json!({ "buffer": 1, "byteLength": 8 });
            let at = json["bufferViews"].as_array().unwrap().len();
            json["bufferViews"].as_array_mut().unwrap().push(view);
            json["accessors"][2]["bufferView"] = at.into();
            json["accessors"][2]["count"] = 4.into();
            json["meshes"][0]["primitives"][0]["mode"] = mode.into();
        });
        let (scene, warnings) = read("a.gltf", &bytes).unwrap();
        assert_eq!(warnings, [] as [&str; 0], "{mode}");
        assert_eq!(scene.objects[0].mesh.triangles.len(), 2, "{mode}");
        assert!((corners(&scene) - corners(&list)).length() < 1e-6, "{mode}: {}", corners(&scene));
    }
}

#[test]
fn what_is_not_read_is_refused_by_its_name() {
    let required = |name: &str| changed(|json| json["extensionsRequired"] = serde_json::json!([name]));
    let version = changed(|json| json["asset"]["version"] = "1.0".into());
    let binary = [b"glTF".as_slice(), &1_u32.to_le_bytes(), &[0; 12]].concat();
    for (bytes, reason) in [
        (required("KHR_draco_mesh_compression"), "requires KHR_draco_mesh_compression"),
        (required("KHR_materials_pbrSpecularGlossiness"), "requires KHR_materials_pbrSpecularGlossiness"),
        (version, "glTF 1.0"),
        (binary, "glTF 1.0"),
    ] {
        let error = read("a.gltf", &bytes).err().unwrap().to_string();
        assert!(error.starts_with("a.gltf: ") && error.contains(reason), "{error}");
    }
}

#[test]
fn a_grey_picture_is_grey_in_every_colour() {
    // The base colour is put where the normal map's picture is, and a grey PNG in its place.
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 1, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[128]).unwrap();
    let bytes = changed(|json| {
        use base64::Engine;
        let data = base64::engine::general_purpose::STANDARD.encode(&png);
        json["images"][1] = serde_json::json!({ "uri": format!("data:image/png;base64,{data}") });
    });
    let (scene, _) = read("a.gltf", &bytes).unwrap();
    let map = scene.materials[scene.objects[0].material].textures.as_ref().unwrap();
    let [r, g, b, _] = map.diffuse_roughness.row(0)[0];
    // sRGB 128 is 0.2159 of linear light; three quarters of it is diffuse.
    assert!((r - 0.75 * 0.2159).abs() < 1e-4 && r == g && g == b, "{r} {g} {b}");
}

#[test]
fn colours_without_a_normal_map_lie_by_their_own_transform() {
    let (plain, _) = read("a.gltf", &gltf()).unwrap();
    let bytes = changed(|json| {
        let material = &mut json["materials"][0];
        material.as_object_mut().unwrap().remove("normalTexture");
        let transform =
            serde_json::json!({ "KHR_texture_transform": { "offset": [0.5, 0.25], "scale": [2, 1] } });
        material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = transform;
        json["samplers"] = serde_json::json!([{ "wrapS": 33071, "wrapT": 33071 }]);
        json["textures"][1]["sampler"] = 0.into();
        json["extensionsUsed"] = serde_json::json!(["KHR_texture_transform"]);
    });
    let (moved, warnings) = read("a.gltf", &bytes).unwrap();
    assert_eq!(warnings, [] as [&str; 0]);
    for (a, b) in plain.objects[0].mesh.vertices.iter().zip(&moved.objects[0].mesh.vertices) {
        assert!(
            (a.uv * Vec2::new(2.0, 1.0) + Vec2::new(0.5, 0.25) - b.uv).length() < 1e-6,
            "{} {}",
            a.uv,
            b.uv
        );
    }
    let MaterialMap::Surface(surface) = &moved.materials[0].map else { panic!("a surface") };
    assert_eq!(surface.wraps().x, ndfmap_core::surface::Wrap::Clamp);
}

/// The square of [`gltf`] with transforms of its normal map and of its colours.
fn transformed(normals: &serde_json::Value, colours: &serde_json::Value) -> Vec<u8> {
    changed(|json| {
        let material = &mut json["materials"][0];
        material["normalTexture"]["extensions"] = serde_json::json!({ "KHR_texture_transform": normals });
        material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
            serde_json::json!({ "KHR_texture_transform": colours });
        json["extensionsUsed"] = serde_json::json!(["KHR_texture_transform"]);
    })
}

#[test]
fn textures_lie_each_by_its_own_transform() {
    use serde_json::json;
    let none = json!({});
    // Transforms of normals and colours; width and height of the map; the map's scale on the mesh; red of its
    // first row, x of its first row's normals: 0 where flat, 1 where steep.
    let cases: [(_, _, _, _, &[u8], &[u8]); 6] = [
        (none.clone(), none.clone(), (2, 1), 1.0, &[1, 0], &[0, 1]),
        // Colours that repeat more often are averaged over the texels of the normal map.
        (none.clone(), json!({ "offset": [0.5, 0.0] }), (2, 1), 1.0, &[0, 1], &[0, 1]),
        // Normals that repeat more often: the map is the colours', with the normals side by side.
        (json!({ "scale": [2, 2] }), none.clone(), (4, 2), 1.0, &[1, 1, 0, 0], &[0, 1, 0, 1]),
        // Neither is a whole multiple of the other, both are of the plain coordinates.
        (
            json!({ "scale": [3, 1] }),
            json!({ "scale": [2, 1] }),
            (6, 1),
            1.0,
            &[1, 2, 0, 1, 2, 0],
            &[0, 1, 0, 1, 0, 1],
        ),
        // 3 to 2 without a common coordinate: two repetitions of the colours, three of the normals.
        (json!({ "scale": [1.5, 1] }), none.clone(), (6, 2), 0.5, &[1, 2, 0, 1, 2, 0], &[0, 1, 0, 1, 0, 1]),
        // A texture that lies twice as wide as the coordinates are: both go by its own.
        (json!({ "scale": [0.5, 1] }), none, (2, 1), 0.5, &[2, 2], &[0, 1]),
    ];
    for (normals, colours, (width, height), scale, red, steep) in cases {
        let (scene, warnings) = read("a.gltf", &transformed(&normals, &colours)).unwrap();
        let said = format!("{normals} {colours} {warnings:?}");
        assert!(warnings.iter().all(|w| !w.contains("go on together")), "{said}");
        let (plain, _) = read("a.gltf", &gltf()).unwrap();
        for (a, b) in plain.objects[0].mesh.vertices.iter().zip(&scene.objects[0].mesh.vertices) {
            assert!((a.uv.x * scale - b.uv.x).abs() < 1e-6, "{said}: {} {}", a.uv, b.uv);
        }
        let material = &scene.materials[scene.objects[0].material];
        assert_eq!((material.map.size().width, material.map.size().height), (width, height), "{said}");
        let mut row = ndfmap_core::surface::SurfaceRow::flat(width);
        material.map.read_row(0, &mut row);
        let found: Vec<u8> = (0..width).map(|x| u8::from(row.normal(x).x > 0.1)).collect();
        assert_eq!(found, steep, "{said}");
        // Half of the red, 0.375 of a diffuse 0.75, counts as 2.
        let texels = material.textures.as_ref().unwrap().diffuse_roughness.row(0);
        let found: Vec<u8> = texels.iter().map(|t| [0, 2, 1][(t[0] / 0.375).round() as usize]).collect();
        assert_eq!(found, red, "{said}");
    }
}

#[test]
fn textures_of_an_obj_lie_by_their_scale_and_offset() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("n.png", &two_texels(&[128, 128, 255, 218, 128, 218]));
    write("c.png", &two_texels(&[255, 0, 0, 0, 0, 255]));
    write("a.obj", format!("mtllib a.mtl\nusemtl first\n{OBJ}").as_bytes());
    for (laid, uv) in [
        ("", Vec2::new(1.0, 0.0)),
        ("-s 2 3 1 -o 0.25 0 0 ", Vec2::new(2.25, -2.0)),
        ("-s 2 ", Vec2::new(2.0, 0.0)),
        ("-o 0.5 0.25 ", Vec2::new(1.5, -0.25)),
    ] {
        write("a.mtl", format!("newmtl first\nPm 0\nmap_Kd {laid}c.png\n").as_bytes());
        let (scene, warnings) = read_model(&folder.path().join("a.obj"), &options()).unwrap();
        assert_eq!(warnings, [] as [&str; 0], "{laid}");
        // The corner at the upper right, of coordinates (1, 0) with v down.
        let corner = scene.objects[0].mesh.vertices.iter().find(|v| v.position.x > 0.0 && v.position.y > 0.0);
        assert!((corner.unwrap().uv - uv).length() < 1e-6, "{laid}: {}", corner.unwrap().uv);
    }
    // Normals that repeat twice beside colours that do not; clamped colours do not go on with them.
    for (clamp, width, said) in [("", 4, 0), ("-clamp on ", 2, 1)] {
        let text = format!("newmtl first\nPm 0\nmap_Kd {clamp}c.png\nmap_Bump -s 2 1 1 n.png\n");
        write("a.mtl", text.as_bytes());
        let (scene, warnings) = read_model(&folder.path().join("a.obj"), &options()).unwrap();
        let material = &scene.materials[scene.objects[0].material];
        assert_eq!((material.map.size().width, warnings.len()), (width, said), "{warnings:?}");
    }
}

#[test]
fn what_is_laid_on_otherwise_or_left_out_is_said() {
    let warned = |change: fn(&mut serde_json::Value), reason: &str| {
        let (_, warnings) = read("a.gltf", &changed(change)).unwrap();
        assert!(warnings.iter().any(|w| w.contains(reason)), "{reason}: {warnings:?}");
    };
    let other = |json: &mut serde_json::Value| {
        let extension = serde_json::json!({ "KHR_texture_transform": { "scale": [2.57, 1] } });
        json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = extension;
    };
    warned(other, "do not go on together");
    let coloured = |json: &mut serde_json::Value| {
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 0.into();
    };
    warned(coloured, "colours that vary");
}

/// A PNG of two texels.
fn two_texels(pixels: &[u8; 6]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(pixels).unwrap();
    bytes
}

#[test]
fn materials_of_an_obj_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let read = |mtl: &str| {
        write("a.mtl", mtl.as_bytes());
        write("a.obj", format!("mtllib a.mtl\nusemtl first\n{OBJ}").as_bytes());
        read_model(&folder.path().join("a.obj"), &options()).unwrap()
    };
    // Numbers: base colour, roughness, metalness.
    let (scene, warnings) = read("newmtl first\nKd 0.5 0.25 0\nPr 0.6\nPm 0.25\n");
    assert_eq!(warnings, [] as [&str; 0]);
    let material = &scene.materials[scene.objects[0].material];
    assert_eq!(material.name, "first");
    assert!((material.params.diffuse - 0.75 * DVec3::new(0.5, 0.25, 0.0)).length() < 1e-6);
    assert!((material.params.specular.x - (0.03 + 0.125)).abs() < 1e-6, "{}", material.params.specular);
    // Textures, as Blender writes them: a normal map in the place of the bumps, in a folder of its own.
    std::fs::create_dir(folder.path().join("textures")).unwrap();
    write("textures/n.png", &two_texels(&[128, 128, 255, 218, 128, 218]));
    write("c.png", &two_texels(&[255, 0, 0, 0, 0, 255]));
    let (scene, warnings) = read(
        "newmtl first\nKd 0.1 0.1 0.1\nPm 0\nmap_Kd C:\\work\\c.png\nmap_Bump -bm 1.0 n.png\nmap_Pr gone.png\n",
    );
    assert_eq!(warnings, ["names the texture `gone.png`, which is not there: it is left out"]);
    let material = &scene.materials[scene.objects[0].material];
    let diffuse = &material.textures.as_ref().unwrap().diffuse_roughness;
    assert_eq!(diffuse.row(0)[0][..3], [1.0, 0.0, 0.0]);
    assert_eq!(diffuse.row(0)[1][..3], [0.0, 0.0, 1.0]);
    let mut row = ndfmap_core::surface::SurfaceRow::flat(2);
    material.map.read_row(0, &mut row);
    // 218 is 0.71: a normal at 45 degrees, to 8 bits.
    assert!((row.normal(1) - Vec3::new(1.0, 0.0, 1.0).normalize()).length() < 0.01, "{}", row.normal(1));
    // Without its library, a material is plain.
    write("a.obj", format!("mtllib gone.mtl\nusemtl first\n{OBJ}").as_bytes());
    let (_, warnings) = read_model(&folder.path().join("a.obj"), &options()).unwrap();
    assert_eq!(warnings, ["names the materials of `gone.mtl`, which is not there: they are plain"]);
}

#[test]
fn an_fbx_is_turned_upright_and_posed() {
    // z up in the file, and the square's node moved along it.
    let settings = "GlobalSettings: { Version: 1000\n Properties70: {\n  P: \"UpAxis\", \"int\", \"Integer\", \"\",2\n\
        \x20 P: \"UpAxisSign\", \"int\", \"Integer\", \"\",1\n  P: \"FrontAxis\", \"int\", \"Integer\", \"\",1\n\
        \x20 P: \"FrontAxisSign\", \"int\", \"Integer\", \"\",-1\n  P: \"CoordAxis\", \"int\", \"Integer\", \"\",0\n\
        \x20 P: \"CoordAxisSign\", \"int\", \"Integer\", \"\",1\n } }";
    let moved = "\"Mesh\" { Version: 232\n Properties70: {\n  P: \"Lcl Translation\", \"Lcl Translation\", \"\", \"A\",0,0,3\n } }";
    let file = FBX
        .replace("GlobalSettings: { Version: 1000 }", settings)
        .replace("\"Mesh\" { Version: 232 }", moved);
    let (scene, _) = read("a.fbx", file.as_bytes()).unwrap();
    for v in &scene.objects[0].mesh.vertices {
        assert!((v.normal - Vec3::Y).length() < 1e-6, "{}", v.normal);
        assert!((v.position.y - 3.0).abs() < 1e-6, "{}", v.position);
    }
}

#[test]
fn files_are_read_as_exporters_write_them() {
    // Corners without a normal beside corners that have one: they get that of their triangle.
    let partial = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n";
    let (scene, _) = read("a.obj", partial.as_bytes()).unwrap();
    let normals: Vec<Vec3> = scene.objects[0].mesh.vertices.iter().map(|v| v.normal).collect();
    assert!(normals.contains(&Vec3::Z) && normals.contains(&Vec3::X), "{normals:?}");
    // UTF-16 behind its mark, either way round.
    for big in [false, true] {
        let units = OBJ.encode_utf16().map(|u| if big { u.to_be_bytes() } else { u.to_le_bytes() });
        let mark = if big { [0xfe, 0xff] } else { [0xff, 0xfe] };
        let bytes: Vec<u8> = std::iter::once(mark).chain(units).flatten().collect();
        assert_eq!(read("a.obj", &bytes).unwrap().0.objects[0].mesh.triangles.len(), 2);
    }
    // Lines that end with a carriage return alone, and blanks where they please.
    for text in [PLY.replace('\n', "\r"), PLY.replace('\n', "\r\n"), PLY.replace("element ", "  element\t")] {
        assert_eq!(read("a.ply", text.as_bytes()).unwrap().0.objects[0].mesh.triangles.len(), 2, "{text:?}");
    }
    // Attributes of applications.
    let own = changed(|json| json["meshes"][0]["primitives"][0]["attributes"]["_FEATURE_ID_0"] = 0.into());
    assert!(read("a.gltf", &own).is_ok());
    // One colour of all vertices, without a material: linear, dielectric.
    let magenta = changed(|json| {
        let primitive = &mut json["meshes"][0]["primitives"][0];
        primitive.as_object_mut().unwrap().remove("material");
        primitive["attributes"]["COLOR_0"] = 3.into();
        let colours: Vec<u8> = [1_f32, 0.0, 1.0].repeat(4).iter().flat_map(|c| c.to_le_bytes()).collect();
        let data = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, colours);
        let uri = format!("data:application/octet-stream;base64,{data}");
        let buffers = json["buffers"].as_array_mut().unwrap();
        buffers.push(serde_json::json!({ "byteLength": 48, "uri": uri }));
        let views = json["bufferViews"].as_array_mut().unwrap();
        views.push(serde_json::json!({ "buffer": 1, "byteLength": 48 }));
        let accessors = json["accessors"].as_array_mut().unwrap();
        accessors
            .push(serde_json::json!({ "componentType": 5126, "count": 4, "type": "VEC3", "bufferView": 4 }));
    });
    let (scene, _) = read("a.gltf", &magenta).unwrap();
    assert_eq!(scene.materials[scene.objects[0].material].params.diffuse, DVec3::new(1.0, 0.0, 1.0));
    // A material library that its reader refuses.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.mtl"), "newmtl\nKd 1 0 0\n").unwrap();
    std::fs::write(folder.path().join("a.obj"), format!("mtllib a.mtl\nusemtl x\n{OBJ}")).unwrap();
    let (_, warnings) = read_model(&folder.path().join("a.obj"), &options()).unwrap();
    assert!(warnings[0].contains("materials that are damaged"), "{warnings:?}");
}
