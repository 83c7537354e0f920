//! glTF assets with exchanged textures: what changes, and that nothing else does.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::Path;

use ndfmap_core::grid::Size;
use ndfmap_maps::asset::{Asset, Form, Layer, MaterialPair, Reason, Replacement, Slot};
use ndfmap_maps::formats::png;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

/// PNG of one texel.
fn texel(rgb: [u8; 3]) -> Vec<u8> {
    png::encode(&[rgb], Size { width: 1, height: 1 }).unwrap()
}

/// Binary form of a document with a chunk that nobody knows, and bytes after its end.
fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    for (kind, bytes, filler) in [(b"JSON", json.as_bytes(), b' '), (b"BIN\0", bin, 0), (b"ODD!", b"odd", 0)]
    {
        let length = bytes.len().next_multiple_of(4);
        body.extend((length as u32).to_le_bytes());
        body.extend(kind);
        body.extend_from_slice(bytes);
        body.resize(body.len() + length - bytes.len(), filler);
    }
    let length = body.len() as u32 + 12;
    [b"glTF", &2_u32.to_le_bytes()[..], &length.to_le_bytes(), &body, b"tail"].concat()
}

/// JSON, binary chunk and the rest of a binary file.
fn parts(bytes: &[u8]) -> (String, Vec<u8>, Vec<u8>) {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let json = 20..20 + word(12);
    let bin = json.end + 8..json.end + 8 + word(json.end);
    let text = String::from_utf8(bytes[json].to_vec()).unwrap();
    (text, bytes[bin.clone()].to_vec(), bytes[bin.end..].to_vec())
}

/// Document with two textures in its binary chunk: normals, and roughness with occlusion. Its numbers, keys
/// and white space are odd on purpose.
fn odd() -> (String, Vec<u8>) {
    let (normal, orm) = (texel([128, 128, 255]), texel([200, 100, 255]));
    let start = normal.len().next_multiple_of(4);
    let mut bin = normal.clone();
    bin.resize(start, 0);
    bin.extend_from_slice(&orm);
    let text = format!(
        "{{ \"asset\":{{\"version\":\"2.0\"}},\n \"extras\":{{\"z\":1.10,\"a\":1e-7,\"big\":123456789012345678901}},\
         \"extensionsUsed\":[\"KHR_lights_punctual\"],\"extensions\":{{\"KHR_lights_punctual\":{{\"lights\":[]}}}},\
         \"buffers\":[{{\"byteLength\":{}}}],\
         \"bufferViews\":[{{\"buffer\":0,\"byteLength\":{}}},{{\"buffer\":0,\"byteOffset\":{start},\"byteLength\":{}}}],\
         \"images\":[{{\"mimeType\":\"image/png\",\"bufferView\":0}},{{\"mimeType\":\"image/png\",\"bufferView\":1}}],\
         \"samplers\":[{{\"wrapS\":33071}},{{\"wrapS\":33071}}],\
         \"textures\":[{{\"source\":0,\"sampler\":0}},{{\"source\":1,\"sampler\":1,\"name\":\"orm\"}}],\
         \"materials\":[{{\"name\":\"m\",\"normalTexture\":{{\"index\":0,\"scale\":0.50}},\
         \"occlusionTexture\":{{\"index\":1,\"strength\":0.7}},\"pbrMetallicRoughness\":\
         {{\"roughnessFactor\":0.80,\"metallicRoughnessTexture\":{{\"index\":1}}}}}}] }}",
        bin.len(),
        normal.len(),
        orm.len()
    );
    (text, bin)
}

fn replacement(asset: &Asset, slot: Slot, fallback: Option<Vec<u8>>) -> Replacement {
    let layers = asset
        .layers()
        .into_iter()
        .filter_map(|layer| Some(MaterialPair { material: layer.material, pair: layer.pair.ok()? }));
    Replacement { slot, layers: layers.collect(), name: "m r".to_owned(), ktx2: b"ktx2!".to_vec(), fallback }
}

fn document(asset: &Asset, replacements: &[Replacement], form: Form, out: &str) -> Vec<u8> {
    asset.edited(replacements, form, Path::new(out)).unwrap().files.pop().unwrap().bytes
}

