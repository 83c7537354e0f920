#![no_main]
//! Any bytes as a table of measurements: a header, and values that are repeated to fill a table where the
//! first byte says so.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_core::brdf::Lobe;
use ndfmap_maps::merl::parse_merl;

const SIZE: usize = 12 + 3 * 8 * 90 * 90 * 180;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else { return };
    let mut bytes = bytes.to_vec();
    if first & 1 == 1 && bytes.len() > 12 {
        let values = bytes.split_off(12);
        bytes.extend(values.iter().cycle().take(SIZE - 12));
    }
    if let Ok((lobe, _)) = parse_merl(Path::new("fuzz.binary"), &bytes) {
        assert!(lobe.evaluate(1.0) >= 0.0 && lobe.tint(0.5).min_element() >= 0.0);
    }
});
