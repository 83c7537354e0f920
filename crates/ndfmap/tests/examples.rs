//! Examples: they run, and do what they say. They are built beside the tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::{Path, PathBuf};
use std::process::Command;

use ndfmap::maps::NdfMap;

/// The example's program.
fn example(name: &str) -> PathBuf {
    let own = std::env::current_exe().unwrap();
    let folder = own.ancestors().nth(2).unwrap().join("examples");
    let program = folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    // `cargo test` builds examples unless it is told which targets to test.
    assert!(program.exists(), "{name} is not built: cargo build --examples");
    program
}

/// Runs it in a folder, and says what it printed.
fn run(name: &str, folder: &Path, words: &[&str]) -> String {
    let output = Command::new(example(name)).args(words).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_map_is_baked_and_a_texel_of_it_shaded() {
    let folder = tempfile::tempdir().unwrap();
    let said = run("bake_a_map", folder.path(), &[]);
    assert!(said.starts_with("foil.ktx2: 10 levels of vmf:4, "), "{said}");
    let map = NdfMap::open(&folder.path().join("foil.ktx2")).unwrap();
    assert_eq!((map.header.method.as_str(), map.pyramid.layers()), ("vmf:4", 4));
    let said = run("shade_a_texel", folder.path(), &[]);
    let light: Vec<f64> = said
        .lines()
        .last()
        .unwrap()
        .trim_matches(['[', ']'])
        .split(", ")
        .map(|number| number.parse().unwrap())
        .collect();
    // Foil under one light: some light, the same in all colours, and less than a mirror's.
    assert!(light.len() == 3 && light[0] > 0.01 && light[0] < 10.0 && light[0] == light[2], "{said}");
}

#[test]
fn a_scene_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    run("render_a_model", folder.path(), &[]);
    let picture = std::fs::read(folder.path().join("sphere.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG") && picture.len() > 10_000, "{} bytes", picture.len());
}

#[cfg(feature = "shaders")]
#[test]
fn a_shader_is_exported() {
    let folder = tempfile::tempdir().unwrap();
    for (language, word) in [("glsl-es", "precision highp float;"), ("wgsl", "fn ndf_brdf() -> ndf_Brdf")] {
        let text = run("export_a_shader", folder.path(), &[language]);
        assert!(text.contains(word), "{language}: {text}");
    }
}
