//! Several maps at once, stdin and stdout, and what shells and manuals know.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use common::{json, outcome, text};
use serde_json::Value;

#[test]
fn several_maps_are_baked_and_one_that_fails_stops_none() {
    let folder = tempfile::tempdir().unwrap();
    let maps = folder.path().join("maps");
    std::fs::create_dir(&maps).unwrap();
    let save = |name: &str, pixels: &[u8]| {
        let mut encoder = png::Encoder::new(std::fs::File::create(maps.join(name)).unwrap(), 2, 2);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().unwrap().write_image_data(pixels).unwrap();
    };
    save("flat.png", &[128, 128, 255].repeat(4));
    save("red.png", &[200, 10, 10, 220, 30, 5, 190, 5, 40, 100, 0, 0]);
    std::fs::write(maps.join("notes.txt"), "no picture").unwrap();
    let out = folder.path().join("out");
    let words =
        ["bake", &text(&maps), "builtin:foil", "--map-size", "8", "--output-dir", &text(&out), "--json"];
    // Found in a folder, a picture that is no map is left out; named, it is a failure.
    let (status, stdout, stderr) = outcome(&words);
    assert!(status == 0 && stderr.contains("left out: ") && stderr.contains("red.png"), "{stderr}");
    let told: Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(told["ndfmap"]["arguments"][0], "bake");
    let rows = told["maps"].as_array().unwrap();
    assert_eq!(rows.iter().map(|row| row["error"].is_null()).collect::<Vec<_>>(), [true, false, true]);
    assert!(rows[1]["error"].as_str().unwrap().contains("looks like colours"), "{}", rows[1]);
    assert_eq!(rows[1]["no_map"], true);
    let named = text(&maps.join("red.png"));
    let (status, _, stderr) =
        outcome(&["bake", &named, "builtin:foil", "--map-size", "8", "--output-dir", &text(&out)]);
    assert!(status == 1 && stderr.contains("1 of 2 maps could not be baked"), "{stderr}");
    for name in ["flat", "foil"] {
        assert_eq!(
            json(&["inspect", &text(&out.join(name).with_extension("ktx2")), "--json"])["method"],
            "vmf:2"
        );
    }
}

#[test]
fn maps_come_from_stdin_and_go_to_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("a.ktx2"));
    json(&["bake", "builtin:foil", "--map-size", "16", &file, "--json"]);
    let piped = std::process::Command::new(env!("CARGO_BIN_EXE_ndfmap"))
        .args(["bake", "builtin:foil", "--map-size", "16", "-"])
        .output()
        .unwrap();
    assert!(piped.status.success());
    assert_eq!(piped.stdout, std::fs::read(&file).unwrap());
    let mut picture = Vec::new();
    let mut encoder = png::Encoder::new(&mut picture, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[128, 128, 255]).unwrap();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_ndfmap"))
        .args(["bake", "-", &file, "--quiet"])
        .stdin(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), &picture).unwrap();
    let done = child.wait_with_output().unwrap();
    assert!(done.status.success() && done.stderr.is_empty(), "{}", String::from_utf8_lossy(&done.stderr));
    assert_eq!(json(&["inspect", &file, "--json"])["width"], 1);
}

#[test]
fn files_are_kept_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("a.ktx2"));
    json(&["bake", "builtin:foil", "--map-size", "8", &file, "--json"]);
    let before = std::fs::read(&file).unwrap();
    let (status, _, said) = outcome(&["bake", "builtin:foil", "--map-size", "4", &file, "--no-clobber"]);
    assert!(status == 1 && said.contains("`--no-clobber` keeps it"), "{said}");
    assert_eq!(std::fs::read(&file).unwrap(), before);
}

#[test]
fn shells_and_manuals_know_every_command() {
    let (status, script, _) = outcome(&["completions", "bash"]);
    assert!(status == 0 && script.contains("--output-dir"), "{script}");
    let folder = tempfile::tempdir().unwrap();
    let (status, _, said) = outcome(&["man", "-o", &text(folder.path())]);
    assert_eq!(status, 0, "{said}");
    for command in ["bake", "compare", "demo", "inspect", "render"] {
        let page = std::fs::read_to_string(folder.path().join(format!("ndfmap-{command}.1"))).unwrap();
        assert!(page.contains(".SH OPTIONS"), "{command}");
    }
}

#[test]
fn nothing_in_view_is_no_perfect_picture() {
    let words = [
        "render",
        "--scene",
        "plane",
        "--camera",
        "0,0,4,0,9,99",
        "--truth=16",
        "--size",
        "8",
        "--map-size",
        "8",
        "--device",
        "cpu",
        "--json",
    ];
    let (status, _, said) = outcome(&words);
    assert!(status == 2 && said.contains("nothing is in view"), "{said}");
}

#[test]
fn options_that_do_nothing_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("a.ktx2"));
    json(&["bake", "builtin:foil", "--map-size", "8", &file, "--json"]);
    let picture = text(&folder.path().join("a.exr"));
    let scene =
        ["render", "--scene", "sphere", "--map-size", "8", "--size", "4", "--device", "cpu", "-o", &picture];
    for (words, said) in [
        (vec!["inspect", &file, "--convention", "opengl"], "options for the reading of pictures do nothing"),
        ([&scene[..], &["--map", &file, "--from", "height"]].concat(), "reading of pictures do nothing"),
        ([&scene[..], &["--tone", "reinhard"]].concat(), "`--tone` does nothing"),
    ] {
        let (status, _, stderr) = outcome(&words);
        assert!(status == 0 && stderr.contains(said), "{words:?}: {stderr}");
    }
}
