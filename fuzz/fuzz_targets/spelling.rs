#![no_main]
//! Any text as the spelling of a method or a BRDF; what is accepted spells itself the same way again.

use libfuzzer_sys::fuzz_target;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::ndf::AnyMethod;

fuzz_target!(|text: &str| {
    if let Ok(method) = text.parse::<AnyMethod>() {
        let spelling = method.to_string();
        assert_eq!(spelling.parse::<AnyMethod>().expect("its own spelling").to_string(), spelling);
    }
    if let Ok(lobe) = text.parse::<AnyLobe>() {
        let spelling = lobe.to_string();
        assert_eq!(spelling.parse::<AnyLobe>().expect("its own spelling").to_string(), spelling);
        assert!(lobe.evaluate(0.5).is_finite());
    }
});
