//! `render --device gpu` and `shader`, as users run them. On a machine without any adapter the first skips,
//! visibly.

#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn ndfmap(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ndfmap"));
    command.args(arguments.split_whitespace()).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs it, and expects it to work.
fn json(folder: &Path, arguments: &str) -> Value {
    let output = ndfmap(folder, &format!("{arguments} --json"));
    assert!(output.status.success(), "{arguments}: {}", said(&output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// True where there is an adapter; tests that are told to insist fail where there is none.
fn has_gpu(folder: &Path) -> bool {
    let output = ndfmap(folder, "render --scene foil --size 8 --method naive --device gpu --json");
    let none = said(&output).contains("there is no GPU that can be used");
    if none {
        common::skipped(&said(&output), "NDFMAP_REQUIRE_GPU");
    }
    !none
}

/// Rows of a PNG of 8-bit RGB.
fn pixels(file: &Path) -> Vec<u8> {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(file).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    bytes
}

/// Share of pixels that differ by more than one step of a byte.
fn off(a: &Path, b: &Path) -> f64 {
    let (a, b) = (pixels(a), pixels(b));
    let pairs = || a.as_chunks::<3>().0.iter().zip(b.as_chunks::<3>().0);
    let far = |(a, b): &(&[u8; 3], &[u8; 3])| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 1);
    pairs().filter(far).count() as f64 / pairs().count() as f64
}

#[test]
fn the_gpu_draws_the_film_that_the_cpu_draws() {
    let folder = tempfile::tempdir().unwrap();
    if !has_gpu(folder.path()) {
        return;
    }
    // The drying creature: four materials whose roughness and colours change with time, baked once.
    let film = "render --scene creature --frames 2 --size 240x180 --map-size 64 --method vmf:2,slopes";
    let on_gpu = json(folder.path(), &format!("{film} --device gpu -o gpu.png"));
    let on_cpu = json(folder.path(), &format!("{film} --device cpu -o cpu.png"));
    assert_eq!((&on_gpu["device"], &on_cpu["device"]), (&"gpu".into(), &"cpu".into()));
    assert!(on_gpu["adapter"].is_string() && on_gpu["clock"].is_string() && on_gpu["outlines"] == "parts");
    for method in ["vmf:2", "slopes"] {
        assert!(on_gpu["methods"][method]["frame_ms"]["median"].as_f64().unwrap() > 0.0);
    }
    for frame in ["0000", "0001"] {
        let name = |device: &str| folder.path().join(format!("{device}-{frame}.png"));
        // As in `crates/gpu/tests/pictures.rs`: a thousandth of the pixels have edges that fall either way.
        // Spikes and legs have more edges than the scenes there.
        let off = off(&name("gpu"), &name("cpu"));
        assert!(off < 2e-3, "frame {frame}: {off} of the pixels differ");
    }
}

#[test]
fn a_baked_map_is_rendered_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    json(folder.path(), "bake builtin:foil --map-size 64 --method gmm:2 -o foil.ktx2");
    let shared = "render --scene plane --size 64 --device cpu";
    let own = json(folder.path(), &format!("{shared} --map foil.ktx2 -o baked.png"));
    assert_eq!(own["method"], "gmm:2");
    json(folder.path(), &format!("{shared} --map builtin:foil --map-size 64 --method gmm:2 -o source.png"));
    let name = |name: &str| folder.path().join(name);
    assert_eq!(pixels(&name("baked.png")), pixels(&name("source.png")));
    // Another method bakes what the finest level holds: the normals, in half floats.
    json(folder.path(), &format!("{shared} --map foil.ktx2 --method toksvig -o again.png"));
    json(folder.path(), &format!("{shared} --map builtin:foil --map-size 64 --method toksvig -o once.png"));
    let off = off(&name("again.png"), &name("once.png"));
    assert!(off < 0.01, "{off}");
    if has_gpu(folder.path()) {
        json(folder.path(), "render --scene plane --size 64 --device gpu --map foil.ktx2 -o gpu.png");
        assert!(self::off(&name("gpu.png"), &name("baked.png")) < 2e-3);
    }
}

#[test]
fn without_an_adapter_it_says_so_and_auto_takes_the_processor() {
    let folder = tempfile::tempdir().unwrap();
    let run = |device: &str| {
        Command::new(env!("CARGO_BIN_EXE_ndfmap"))
            .args([
                "render", "--scene", "foil", "--size", "16", "--method", "naive", "--json", "--device",
                device,
            ])
            // The Vulkan loader then finds no driver.
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .current_dir(folder.path())
            .output()
            .unwrap()
    };
    let none = "there is no GPU that can be used, and no software one";
    if cfg!(any(target_os = "macos", windows)) {
        common::skipped("adapters here are not Vulkan's", "NDFMAP_REQUIRE_GPU");
        return;
    }
    let gpu = run("gpu");
    assert_eq!(gpu.status.code(), Some(1));
    assert!(said(&gpu).contains(none) && said(&gpu).contains("--device cpu"), "{}", said(&gpu));
    let auto = run("auto");
    assert!(auto.status.success() && said(&auto).contains(none), "{}", said(&auto));
    let value: Value = serde_json::from_slice(&auto.stdout).unwrap();
    assert_eq!(value["device"], "cpu");
}

#[test]
fn what_only_a_gpu_can_do_is_not_asked_of_the_processor() {
    let folder = tempfile::tempdir().unwrap();
    let output = ndfmap(folder.path(), "render --scene foil --size 8 --device cpu --sampler=4 --json");
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("name it with `--device gpu`"), "{}", said(&output));
}

