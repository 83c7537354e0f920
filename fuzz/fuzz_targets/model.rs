#![no_main]
//! Any bytes as a model of any format. The first byte chooses the name.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::model::{ModelOptions, model_of_bytes};
use ndfmap_scene::SceneOptions;

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let name = ["map.obj", "map.fbx", "map.ply", "map.gltf", "map.glb"][usize::from(first % 5)];
    let options = ModelOptions { staging: SceneOptions::default(), material: None };
    if let Ok((scene, _)) = model_of_bytes(Path::new(name), bytes, &options) {
        for material in &scene.materials {
            assert!(material.params.diffuse.is_finite() && material.params.specular.is_finite());
        }
        for object in &scene.objects {
            for vertex in &object.mesh.vertices {
                assert!(vertex.position.is_finite() && vertex.uv.is_finite());
                assert!(vertex.normal.is_normalized() && vertex.tangent.is_finite());
            }
        }
    }
});
