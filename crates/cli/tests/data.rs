//! Real maps, which live outside the repository: skipped, visibly, where they are missing.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::{Path, PathBuf};

use common::{data, json, ndfmap, outcome, text};
use ndfmap::maps::formats::read_image;
use serde_json::Value;

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
    // Maps that tell nothing: half of a weave, and a mesh of wires.
    let untold = ["bevy_SheenChairFabric", "materialx_mesh_wire"];
    let maps: Vec<PathBuf> = files(&data.join("normal"))
        .into_iter()
        .filter(|f| !f.to_string_lossy().contains("Roughness"))
        .collect();
    assert_eq!(maps.len(), 31);
    for map in maps {
        let told = inspect(&map);
        let name = map.file_name().unwrap().to_string_lossy().into_owned();
        assert_eq!(told["kind"], "normal", "{name}");
        assert_eq!(told["layout"], "xyz", "{name}");
        let convention = if directx.iter().any(|d| name.starts_with(d)) {
            "directx".into()
        } else if untold.iter().any(|u| name.starts_with(u)) {
            Value::Null
        } else {
            "opengl".into()
        };
        assert_eq!(told["convention"], convention, "{name} {}", told["evidence"]);
    }
}

#[test]
fn pictures_that_are_no_maps_are_told_and_refused() {
    let Some(data) = data() else { return };
    let helmet = files(&data.join("mesh/FlightHelmet"));
    let named =
        |end: &str| helmet.iter().filter(|f| f.to_string_lossy().ends_with(end)).cloned().collect::<Vec<_>>();
    let mut cases: Vec<(PathBuf, &str)> = Vec::new();
    cases.extend(named("_BaseColor.png").into_iter().map(|f| (f, "colour")));
    cases.extend(named("_OcclusionRoughMetal.png").into_iter().map(|f| (f, "roughness")));
    assert_eq!(cases.len(), 10);
    cases.push((data.join("mesh/spot_texture.png"), "colour"));
    cases.push((data.join("normal/cgbookcase_Metal_tiles_03_2K_Roughness.png"), "roughness"));
    cases.extend(files(&data.join("env")).into_iter().map(|f| (f, "environment")));
    let folder = tempfile::tempdir().unwrap();
    let output = text(&folder.path().join("x.ktx2"));
    for (file, kind) in cases {
        assert_eq!(inspect(&file)["kind"], kind, "{}", file.display());
        let (status, _, said) = outcome(&["bake", &text(&file), &output]);
        assert!(status == 1 && said.contains("looks like") && said.contains("--from normal"), "{said}");
    }
}

