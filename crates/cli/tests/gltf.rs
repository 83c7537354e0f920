//! Models by the program: what it exchanges, what it leaves alone and says of it, and what it refuses.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;

use common::{data, json, ndfmap, outcome, text};
use ndfmap::core::grid::Size;
use ndfmap::core::surface::SurfaceRow;
use ndfmap::maps::formats::{png, read_image};
use serde_json::{Value, json};

/// Folder with a model of three materials: foil without a roughness texture, the same with a factor in a
/// clearcoat, and a flat one.
fn model() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let size = Size { width: 64, height: 64 };
    let foil = (ndfmap::core::procedural::find("foil").unwrap().build)(size);
    let mut texels = Vec::new();
    let mut row = SurfaceRow::flat(size.width);
    for y in 0..size.height {
        foil.read_row(y, &mut row);
        texels.extend(
            (0..size.width)
                .map(|x| row.normal(x).to_array().map(|v| ((0.5 * v + 0.5) * 255.0).round() as u8)),
        );
    }
    std::fs::write(folder.path().join("foil.png"), png::encode(&texels, size).unwrap()).unwrap();
    let flat = vec![[128, 128, 255]; size.area()];
    std::fs::write(folder.path().join("flat.png"), png::encode(&flat, size).unwrap()).unwrap();
    let document = json!({
        "asset": { "version": "2.0" },
        "images": [{ "uri": "foil.png" }, { "uri": "flat.png" }],
        "textures": [{ "source": 0 }, { "source": 1 }],
        "materials": [
            { "name": "foil", "normalTexture": { "index": 0 }, "pbrMetallicRoughness": { "roughnessFactor": 0.3 } },
            { "name": "twin", "normalTexture": { "index": 0 }, "pbrMetallicRoughness": { "roughnessFactor": 0.3 } },
            { "name": "flat", "normalTexture": { "index": 1 } },
            { "name": "bare" },
            { "name": "plastic", "normalTexture": { "index": 0 },
                "pbrMetallicRoughness": { "roughnessFactor": 0.3, "metallicFactor": 0 } },
        ],
        "extras": { "kept": 1.0 },
    });
    std::fs::write(folder.path().join("model.gltf"), document.to_string()).unwrap();
    folder
}