#[test]
fn what_is_not_exchanged_keeps_its_bytes() {
    let (text, bin) = odd();
    let bytes = glb(&text, &bin);
    let asset = Asset::from_bytes("odd.glb".as_ref(), &bytes).unwrap();
    assert_eq!(document(&asset, &[], Form::Web, "out.glb"), bytes, "nothing to do is done");
    let new =
        document(&asset, &[replacement(&asset, Slot::Roughness, Some(b"png!".to_vec()))], Form::Web, "o.glb");
    let (json, new_bin, rest) = parts(&new);
    assert_eq!(rest, [&3_u32.next_multiple_of(4).to_le_bytes()[..], b"ODD!odd\0tail"].concat());
    assert_eq!(new_bin[..bin.len()], bin, "the old chunk is the beginning of the new one");
    for kept in [
        "{ \"asset\":{\"version\":\"2.0\"},\n \"extras\":{\"z\":1.10,\"a\":1e-7,\"big\":123456789012345678901},",
        "\"normalTexture\":{\"index\":0,\"scale\":0.50}",
        "\"strength\":0.7",
    ] {
        assert!(json.contains(kept), "{kept} in {json}");
    }
    let value: Value = serde_json::from_str(&json).unwrap();
    // It is the only user of its texture, and moves with it.
    assert_eq!(value["textures"].as_array().unwrap().len(), 2);
    assert_eq!(
        value["textures"][1],
        json!({ "source": 3, "sampler": 1, "name": "orm", "extensions": { "KHR_texture_basisu": { "source": 2 } } })
    );
    assert_eq!(value["extensionsUsed"], json!(["KHR_lights_punctual", "KHR_texture_basisu"]));
    assert_eq!(value["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"], json!(1));
    let view = &value["bufferViews"][2];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    assert_eq!((start % 16, &new_bin[start..start + 5]), (0, &b"ktx2!"[..]));
    assert!(value["buffers"][0]["byteLength"].as_u64().unwrap() as usize <= new_bin.len());
    // The new file can be read and changed again.
    let again = Asset::from_bytes("again.glb".as_ref(), &new).unwrap();
    assert_eq!(again.layers()[0].pair.as_ref().unwrap().factor, 1.0);
}

#[test]
fn textures_that_others_use_are_left_to_them() {
    let (text, bin) = odd();
    let mut value: Value = serde_json::from_str(&text).unwrap();
    // A second material has the roughness under other normals; an extension that nobody knows may point
    // anywhere.
    let mut second = value["materials"][0].clone();
    second["normalTexture"]["scale"] = json!(2);
    value["materials"].as_array_mut().unwrap().push(second);
    let bytes = glb(&value.to_string(), &bin);
    let asset = Asset::from_bytes("two.glb".as_ref(), &bytes).unwrap();
    let mut only = replacement(&asset, Slot::Roughness, None);
    only.layers.truncate(1);
    let one = parts(&document(&asset, &[only], Form::Web, "o.glb")).0;
    let one: Value = serde_json::from_str(&one).unwrap();
    let texture =
        |material: usize| &one["materials"][material]["pbrMetallicRoughness"]["metallicRoughnessTexture"];
    assert_eq!((texture(0), texture(1)), (&json!({ "index": 2 }), &json!({ "index": 1 })));
    // Occlusion in red moves with it.
    assert_eq!(one["materials"][0]["occlusionTexture"], json!({ "index": 2, "strength": 0.7 }));
    assert_eq!(one["textures"][1], value["textures"][1]);
    assert_eq!(one["textures"][2]["source"], json!(1), "the old picture is what others show");
    // Under an extension that nobody knows, too.
    let (text, bin) = odd();
    let unknown = text.replace("\"KHR_lights_punctual\"]", "\"VENDOR_thing\"]");
    let asset = Asset::from_bytes("v.glb".as_ref(), &glb(&unknown, &bin)).unwrap();
    let json = parts(&document(&asset, &[replacement(&asset, Slot::Roughness, None)], Form::Web, "o.glb")).0;
    assert_eq!(serde_json::from_str::<Value>(&json).unwrap()["textures"].as_array().unwrap().len(), 3);
}

