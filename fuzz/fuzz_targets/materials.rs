#![no_main]
//! Any bytes as the material library of an OBJ, beside which lies a picture, `map.png`.

use std::fs::write;
use std::path::PathBuf;
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::model::{ModelOptions, model_of_bytes};
use ndfmap_scene::SceneOptions;
use tempfile::TempDir;

const MODEL: &[u8] =
    b"mtllib map.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n";
const PICTURE: &[u8] = include_bytes!("../../crates/maps/tests/cases/b24_standard.png");

static FOLDER: OnceLock<TempDir> = OnceLock::new();

/// Path of a file in the folder, which is made with the picture in it.
fn beside(name: &str) -> PathBuf {
    let make = || {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path().join("map.png"), PICTURE).expect("a file in it");
        folder
    };
    FOLDER.get_or_init(make).path().join(name)
}

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    write(beside("map.mtl"), bytes).expect("a file in the folder");
    let options = ModelOptions { staging: SceneOptions::default(), material: None };
    if let Ok((scene, _)) = model_of_bytes(&beside("map.obj"), MODEL, &options) {
        for material in &scene.materials {
            assert!(material.params.diffuse.is_finite() && material.params.specular.is_finite());
        }
    }
});
