//! Files without a name until one is linked to them: when their process ends, however it does, they are gone.
//!
//! Linux has them on most file systems: `O_TMPFILE` in open(2), which also shows the link by way of `/proc`.

use std::fs::File;
use std::io;
use std::path::Path;

/// Opens such a file in `folder`, with this mode before the process's mask; `None` where none can be had.
#[cfg(target_os = "linux")]
pub(super) fn open(folder: &Path, mode: u32) -> Option<File> {
    use rustix::fs::{Mode, OFlags};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::open(folder, flags, Mode::from_raw_mode(mode)).ok()?);
    descriptor(&file).exists().then_some(file)
}

/// Gives it a name, which must be new.
#[cfg(target_os = "linux")]
pub(super) fn link(file: &File, name: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, descriptor(file), CWD, name, AtFlags::SYMLINK_FOLLOW)?)
}

/// The link that the system keeps to an open file.
#[cfg(target_os = "linux")]
fn descriptor(file: &File) -> std::path::PathBuf {
    use std::os::fd::AsRawFd;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
}

/// Opens such a file; `None`, for this system has none.
#[cfg(not(target_os = "linux"))]
pub(super) fn open(_folder: &Path, _mode: u32) -> Option<File> {
    None
}

/// Gives it a name; an error, for this system has no such file.
#[cfg(not(target_os = "linux"))]
pub(super) fn link(_file: &File, _name: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}