#[test]
fn bevy_finds_ktx2_where_png_stands() {
    let (text, bin) = odd();
    let asset = Asset::from_bytes("odd.glb".as_ref(), &glb(&text, &bin)).unwrap();
    let both = [replacement(&asset, Slot::Roughness, None), replacement(&asset, Slot::Normals, None)];
    let json = parts(&document(&asset, &both, Form::Bevy, "o.glb")).0;
    let value: Value = serde_json::from_str(&json).unwrap();
    assert!(!json.contains("basisu"));
    for (texture, image) in [(0, 3), (1, 2)] {
        assert_eq!(value["textures"][texture]["source"], json!(image));
        assert_eq!(value["images"][image]["mimeType"], json!("image/ktx2"));
    }
}

#[test]
fn a_roughness_without_a_texture_lies_as_its_normal_map_lies() {
    let value = json!({
        "asset": { "version": "2.0" },
        "images": [{ "uri": "n.png" }], "textures": [{ "source": 0, "sampler": 0 }], "samplers": [{}],
        "materials": [{
            "normalTexture": { "index": 0, "texCoord": 1,
                "extensions": { "KHR_texture_transform": { "scale": [2, 3] } } },
            "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1,
                "clearcoatRoughnessFactor": 0.25, "clearcoatNormalTexture": { "index": 0 } } },
        }],
    });
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("n.png"), texel([128, 128, 255])).unwrap();
    let path = folder.path().join("m.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    let asset = Asset::read(&path).unwrap();
    let layers = asset.layers();
    assert_eq!((layers[0].layer, layers[1].layer), (Layer::Base, Layer::Clearcoat));
    let factors: Vec<f32> = layers.iter().map(|layer| layer.pair.as_ref().unwrap().factor).collect();
    assert_eq!(factors, [1.0, 0.25]);
    let replacements: Vec<Replacement> = layers
        .iter()
        .map(|layer| Replacement {
            layers: vec![MaterialPair { material: 0, pair: layer.pair.clone().unwrap() }],
            name: layer.layer.to_string(),
            ..replacement(&asset, Slot::Roughness, None)
        })
        .collect();
    // Into another folder: what the document names goes along, and the new pictures are files too.
    let out = folder.path().join("other").join("out.gltf");
    let edited = asset.edited(&replacements, Form::Web, &out).unwrap();
    let names: Vec<String> = edited
        .files
        .iter()
        .map(|file| file.path.strip_prefix(folder.path()).unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(names, ["other/n.png", "other/out-base.ktx2", "other/out-clearcoat.ktx2", "other/out.gltf"]);
    let value: Value = serde_json::from_slice(&edited.files[3].bytes).unwrap();
    let material = &value["materials"][0];
    assert_eq!(
        material["pbrMetallicRoughness"]["metallicRoughnessTexture"],
        json!({ "index": 1, "texCoord": 1, "extensions": { "KHR_texture_transform": { "scale": [2, 3] } } })
    );
    let coat = &material["extensions"]["KHR_materials_clearcoat"];
    assert_eq!(coat["clearcoatRoughnessTexture"], json!({ "index": 2 }));
    assert_eq!(coat["clearcoatRoughnessFactor"], json!(1));
}

#[test]
fn files_of_a_model_do_not_meet_others() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("n.png"), texel([128, 128, 255])).unwrap();
    let material = |scale: u32| json!({ "name": "金属", "normalTexture": { "index": 0, "scale": scale } });
    let value = json!({
        "asset": { "version": "2.0" }, "images": [{ "uri": "n.png" }], "textures": [{ "source": 0 }],
        "materials": [material(1), material(2)],
    });
    let path = folder.path().join("m.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    let asset = Asset::read(&path).unwrap();
    let replacements: Vec<Replacement> = asset
        .layers()
        .into_iter()
        .map(|layer| Replacement {
            layers: vec![MaterialPair { material: layer.material, pair: layer.pair.unwrap() }],
            name: layer.name,
            ..replacement(&asset, Slot::Roughness, None)
        })
        .collect();
    // Two materials of one name have files of two.
    let edited = asset.edited(&replacements, Form::Web, &folder.path().join("out.gltf")).unwrap();
    let names = edited.files.iter().map(|file| file.path.file_name().unwrap().to_string_lossy());
    assert_eq!(names.collect::<Vec<_>>(), ["out-__.ktx2", "out-__-2.ktx2", "out.gltf"]);
    // In another folder lies another model's picture of the same name: it is not replaced.
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("n.png"), b"another").unwrap();
    let error = asset.edited(&[], Form::Web, &other.join("out.gltf")).unwrap_err().to_string();
    assert!(error.contains("n.png") && error.contains("empty folder"), "{error}");
    // An equal picture is as good as a copy.
    std::fs::write(other.join("n.png"), texel([128, 128, 255])).unwrap();
    assert_eq!(asset.edited(&[], Form::Web, &other.join("out.gltf")).unwrap().files.len(), 1);
}

