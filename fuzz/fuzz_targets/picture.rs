#![no_main]
//! Any bytes as a picture of any format, then as a surface. The first byte chooses the name, for TGA,
//! and what the surface is taken for.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_core::surface::SurfaceRow;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::SourceKind;
use ndfmap_maps::formats::read_image;
use ndfmap_maps::source::{Convention, SourceOptions, source_of_image};

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let path = Path::new(if first & 1 == 0 { "map.tga" } else { "map.png" });
    let Ok(image) = read_image(path, bytes) else { return };
    let options = match first / 2 % 3 {
        0 => SourceOptions::default(),
        1 => SourceOptions { kind: Some(SourceKind::Height), height_scale: Some(1.0), ..Default::default() },
        _ => SourceOptions {
            kind: Some(SourceKind::Normal),
            convention: Some(Convention::OpenGl),
            ..Default::default()
        },
    };
    if let Ok(map) = source_of_image(path, image, String::new(), &options) {
        let mut row = SurfaceRow::flat(map.surface.size().width);
        map.surface.read_row(0, &mut row);
        assert!(row.z.iter().all(|z| z.is_finite()));
    }
});
