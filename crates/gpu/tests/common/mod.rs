//! Device that the tests share.

use ndfmap_gpu::{Device, GpuError};

/// The device; `None` skips, visibly, where the tests are not told to insist.
pub(crate) fn device() -> Option<Device> {
    match Device::open() {
        Ok(device) => Some(device),
        Err(e @ GpuError::NoAdapter) if std::env::var_os("NDFMAP_REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED: {e}");
            None
        }
        Err(e) => panic!("{e}"),
    }
}