#[test]
fn a_document_and_its_files_become_one() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("n.png", &texel([128, 128, 255]));
    write("a.bin", b"0123456789ABCDEFGHI");
    let inline = format!("data:application/octet-stream;base64,{}", "QUJDREVGR0g=");
    let meshopt =
        json!({ "EXT_meshopt_compression": { "buffer": 0, "byteOffset": 1, "byteLength": 9, "count": 3 } });
    let value = json!({
        "asset": { "version": "2.0" },
        "buffers": [
            { "name": "first", "uri": "a.bin", "byteLength": 17 },
            { "byteLength": 40, "extensions": { "EXT_meshopt_compression": { "fallback": true } } },
            { "uri": inline, "byteLength": 8 },
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 2, "byteLength": 5 },
            { "buffer": 1, "byteLength": 40, "extensions": meshopt },
            { "buffer": 2, "byteOffset": 3, "byteLength": 4 },
        ],
        "images": [{ "uri": "n.png", "name": "normals" }, { "bufferView": 2, "mimeType": "image/png" }],
        "textures": [{ "source": 0 }], "materials": [{ "normalTexture": { "index": 0 } }],
        "extensionsUsed": ["EXT_meshopt_compression"], "extras": { "kept": 1.50 },
    });
    let path = folder.path().join("m.gltf");
    let text = value.to_string().replace("1.5}", "1.50}");
    std::fs::write(&path, &text).unwrap();
    let packed = Asset::read(&path).unwrap().packed().unwrap();
    assert!(packed.is_binary());
    let bytes = &packed.edited(&[], Form::Web, "out.glb".as_ref()).unwrap().files[0].bytes;
    let (json, bin, _) = parts(bytes);
    assert!(json.contains("1.50"), "numbers keep their text");
    let packed: Value = serde_json::from_str(&json).unwrap();
    let of = |view: &Value| {
        let number = |key: &str| usize::try_from(view[key].as_u64().unwrap_or(0)).unwrap();
        bin[number("byteOffset")..][..number("byteLength")].to_vec()
    };
    let views = packed["bufferViews"].as_array().unwrap();
    assert_eq!((of(&views[0]), of(&views[2])), (b"23456".to_vec(), b"DEFG".to_vec()));
    assert_eq!(
        (&views[0]["buffer"], &views[1]["buffer"], &views[2]["buffer"]),
        (&json!(0), &json!(1), &json!(0))
    );
    assert_eq!(of(&views[1]["extensions"]["EXT_meshopt_compression"]), b"123456789");
    // The fallback has no bytes, and none are made for it.
    assert_eq!(packed["buffers"].as_array().unwrap().len(), 2);
    assert_eq!(packed["buffers"][0]["name"], "first");
    assert_eq!(packed["buffers"][1], value["buffers"][1]);
    assert!(packed["buffers"][0]["byteLength"].as_u64().unwrap() <= bin.len() as u64);
    let image = &packed["images"][0];
    assert_eq!((&image["name"], &image["mimeType"]), (&json!("normals"), &json!("image/png")));
    assert_eq!(of(&views[image["bufferView"].as_u64().unwrap() as usize]), texel([128, 128, 255]));
    // Files that lie about their length, and views of nothing.
    for (from, to, says) in [
        ("\"byteLength\":17", "\"byteLength\":20", "of the 20 bytes of buffer 0"),
        ("\"buffer\":2", "\"buffer\":7", "not there"),
        ("a.bin", "b.bin", "b.bin"),
        ("\"byteOffset\":2", "\"byteOffset\":18446744073709551615", "beyond the end of its buffer"),
        ("\"byteOffset\":2", "\"byteOffset\":13", "beyond the end of its buffer"),
    ] {
        let bad = text.replacen(from, to, 1);
        assert_ne!(bad, text);
        let error = Asset::from_bytes(&path, bad.as_bytes()).unwrap().packed().unwrap_err().to_string();
        assert!(error.contains(says), "{says}: {error}");
    }
}

