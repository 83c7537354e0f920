#![no_main]
//! Any bytes as an environment.

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use ndfmap_fuzz::forgive_decoders;
use ndfmap_maps::environment::parse_environment;

fuzz_target!(init: forgive_decoders(), |bytes: &[u8]| {
    if let Ok((environment, _)) = parse_environment(Path::new("fuzz.exr"), bytes) {
        assert!(environment.mean().is_finite());
    }
});
