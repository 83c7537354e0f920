#![no_main]
//! Any bytes as a picture of any format, then as a surface. The first byte chooses the name, for TGA.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_core::surface::SurfaceRow;
use ndfmap_maps::formats::read_image;
use ndfmap_maps::source::{SourceOptions, source_of_image};

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let path = Path::new(if first & 1 == 0 { "map.tga" } else { "map.png" });
    let Ok(image) = read_image(path, bytes) else { return };
    if let Ok(map) = source_of_image(path, image, String::new(), &SourceOptions::default()) {
        let mut row = SurfaceRow::flat(map.surface.size().width);
        map.surface.read_row(0, &mut row);
        assert!(row.z.iter().all(|z| z.is_finite()));
    }
});