#[test]
fn what_this_program_wrote_is_left_alone_and_other_ktx2_is_not() {
    use ndfmap_core::grid::Grid;
    use ndfmap_maps::formats::ktx2::{Texture, TextureEncoding};
    let (text, bin) = odd();
    let asset = Asset::from_bytes("odd.glb".as_ref(), &glb(&text, &bin)).unwrap();
    let level = |side| Grid::from_fn(Size { width: side, height: side }, |_, _| [255, 50, 0, 255]);
    let texture = Texture { levels: vec![level(2), level(1)], importance: [1.0; 3] };
    let ours = texture.to_ktx2("t.ktx2".as_ref(), TextureEncoding::Uastc, Some(3)).unwrap();
    let fallback = texel([255, 200, 0]);
    let fixed = |ktx2: Vec<u8>| {
        let replacement =
            Replacement { ktx2, ..replacement(&asset, Slot::Roughness, Some(fallback.clone())) };
        let bytes = document(&asset, &[replacement], Form::Web, "o.glb");
        Asset::from_bytes("again.glb".as_ref(), &bytes).unwrap()
    };
    let again = fixed(ours.clone());
    assert_eq!(again.layers()[0].pair.as_ref().unwrap_err(), &Reason::AlreadyFixed);
    let at = ours.windows(6).position(|w| w == b"ndfmap").unwrap();
    let mut theirs = ours;
    theirs[at] = b'N';
    let again = fixed(theirs);
    let pair = again.layers()[0].pair.clone().unwrap();
    // Engines show the KTX2, not its fallback.
    let green = again.roughness(&pair).unwrap().unwrap().row(0)[0][1];
    assert!((green - 50.0 / 255.0).abs() < 1e-6, "{green}");
}

