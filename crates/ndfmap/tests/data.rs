//! Real maps, which live outside the repository: skipped, visibly, where they are missing.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::{Path, PathBuf};

use common::{json, ndfmap, root};
use serde_json::Value;

fn data() -> Option<PathBuf> {
    let folder = root().join("../shared/data");
    if folder.exists() {
        return Some(folder);
    }
    eprintln!("SKIPPED: the data folder is not beside this checkout");
    None
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    files
}

fn inspect(file: &Path) -> Value {
    json(&["inspect", &file.display().to_string(), "--json"])
}

#[test]
fn all_normal_maps_load_and_their_handedness_is_seen() {
    let Some(data) = data() else { return };
    // Measured apart from this program (see the data's own page): green down in these.
    let directx = [
        "bevy_BlueNoise",
        "bevy_ScratchedGold",
        "cgbookcase_Black_Tiles",
        "cgbookcase_Metal_tiles_03_2K_Normal",
        "godot_sand",
        "materialx_brick",
        "playcanvas",
        "sponza",
        "vpython",
    ];
    let maps: Vec<PathBuf> = files(&data.join("normal"))
        .into_iter()
        .filter(|f| !f.to_string_lossy().contains("Roughness"))
        .collect();
    assert_eq!(maps.len(), 31);
    for map in maps {
        let told = inspect(&map);
        let name = map.file_name().unwrap().to_string_lossy().into_owned();
        assert_eq!(told["kind"], "normal", "{name}");
        let warned = told["warnings"]
            .as_array()
            .unwrap()
            .iter()
            .any(|w| w.as_str().unwrap().contains("looks like a directx"));
        assert_eq!(warned, directx.iter().any(|d| name.starts_with(d)), "{name} {}", told["integrability"]);
    }
}

#[test]
fn all_height_maps_load() {
    let Some(data) = data() else { return };
    let maps = files(&data.join("height"));
    assert_eq!(maps.len(), 10);
    for map in maps {
        assert_eq!(inspect(&map)["kind"], "height", "{}", map.display());
    }
}

#[test]
fn errors_on_real_maps_agree_with_the_independent_program() {
    let Some(data) = data() else { return };
    // A numpy program's errors at blocks of 64 (level 6): naive, toksvig, slopes, sh:7. It drew 64 random
    // blocks where we take every texel, which on the smallest of these maps leaves some percent.
    let table = [
        ("ambientcg_Bricks075B_1K_NormalGL.jpg", 50, [1.12, 0.255, 0.466, 0.193]),
        ("ambientcg_Bricks075B_1K_NormalGL.jpg", 400, [3.78, 0.397, 0.571, 0.389]),
        ("godot_wool_normal.png", 50, [0.701, 0.165, 0.257, 0.269]),
        ("godot_wool_normal.png", 400, [2.43, 0.415, 0.489, 0.568]),
        ("godot_scifi_2_normal.png", 50, [0.991, 0.501, 0.417, 0.426]),
        ("godot_scifi_2_normal.png", 400, [1.7, 0.802, 0.732, 0.877]),
        ("bevy_water_normals.png", 50, [3.36, 0.622, 0.365, 0.196]),
        ("bevy_water_normals.png", 400, [7.78, 0.78, 0.617, 0.518]),
    ];
    for (map, s, expected) in table {
        let path = data.join("normal").join(map).display().to_string();
        let brdf = format!("blinn-phong:{s}");
        let told =
            json(&["compare", &path, "--brdf", &brdf, "--methods", "naive,toksvig,slopes,sh:7", "--json"]);
        for (method, expected) in ["naive", "toksvig", "slopes", "sh:7"].iter().zip(expected) {
            let got = told["methods"][method]["levels"][6]["error"].as_f64().unwrap();
            eprintln!(
                "{map} s = {s} {method}: {got:.3}, numpy {expected} ({:+.1} %)",
                (got / expected - 1.0) * 100.0
            );
            assert!((got / expected - 1.0).abs() < 0.10, "{map} {s} {method}: {got} for {expected}");
        }
    }
}

#[test]
fn a_damaged_colour_profile_does_not_matter() {
    let Some(data) = data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("tiles.ktx2").display().to_string();
    let map = data.join("normal/cgbookcase_Metal_tiles_03_2K_Normal.png").display().to_string();
    let baked = ndfmap(&["bake", &map, "-o", &output, "--convention", "directx"]);
    assert!(baked.status.success());
    assert!(!String::from_utf8_lossy(&baked.stderr).contains("looks like"));
}
