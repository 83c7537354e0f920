//! Device that the tests share, and how they are skipped.

#![allow(dead_code, reason = "every test file is a crate of its own and uses its own part of this one")]

use std::io::Write;

use ndfmap_gpu::{Device, GpuError};

/// The device; `None` skips, visibly, where the tests are not told to insist.
pub(crate) fn device() -> Option<Device> {
    match Device::open() {
        Ok(device) => Some(device),
        Err(e @ GpuError::NoAdapter) => {
            skipped(&e.to_string(), "NDFMAP_REQUIRE_GPU");
            None
        }
        Err(e) => panic!("{e}"),
    }
}

/// Says that the test is skipped: on stderr, and in the file that `NDFMAP_SKIPPED` names, which
/// `scripts/test` counts. It fails where the variable `insist` is set.
pub(crate) fn skipped(reason: &str, insist: &str) {
    assert!(std::env::var_os(insist).is_none(), "{reason}, and {insist} is set");
    let name = std::thread::current().name().unwrap_or("a test").to_owned();
    eprintln!("SKIPPED {name}: {reason}");
    if let Some(list) = std::env::var_os("NDFMAP_SKIPPED") {
        let list = std::fs::OpenOptions::new().append(true).create(true).open(list);
        let told = list.and_then(|mut list| list.write_all(format!("{name}: {reason}\n").as_bytes()));
        told.unwrap_or_else(|e| panic!("NDFMAP_SKIPPED: {e}"));
    }
}
