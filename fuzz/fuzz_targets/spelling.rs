#![no_main]
//! Any text as the spelling of a method or a BRDF; what is accepted spells itself the same way again.

use libfuzzer_sys::fuzz_target;
use ndfmap_core::{brdf, ndf};

fuzz_target!(|text: &str| {
    if let Ok(method) = ndf::parse(text) {
        let spelling = method.spelling();
        assert_eq!(ndf::parse(&spelling).expect("its own spelling").spelling(), spelling);
    }
    if let Ok(lobe) = brdf::parse(text) {
        let spelling = lobe.spelling();
        assert_eq!(brdf::parse(&spelling).expect("its own spelling").spelling(), spelling);
        assert!(lobe.evaluate(0.5).is_finite());
    }
});
