//! Against other people's programs. Skipped, visibly, where they are not installed; `scripts/test` installs
//! them and sets `NDFMAP_REQUIRE_INTEROP`, under which a skip is a failure.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;
use std::process::Command;

use common::{json, root, skipped};

/// True when `tool` is there; a missing one is said, or is a failure where it is required.
fn available(tool: &Path, what: &str) -> bool {
    if tool.exists() {
        return true;
    }
    let reason = format!("{what} is not installed ({}); scripts/test installs it", tool.display());
    skipped(&reason, "NDFMAP_REQUIRE_INTEROP");
    false
}

#[test]
fn bumpslopes_agree_with_openimageio() {
    let python = root().join(".venv/bin/python");
    if !available(&python, "OpenImageIO for Python") {
        return;
    }
    // Lossless maps of the data folder, where there is one: two JPEG decoders differ by a step or two.
    let data = root().join("../shared/data");
    let maps = [
        "normal/godot_wool_normal.png",
        "normal/godot_scifi_2_normal.png",
        "normal/sponza_lion_ddn.tga",
        "height/polyhaven_metal_plate_disp_1k.png",
        "height/godot_wool_depth.png",
    ];
    let maps = maps.iter().map(|m| data.join(m)).filter(|m| m.exists());
    let output = Command::new(python)
        .arg(root().join("tests/interop/bumpslopes.py"))
        .arg(env!("CARGO_BIN_EXE_ndfmap"))
        .args(maps)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    eprintln!("{told}");
    assert!(output.status.success(), "{told}{}", String::from_utf8_lossy(&output.stderr));
    assert!(told.lines().count() >= 17);
}

#[test]
fn lobes_are_as_likely_as_independent_fits() {
    let python = root().join(".venv/bin/python");
    if !available(&python, "scikit-learn for Python") {
        return;
    }
    let output = Command::new(python)
        .arg(root().join("tests/interop/likelihood.py"))
        .arg(env!("CARGO_BIN_EXE_ndfmap"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let rows: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 8);
    for method in ["gmm", "vmf"] {
        let mut gain = 0.0;
        for row in rows.iter().filter(|r| r["method"] == method) {
            eprintln!("{row}");
            let own = row["ours"].as_f64().unwrap() - row["independent"].as_f64().unwrap();
            // Which of its many local optima a program ends in is luck: the worst of eight rows is -0.019.
            assert!(own > -0.025, "{row}");
            gain += own;
        }
        // Mean log-likelihood a normal over two maps and two levels, as many starts on either side: measured
        // 0.094 and 0.045. Seeds are fixed, but not the versions of their libraries.
        let measured = if method == "gmm" { 0.094 } else { 0.045 };
        assert!(gain > 0.5 * measured, "{method}: {gain}");
    }
}

#[test]
fn ktx2_files_open_in_an_independent_reader() {
    if !available(&root().join("tests/interop/node_modules/ktx-parse"), "ktx-parse for Node.js") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("map.ktx2").display().to_string();
    for (method, precision, format, texel) in [
        ("slopes", "half", "RGBA16F", 8),
        ("ndm", "single", "RGBA32F", 16),
        ("sh:3", "half", "RGBA16F", 8),
        ("naive", "single", "RGBA32F", 16),
    ] {
        let baked = json(&[
            "bake",
            "builtin:foil",
            "--map-size",
            "50x33",
            "-m",
            method,
            "--precision",
            precision,
            "-o",
            &file,
            "--zstd=0",
            "--json",
        ]);
        let output =
            Command::new("node").arg(root().join("tests/interop/ktx2.mjs")).arg(&file).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let seen: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(seen["format"], format);
        let layers = baked["layers"].as_u64().unwrap();
        assert_eq!((seen["width"].as_u64(), seen["height"].as_u64()), (Some(50), Some(33)));
        assert_eq!((seen["layers"].as_u64(), seen["faces"].as_u64()), (Some(layers), Some(1)));
        let sizes = [(50, 33), (25, 16), (12, 8), (6, 4), (3, 2), (1, 1)];
        let lengths: Vec<u64> = sizes.iter().map(|(w, h)| w * h * layers * texel).collect();
        assert_eq!(seen["levels"], serde_json::json!(lengths));
        assert_eq!(seen["keys"], serde_json::json!(["KTXorientation", "KTXwriter", "ndfmap"]));
        assert_eq!(
            (&seen["ndfmap"]["method"], seen["samples"].as_u64()),
            (&serde_json::json!(method), Some(4))
        );
        if method == "naive" {
            let told = json(&["inspect", &file, "--texel", "5", "0", "0", "--json"]);
            let (mean, seen) = (&told["mean"], &seen["coarsest"]);
            let length: f64 = (0..3).map(|i| seen[i].as_f64().unwrap().powi(2)).sum::<f64>().sqrt();
            for i in 0..3 {
                assert!((mean[i].as_f64().unwrap() - seen[i].as_f64().unwrap() / length).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn truth_agrees_with_mitsuba() {
    let python = root().join(".venv/bin/python");
    if !available(&python, "Mitsuba for Python") {
        return;
    }
    let output = Command::new(python)
        .arg(root().join("tests/interop/mitsuba_plane.py"))
        .arg(env!("CARGO_BIN_EXE_ndfmap"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let rows: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(rows.as_array().unwrap().len(), 4);
    for row in rows.as_array().unwrap() {
        eprintln!("{row}");
        let [mean, l2, noise] = ["mean", "l2", "noise"].map(|key| row[key].as_f64().unwrap());
        // 1296 pixels of independent noise: the norm of the difference strays by 1/sqrt(2592) = 2 % of
        // itself, but the bright ones weigh most; 15 % leaves room for them. The mean of all strays by
        // noise/36, times the same.
        assert!(l2 < 1.15 * noise, "{row}");
        assert!(mean < 4.5 * noise / 36.0, "{row}");
    }
}
