#![no_main]
//! Any bytes as a compressed view of a model. The first byte chooses mode and filter, the second the bytes of
//! an element, two more their number.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::model::{ModelOptions, model_of_bytes};
use ndfmap_scene::SceneOptions;
use serde_json::json;

/// Modes and filters.
const LAYOUTS: [[&str; 2]; 7] = [
    ["ATTRIBUTES", "NONE"],
    ["ATTRIBUTES", "OCTAHEDRAL"],
    ["ATTRIBUTES", "QUATERNION"],
    ["ATTRIBUTES", "EXPONENTIAL"],
    ["ATTRIBUTES", "COLOR"],
    ["TRIANGLES", "NONE"],
    ["INDICES", "NONE"],
];

/// Binary file of a document without a mesh: views are decoded before meshes are looked for.
fn glb(layout: [&str; 2], stride: usize, count: usize, stream: &[u8]) -> Vec<u8> {
    let ([mode, filter], length) = (layout, stream.len());
    let coded = json!({
        "buffer": 0, "byteLength": length,
        "byteStride": stride, "count": count, "mode": mode, "filter": filter
    });
    let view = json!({
        "buffer": 0, "byteLength": count * stride, "extensions": { "KHR_meshopt_compression": coded }
    });
    let document = json!({
        "asset": { "version": "2.0" }, "buffers": [{ "byteLength": length }], "bufferViews": [view]
    });
    let chunk = |kind: &[u8; 4], bytes: &[u8], filling: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), filling);
        [&(bytes.len() as u32).to_le_bytes(), kind.as_slice(), &bytes].concat()
    };
    let chunks = [chunk(b"JSON", document.to_string().as_bytes(), b' '), chunk(b"BIN\0", stream, 0)].concat();
    let header = [*b"glTF", 2_u32.to_le_bytes(), (12 + chunks.len() as u32).to_le_bytes()];
    [header.as_flattened(), &chunks].concat()
}

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    let Some((&[layout, stride, low, high], stream)) = bytes.split_first_chunk() else { return };
    let layout = LAYOUTS[usize::from(layout) % LAYOUTS.len()];
    let bytes = glb(layout, 1 + usize::from(stride), u16::from_le_bytes([low, high]).into(), stream);
    let options = ModelOptions { staging: SceneOptions::default(), material: None };
    assert!(model_of_bytes(Path::new("map.glb"), &bytes, &options).is_err(), "there is no mesh");
});
