//! Every shader that can be linked is valid, without a GPU.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::{brdf, ndf};
use ndfmap_gpu::link;

#[test]
fn every_link_is_valid() {
    let mut links = 0;
    for row in brdf::TABLE {
        let lobe = row.samples[0].parse::<AnyLobe>().unwrap();
        link::truth(&*lobe).unwrap_or_else(|e| panic!("{}: {e}", row.name));
        for spelling in ndf::TABLE.iter().flat_map(|row| row.samples) {
            let method = spelling.parse::<AnyMethod>().unwrap();
            let carried = if method.carries_attributes() { 0..=2 } else { 0..=0 };
            for attributes in carried {
                link::draw(&*method, &*lobe, attributes).unwrap_or_else(|e| panic!("{spelling}: {e}"));
                links += 1;
            }
        }
    }
    assert!(links > 100, "only {links} shaders");
}
