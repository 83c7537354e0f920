#![no_main]
//! Any bytes as a baked EXR map: an error or a map whose every texel decodes.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::formats::read_ndf;

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    let path = Path::new("map.exr");
    if let Ok(Some(map)) = read_ndf(path, bytes) {
        let method = map.method(path).expect("a map that was read has a method");
        for (level, size) in map.pyramid.sizes().iter().enumerate() {
            let _decoded = method.describe(&map.pyramid.texel(level, size.width - 1, 0));
        }
    }
});