#[test]
fn heights_take_the_scale_of_the_normal_map_beside_them() {
    let Some(data) = data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let output = text(&folder.path().join("x.ktx2"));
    let bake = |height: &str, normal: &str| {
        let (height, normal) =
            (text(&data.join("height").join(height)), text(&data.join("normal").join(normal)));
        outcome(&["bake", &height, &output, "--height-scale", "auto", "--normal-map", &normal, "--json"])
    };
    for (height, normal) in [
        ("cgbookcase_Metal_tiles_03_2K_Height.png", "cgbookcase_Metal_tiles_03_2K_Normal.png"),
        ("ambientcg_Rock058_displacement.jpg", "ambientcg_Rock058_normal.jpg"),
        ("playcanvas_seaside-rocks01-height.jpg", "playcanvas_seaside-rocks01-normal.jpg"),
    ] {
        let (status, stdout, said) = bake(height, normal);
        assert_eq!(status, 0, "{said}");
        assert!(said.contains("fits the normal map"), "{said}");
        let baked: Value = serde_json::from_str(&stdout).unwrap();
        // Measured: 0.06, 0.26 and 0.08 apart in the logarithm. The scale is fitted at the size where the
        // maps agree most; the finest slopes have the noise of 8 bits and of JPEG besides, most for the rock.
        let variance = |file: &str, words: &[&str]| {
            let told = json(&[&["inspect", file, "--json"], words].concat());
            told["slope_variance"][0].as_f64().unwrap()
        };
        let scale = said.split("height scale ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
        let own = variance(&text(&data.join("height").join(height)), &["--height-scale", &scale]);
        let due = variance(&text(&data.join("normal").join(normal)), &[]);
        assert!((own / due).ln().abs() < 0.3, "{height} {own} {due}");
        assert_eq!(baked["method"], "vmf:2");
    }
    let (status, _, said) = bake("godot_wool_depth.png", "ambientcg_Rock058_normal.jpg");
    assert!(status == 1 && said.contains("do not show one surface"), "{said}");
    // Metres, where texture widths are due.
    let dem = text(&data.join("height/topotoolbox_bigtujunga.tif"));
    let (status, _, said) = outcome(&["bake", &dem, &output]);
    assert!(status == 1 && said.contains("`--height-scale 1.6e-5`"), "{said}");
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
    // A numpy program's errors at blocks of 64 (level 6): naive, toksvig, slopes, sh:7; and a bound on how
    // far ours may lie. It drew 64 random blocks where we take every texel: measured 3.9, 1.7, 6.2, 3.9, 3.6,
    // 0.6, 1.4 and 0.4 %.
    let table = [
        ("ambientcg_Bricks075B_1K_NormalGL.jpg", 50, [1.12, 0.255, 0.466, 0.193], 0.045),
        ("ambientcg_Bricks075B_1K_NormalGL.jpg", 400, [3.78, 0.397, 0.571, 0.389], 0.02),
        ("godot_wool_normal.png", 50, [0.701, 0.165, 0.257, 0.269], 0.07),
        ("godot_wool_normal.png", 400, [2.43, 0.415, 0.489, 0.568], 0.045),
        ("godot_scifi_2_normal.png", 50, [0.991, 0.501, 0.417, 0.426], 0.04),
        ("godot_scifi_2_normal.png", 400, [1.7, 0.802, 0.732, 0.877], 0.01),
        ("bevy_water_normals.png", 50, [3.36, 0.622, 0.365, 0.196], 0.02),
        ("bevy_water_normals.png", 400, [7.78, 0.78, 0.617, 0.518], 0.01),
    ];
    for (map, s, expected, bound) in table {
        let path = data.join("normal").join(map).display().to_string();
        let lobe = format!("blinn-phong:{s}");
        let told =
            json(&["compare", &path, "--brdf", &lobe, "--method", "naive,toksvig,slopes,sh:7", "--json"]);
        for (method, expected) in ["naive", "toksvig", "slopes", "sh:7"].iter().zip(expected) {
            let got = told["methods"][method]["levels"][6]["error"].as_f64().unwrap();
            eprintln!(
                "{map} s = {s} {method}: {got:.3}, numpy {expected} ({:+.1} %)",
                (got / expected - 1.0) * 100.0
            );
            assert!((got / expected - 1.0).abs() < bound, "{map} {s} {method}: {got} for {expected}");
        }
    }
}

#[test]
fn fitted_lobes_are_at_least_as_good_as_the_independent_program() {
    let Some(data) = data() else { return };
    // The same program's plain EM from furthest points, at blocks of 64: vmf:1, 2, 4, 6 and gmm:4; and a
    // bound on ours over its own. Refined lobes of four and six are worse on one map's wide lobes, by up to
    // 11.6 %; elsewhere ours are the better.
    let table = [
        ("ambientcg_Bricks075B_1K_NormalGL.jpg", 50, [0.229, 0.144, 0.062, 0.045, 0.085], 1.0),
        ("ambientcg_Bricks075B_1K_NormalGL.jpg", 400, [0.368, 0.234, 0.13, 0.105, 0.141], 1.0),
        ("godot_scifi_2_normal.png", 50, [0.503, 0.265, 0.067, 0.048, 0.108], 1.12),
        ("godot_scifi_2_normal.png", 400, [0.801, 0.421, 0.194, 0.136, 0.189], 1.11),
        ("bevy_water_normals.png", 50, [0.732, 0.52, 0.284, 0.2, 0.411], 1.003),
        ("bevy_water_normals.png", 400, [0.854, 0.698, 0.548, 0.466, 0.659], 1.003),
    ];
    let methods = ["vmf:1", "vmf:2", "vmf:4", "vmf:6", "gmm:4"];
    for (map, s, expected, bound) in table {
        let path = data.join("normal").join(map).display().to_string();
        let lobe = format!("blinn-phong:{s}");
        let told = json(&["compare", &path, "--brdf", &lobe, "--method", &methods.join(","), "--json"]);
        for (method, expected) in methods.iter().zip(expected) {
            let got = told["methods"][method]["levels"][6]["error"].as_f64().unwrap();
            eprintln!(
                "{map} s = {s} {method}: {got:.3}, numpy {expected} ({:+.1} %)",
                (got / expected - 1.0) * 100.0
            );
            assert!(got < bound * expected, "{map} {s} {method}: {got} for {expected}");
        }
    }
}

#[test]
fn alignment_pays_between_the_texels_of_real_maps() {
    let Some(data) = data() else { return };
    for map in ["godot_scifi_2_normal.png", "vpython_stones_bumpmap.jpg"] {
        let path = data.join("normal").join(map).display().to_string();
        let methods = "toksvig,vmf:4,vmf:4:parent,vmf:4:unaligned";
        let told = json(&["compare", &path, "--method", methods, "--filtering", "--json"]);
        let mean = |method: &str, key: &str| {
            let levels = told["methods"][method]["filtering"].as_array().unwrap();
            levels[2..6].iter().map(|l| l[key].as_f64().unwrap()).sum::<f64>() / 4.0
        };
        let between = |method: &str| mean(method, "between");
        eprintln!(
            "{map}: refined {:.3}, parent {:.3}, unaligned {:.3}, toksvig {:.3}",
            between("vmf:4"),
            between("vmf:4:parent"),
            between("vmf:4:unaligned"),
            between("toksvig")
        );
        // The gain differs from map to map (the benchmark `lobes` has the medians); something
        // always is.
        assert!(between("vmf:4") < between("vmf:4:parent"), "{map}");
        assert!(
            between("vmf:4") < 0.6 * between("vmf:4:unaligned")
                && between("vmf:4") < 0.5 * between("toksvig")
        );
        // And without giving up the texels.
        assert!(mean("vmf:4", "texels") < 1.2 * mean("vmf:4:parent", "texels"), "{map}");
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

#[test]
fn real_environments_light_without_black_or_burnt_pixels() {
    let Some(data) = data() else { return };
    let folder = tempfile::tempdir().unwrap();
    let maps = files(&data.join("env"));
    assert_eq!(maps.len(), 7);
    for map in maps {
        let file = map.display().to_string();
        for how in ["prefiltered", "harmonics"] {
            let output = folder.path().join("lit.exr").display().to_string();
            let told = json(&[
                "render",
                "--scene",
                "sphere",
                "--map-size",
                "64",
                "--size",
                "48",
                "--device",
                "cpu",
                "--environment",
                &file,
                "--environment-light",
                how,
                "--method",
                "vmf:4",
                "--truth=256",
                "-o",
                &output,
                "--json",
            ]);
            let error = &told["methods"]["vmf:4"]["error"];
            eprintln!("{file} {how}: {error}, noise {}", told["truth"]["noise"]);
            // That it is a picture of the same light: within a twentieth. But Han et al.'s sum over
            // half-vectors knows of no horizon, and is held at nought where it rings: in the cellar, dark but
            // for an opening, it is 9.5 % too bright.
            let bound = if how == "harmonics" && file.contains("cellar") { 0.1 } else { 0.05 };
            assert!((error["brightness"].as_f64().unwrap() - 1.0).abs() < bound, "{file} {how}: {error}");
            let picture = read_image(output.as_ref(), &std::fs::read(&output).unwrap()).unwrap();
            let middle = |x: usize, y: usize| {
                (0..3)
                    .map(|c| picture.samples.get((y * 48 + x) * picture.channels + c))
                    .fold(f32::INFINITY, f32::min)
            };
            for (x, y) in (12..36).flat_map(|y| (12..36).map(move |x| (x, y))) {
                assert!(middle(x, y).is_finite() && middle(x, y) > 0.0, "{file} {how}: black at {x}, {y}");
            }
        }
    }
}