fn read(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn what_gains_is_exchanged_and_the_rest_is_left_alone() {
    let folder = model();
    let file = |name: &str| folder.path().join(name);
    let run = |out: &str, threads: &str| {
        json(&["gltf", &text(&file("model.gltf")), "-o", &text(&file(out)), "--threads", threads, "--json"])
    };
    let told = run("one.gltf", "1");
    assert_eq!(told["layers"], run("two.gltf", "2")["layers"]);
    let layer = |i: usize| &told["layers"][i];
    let gain = &layer(0)["outcome"]["fixed"];
    assert_eq!((&layer(0)["name"], &gain["width"]), (&json!("foil"), &json!(64)));
    // Measured 0.567 and 0.790 before compression, which costs less than 0.01.
    let of = |key: &str, measure: &str| gain[key][measure].as_f64().unwrap();
    for (measure, bound) in [("relative_l2", 0.58), ("flip", 0.81)] {
        assert!(of("of_stock", measure) < bound, "{gain}");
        assert!(of("compressed_of_stock", measure) < of("of_stock", measure) + 0.01, "{gain}");
    }
    assert_eq!(layer(0)["outcome"], layer(1)["outcome"], "materials that are alike share their texture");
    assert!(layer(2)["outcome"]["no_better"].is_object(), "{}", layer(2));
    assert_eq!(layer(3)["outcome"]["left_alone"], json!("it has no normal map"));
    // Plastic with these maps is judged as plastic.
    assert_ne!(layer(0)["outcome"], layer(4)["outcome"]);
    assert_eq!((&layer(0)["texture"], &layer(1)["texture"]), (&json!("foil"), &json!("foil")));
    let (one, two) = (read(&file("one.gltf")), read(&file("two.gltf")));
    let rough =
        |i: usize| one["materials"][i]["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"].as_u64();
    assert_eq!((rough(0), rough(1)), (Some(2), Some(2)));
    let stock = read(&file("model.gltf"));
    for kept in [2, 3] {
        assert_eq!(one["materials"][kept], stock["materials"][kept]);
    }
    // A single texture for both: KTX2 with all levels, and a texel of the factor for those who cannot read
    // it.
    let names: Vec<&str> =
        one["images"].as_array().unwrap().iter().map(|i| i["uri"].as_str().unwrap()).collect();
    assert_eq!(names[..4], ["foil.png", "flat.png", "one-foil_roughness.ktx2", "one-foil_roughness.png"]);
    let ktx2 = std::fs::read(file(names[2])).unwrap();
    assert_eq!(ktx2, std::fs::read(file("two-foil_roughness.ktx2")).unwrap(), "any number of threads");
    assert_eq!(two["materials"], one["materials"]);
    let image = read_image(&file(names[2]), &ktx2).unwrap();
    let green = |i: usize| image.samples.get(i * image.channels + 1);
    assert_eq!(image.size, Size { width: 64, height: 64 });
    assert!((green(0) - 77.0 / 255.0).abs() < 1e-6, "the finest level is the factor: {}", green(0));
    let png = read_image(&file(names[3]), &std::fs::read(file(names[3])).unwrap()).unwrap();
    assert!((png.samples.get(1) - 77.0 / 255.0).abs() < 1e-6);
}

#[test]
fn loose_textures_and_bevy_and_a_dry_run() {
    let folder = model();
    let file = |name: &str| folder.path().join(name);
    let input = text(&file("model.gltf"));
    let count = || std::fs::read_dir(folder.path()).unwrap().count();
    let before = count();
    let (status, table, stderr) = outcome(&["gltf", &input, "--dry-run"]);
    assert_eq!((status, count()), (0, before), "{stderr}");
    assert!(table.contains("of 5 layers fixed"), "{table}");
    let sheet = file("sheet.png");
    let (status, _, stderr) = outcome(&["gltf", &input, "--dry-run", "--report", &text(&sheet)]);
    assert_eq!((status, count()), (0, before + 1), "{stderr}");
    let sheet = read_image(&sheet, &std::fs::read(&sheet).unwrap()).unwrap();
    // Three pictures of 192 pixels beside each other, and two rows a layer.
    assert!(sheet.size.width > 3 * 192 && sheet.size.height > 2 * 192, "{:?}", sheet.size);
    let out = file("textures");
    let (status, _, stderr) =
        outcome(&["gltf", &input, "--for", "files", "--rule", "fit:0.25", "-o", &text(&out)]);
    assert_eq!(status, 0, "{stderr}");
    let mut names: Vec<String> = std::fs::read_dir(&out)
        .unwrap()
        .map(|f| f.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names.len(), 3 * 8, "{names:?}");
    assert!(
        names.contains(&"foil_roughness.ktx2".to_owned())
            && names.contains(&"flat_roughness.6.png".to_owned())
    );
    let bevy = file("bevy.gltf");
    let (status, _, stderr) = outcome(&["gltf", &input, "--for", "bevy", "-o", &text(&bevy)]);
    assert_eq!(status, 0, "{stderr}");
    let bevy = read(&bevy);
    assert!(bevy.get("extensionsUsed").is_none());
    for texture in ["normalTexture", "pbrMetallicRoughness"] {
        for material in 0..3 {
            let of = &bevy["materials"][material][texture];
            let index = of.get("index").or_else(|| of["metallicRoughnessTexture"].get("index"));
            // A flat layer of one roughness needs no mips of it.
            let Some(index) = index else {
                assert_eq!((material, texture), (2, "pbrMetallicRoughness"));
                continue;
            };
            let source = &bevy["textures"][index.as_u64().unwrap() as usize]["source"];
            let image = &bevy["images"][source.as_u64().unwrap() as usize];
            assert!(image["uri"].as_str().unwrap().ends_with(".ktx2"), "{texture} of {material}: {image}");
        }
    }
}

#[test]
fn requests_that_cannot_be_met_are_refused() {
    let folder = model();
    let file = |name: &str| text(&folder.path().join(name));
    std::fs::write(
        folder.path().join("lost.gltf"),
        read(&folder.path().join("model.gltf")).to_string().replace("foil.png", "gone.png"),
    )
    .unwrap();
    std::fs::write(folder.path().join("cut.glb"), b"glTF\x02\0\0\0\xff\xff\0\0").unwrap();
    let count = || std::fs::read_dir(folder.path()).unwrap().count();
    let before = count();
    let (model, out) = (file("model.gltf"), file("out.gltf"));
    for (words, status, says) in [
        (vec![&*model], 2, "--output"),
        (vec![&*model, "-o", &*model], 2, "not touched"),
        (vec![&*model, "--dry-run", "--report", &*model], 2, "two outputs"),
        (vec![&*model, "-o", "out.bin"], 2, "written as a .gltf"),
        (vec![&*file("lost.gltf"), "-o", "out.glb"], 1, "gone.png"),
        (vec![&*model, "-o", &*out, "--rule", "fit:9"], 2, "fit:POWER"),
        (vec![&*model, "-o", &*out, "--for", "unity"], 2, "web"),
        (vec!["missing.glb", "-o", "out.glb"], 1, "missing.glb"),
        (vec![&*file("cut.glb"), "-o", "out.glb"], 1, "truncated"),
        (vec![&*file("lost.gltf"), "-o", &*out], 1, "gone.png"),
        (vec![&*file("foil.png"), "-o", &*out], 1, "foil.png"),
    ] {
        let (got, _, stderr) = outcome(&[&["gltf"][..], &words].concat());
        assert!(got == status && stderr.contains(says), "{words:?}: {got} {stderr}");
    }
    assert_eq!(count(), before, "nothing is written");
}

#[test]
fn models_that_people_have_are_read_and_told_of() {
    let Some(data) = data() else { return };
    let folder = tempfile::tempdir().unwrap();
    // No normal map: the file is copied, byte for byte.
    let ball = data.join("mesh/materialx_shaderball.glb");
    let out = folder.path().join("ball.glb");
    let output = ndfmap(&["gltf", &text(&ball), "-o", &text(&out)]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::read(&ball).unwrap(), std::fs::read(&out).unwrap());
    let told =
        json(&["gltf", &text(&data.join("mesh/FlightHelmet/FlightHelmet.gltf")), "--dry-run", "--json"]);
    let layers = told["layers"].as_array().unwrap();
    assert_eq!(layers.len(), 6);
    for layer in layers {
        if let Some(gain) = layer["outcome"].get("fixed") {
            let of = |measure: &str| gain["compressed_of_stock"][measure].as_f64().unwrap();
            assert!(of("relative_l2") <= 1.0 && of("flip") <= 1.0, "{layer}");
        }
    }
}
