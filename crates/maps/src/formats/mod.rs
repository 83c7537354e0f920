//! File formats: one file each, and the table of them.
//!
//! What a file is comes from its first bytes, not from its name; only TGA, which has none, goes by name.
//! Every reader gets the whole file in memory (so nothing is larger than the file itself allows) and
//! checks sizes before it allocates for them.

mod decoded;
pub mod exr;
mod hdr;
mod jpeg;
pub mod ktx2;
mod png;
mod tga;
mod tiff;

use std::path::Path;

use crate::{Image, MapError, NdfMap};

/// Reads a picture from a whole file.
pub type ReadImage = fn(&Path, &[u8]) -> Result<Image, MapError>;

/// Reads a normal distribution map from a whole file; `None` when the file is a plain picture.
pub type ReadNdf = fn(&Path, &[u8]) -> Result<Option<NdfMap>, MapError>;

/// A row of [`TABLE`].
pub struct Format {
    /// Name for messages.
    pub name: &'static str,
    /// Extensions, lower case; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// First bytes that give it away; empty for a format that has none.
    pub magic: &'static [&'static [u8]],
    /// Reads a picture.
    pub read_image: Option<ReadImage>,
    /// Reads a normal distribution map; `None` inside when the file is a plain picture.
    pub read_ndf: Option<ReadNdf>,
}

/// Every format there is.
pub static TABLE: &[Format] =
    &[png::FORMAT, jpeg::FORMAT, tiff::FORMAT, exr::FORMAT, hdr::FORMAT, ktx2::FORMAT, tga::FORMAT];

/// The format of a file, by its first bytes, else by its name.
///
/// # Errors
/// [`MapError`] for a file of no known format.
pub fn detect(path: &Path, bytes: &[u8]) -> Result<&'static Format, MapError> {
    let by_magic = TABLE.iter().find(|f| f.magic.iter().any(|m| bytes.starts_with(m)));
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let by_name = || TABLE.iter().find(|f| f.magic.is_empty() && f.extensions.contains(&extension.as_str()));
    if let Some(format) = by_magic.or_else(by_name) {
        return Ok(format);
    }
    if bytes.is_empty() {
        return Err(MapError::invalid(path, "is empty"));
    }
    let names: Vec<&str> = TABLE.iter().map(|f| f.name).collect();
    let reason = match TABLE.iter().find(|f| f.extensions.contains(&extension.as_str())) {
        Some(format) => format!("does not begin like a {} file", format.name),
        None => format!("is of no known format; known are {}", names.join(", ")),
    };
    Err(MapError::invalid(path, reason))
}

/// The bytes of a file; a folder or a missing file is an error that says so.
///
/// # Errors
/// [`MapError`] from the operating system.
pub fn read_file(path: &Path) -> Result<Vec<u8>, MapError> {
    if path.is_dir() {
        return Err(MapError::invalid(path, "is a folder, not a file"));
    }
    std::fs::read(path).map_err(|e| MapError::io(path, e))
}

/// Reads a baked map; `None` when the file is sound but holds a plain picture.
///
/// # Errors
/// [`MapError`] when the file is damaged.
pub fn read_ndf(path: &Path, bytes: &[u8]) -> Result<Option<NdfMap>, MapError> {
    match detect(path, bytes)?.read_ndf {
        Some(read) => read(path, bytes),
        None => Ok(None),
    }
}

/// Reads a picture.
///
/// # Errors
/// [`MapError`] when the file is damaged or holds no picture.
pub fn read_image(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let format = detect(path, bytes)?;
    let read = format.read_image.ok_or_else(|| {
        MapError::unsupported(path, "is already a baked map, or no map: `inspect` reads it")
    })?;
    read(path, bytes)
}