#[test]
fn shaders_for_renderers_read_their_map() {
    let folder = tempfile::tempdir().unwrap();
    let texels: Vec<[u8; 3]> = (0..16 * 16).map(|i| [i as u8, 60, 90]).collect();
    let size = ndfmap::core::grid::Size { width: 16, height: 16 };
    let png = ndfmap::maps::formats::png::encode(&texels, size).unwrap();
    std::fs::write(folder.path().join("albedo.png"), png).unwrap();
    let bake = "bake builtin:foil map.ktx2 --map-size 16 --method vmf:2 --precision unorm8 --from-level 1";
    json(folder.path(), &format!("{bake} --attribute srgb:albedo.png"));
    for row in ndfmap::gpu::export::CONVENTIONS {
        let value = json(folder.path(), &format!("shader map.ktx2 --for {} --lang hlsl", row.name));
        let text = value["text"].as_str().unwrap();
        // Two lobes, and the colours that they carry.
        assert_eq!((value["renderer"].as_str(), value["layers"].as_u64()), (Some(row.name), Some(4)));
        assert!(text.contains(row.summary) && text.contains("4 layers, RGBA8 unorm"), "{text}");
        assert!(text.contains("level 1 of the normal map"), "{text}");
        assert!(value["brdf"].is_null() && text.contains("ndf_shade_environment("));
    }
    let output = ndfmap(folder.path(), "shader map.ktx2");
    assert!(said(&output).contains("not used") && said(&output).contains("--for"), "{}", said(&output));
}

#[test]
fn shaders_come_in_every_language() {
    let folder = tempfile::tempdir().unwrap();
    for language in ndfmap::gpu::export::TABLE {
        let name = language.name;
        let value = json(
            folder.path(),
            &format!("shader --method vmf:4 --brdf beckmann:0.3 --lang {name} -o {name}"),
        );
        let bytes = std::fs::read(folder.path().join(name)).unwrap();
        assert_eq!(value["bytes"], bytes.len());
        if name == "spirv" {
            assert_eq!(bytes[..4], 0x0723_0203_u32.to_le_bytes());
        } else {
            let text = String::from_utf8(bytes).unwrap();
            assert!(text.contains("method vmf:4, lobe beckmann:0.3, model smith"), "{name}");
            assert!(text.contains("ndf_shade("), "{name}");
        }
    }
    let output = ndfmap(folder.path(), "shader --lang hsl");
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("did you mean `hlsl`?"), "{}", said(&output));
    let output = ndfmap(folder.path(), "shader --for unreel");
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("did you mean `unreal`?"), "{}", said(&output));
    let output = ndfmap(folder.path(), "shader --for bevy --method sh:2");
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("`sh:2` has no lobes"), "{}", said(&output));
    let output = ndfmap(folder.path(), "shader --method toksvig");
    assert!(output.stdout.starts_with(b"// Normal distribution map, method toksvig"));
}
