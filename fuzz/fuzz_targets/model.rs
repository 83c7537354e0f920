#![no_main]
//! Any bytes as a model of any format. The first byte chooses the name.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_scene::SceneOptions;
use ndfmap_maps::model::{ModelOptions, model_of_bytes};

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let name = ["map.obj", "map.fbx", "map.ply", "map.gltf", "map.glb"][usize::from(first % 5)];
    let options = ModelOptions { staging: SceneOptions::default(), material: None };
    if let Ok((scene, _)) = model_of_bytes(Path::new(name), bytes, &options) {
        for object in &scene.objects {
            assert!(object.mesh.vertices.iter().all(|v| v.position.is_finite() && v.normal.is_finite()));
        }
    }
});