#[test]
fn layers_that_cannot_be_judged_say_why() {
    let info = json!({ "index": 0 });
    let material = |name: &str, extra: Value| {
        let mut material = json!({ "name": name, "normalTexture": info,
            "pbrMetallicRoughness": { "metallicRoughnessTexture": info } });
        for (key, value) in extra.as_object().unwrap() {
            material[key] = value.clone();
        }
        material
    };
    let rough = |texture: Value| json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": texture } });
    let cases = [
        (json!({ "name": "bare" }), Reason::NoNormalMap),
        (material("unlit", json!({ "extensions": { "KHR_materials_unlit": {} } })), Reason::Unlit),
        (
            material("gloss", json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {} } })),
            Reason::SpecularGlossiness,
        ),
        (
            material("brushed", json!({ "extensions": { "KHR_materials_anisotropy": {} } })),
            Reason::Anisotropic,
        ),
        (material("set", rough(json!({ "index": 0, "texCoord": 1 }))), Reason::LaidApart),
        (
            material(
                "moved",
                rough(
                    json!({ "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0] } } }),
                ),
            ),
            Reason::LaidApart,
        ),
        (material("edges", rough(json!({ "index": 1 }))), Reason::WrappedApart),
        (material("near", json!({ "normalTexture": { "index": 2 } })), Reason::NoMips),
        (material("lost", rough(json!({ "index": 3 }))), Reason::NoPicture(3)),
        (material("none", rough(json!({ "index": 99 }))), Reason::NoPicture(99)),
        (
            material("wild", json!({ "pbrMetallicRoughness": { "roughnessFactor": 3 } })),
            Reason::OutOfRange("roughness factor"),
        ),
        (
            material("alive", json!({})),
            Reason::Animated("/materials/11/pbrMetallicRoughness/roughnessFactor".to_owned()),
        ),
    ];
    let document = json!({
        "asset": { "version": "2.0" },
        "images": [{ "uri": "n.png" }],
        "samplers": [{}, { "wrapS": 33071 }, { "minFilter": 9729 }],
        "textures": [{ "source": 0, "sampler": 0 }, { "source": 0, "sampler": 1 }, { "source": 0, "sampler": 2 },
            { "extensions": { "VENDOR_picture": { "source": 0 } } }],
        "materials": cases.iter().map(|(material, _)| material).collect::<Vec<_>>(),
        "animations": [{ "channels": [{ "target": { "path": "pointer", "extensions": { "KHR_animation_pointer":
            { "pointer": "/materials/11/pbrMetallicRoughness/roughnessFactor" } } } }] }],
    });
    let asset = Asset::from_bytes("r.gltf".as_ref(), document.to_string().as_bytes()).unwrap();
    let layers = asset.layers();
    assert_eq!(layers.len(), cases.len());
    for (layer, (_, reason)) in layers.iter().zip(&cases) {
        assert_eq!(layer.pair.as_ref().unwrap_err(), reason, "{}", layer.name);
        assert!(!reason.to_string().is_empty());
    }
}

#[test]
fn what_is_no_gltf_is_refused_by_name() {
    let (text, bin) = odd();
    let sound = glb(&text, &bin);
    let with = |at: usize, byte: u8| {
        let mut bytes = sound.clone();
        bytes[at] = byte;
        bytes
    };
    for (bytes, says) in [
        (b"no JSON".to_vec(), "no sound glTF"),
        (b"{\"asset\":{\"version\":\"1.0\"}}".to_vec(), "glTF 1.0"),
        (b"{\"asset\":{}}".to_vec(), "asset.version"),
        (
            b"{\"asset\":{\"version\":\"2.0\"},\"materials\":[{\"normalTexture\":{\"index\":-1}}]}".to_vec(),
            "-1",
        ),
        (vec![b'['; 100_000], "recursion limit"),
        (with(4, 1), "glTF 1.0"),
        (with(4, 9), "glTF 9"),
        (with(10, 0xff), "truncated"),
        (with(15, 0x7f), "beyond its end"),
        (with(16, b'X'), "chunk of JSON"),
        (sound[..9].to_vec(), "truncated"),
    ] {
        let error = Asset::from_bytes("bad.glb".as_ref(), &bytes).unwrap_err().to_string();
        assert!(error.contains("bad.glb") && error.contains(says), "{says}: {error}");
    }
}

/// Reads, and edits what can be edited; what matters is that it returns.
fn edit(bytes: &[u8]) {
    let Ok(asset) = Asset::from_bytes("h.glb".as_ref(), bytes) else { return };
    for layer in asset.layers() {
        if let Ok(pair) = &layer.pair {
            let _ = (asset.normals(pair), asset.roughness(pair), asset.appearance(layer.material));
        }
    }
    let all = replacement(&asset, Slot::Roughness, None);
    let _ = asset.clone().packed();
    if let Ok(edited) = asset.edited(&[all], Form::Web, "h.glb".as_ref()) {
        let document = &edited.files.last().unwrap().bytes;
        Asset::from_bytes("again.glb".as_ref(), document).unwrap();
    }
}

#[test]
fn damage_does_not_stop_the_program() {
    let (text, bin) = odd();
    let sound = glb(&text, &bin);
    (0..sound.len()).for_each(|length| edit(&sound[..length]));
    let mut random = Pcg64Mcg::seed_from_u64(18);
    for _ in 0..4000 {
        let mut bytes = sound.clone();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = if random.random() {
                random.random()
            } else {
                b"0123456789[]{},:\""[random.random_range(0..17)]
            };
        }
        edit(&bytes);
    }
}
