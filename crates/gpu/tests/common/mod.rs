//! What the tests on a device share.

use ndfmap_gpu::{Device, GpuError};

/// The device; `None` skips, visibly, where the tests are not told to insist.
pub(crate) fn device() -> Option<Device> {
    match Device::open() {
        Ok(device) => Some(device),
        Err(GpuError::NoAdapter(e)) if std::env::var_os("NDFMAP_REQUIRE_GPU").is_none() => {
            eprintln!("skipped: no GPU, and no software Vulkan ({e})");
            None
        }
        Err(e) => panic!("{e}"),
    }
}
