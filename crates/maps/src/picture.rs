//! Rendered pictures as files: linear light or display values, as the format has it.

use std::path::Path;

use ndfmap_scene::metrics::{Picture, to_bytes};

use crate::formats::{WritePicture, picture_writer};
use crate::{MapError, atomic};

/// Writes a picture in the format that the file's name asks for. The exposure is for formats of display
/// values; the others hold the light as it is.
///
/// # Errors
/// [`MapError`] when the name asks for another format, or the file cannot be written.
pub fn write_picture(path: &Path, picture: &Picture, exposure: f32) -> Result<(), MapError> {
    let bytes = match picture_writer(path)? {
        WritePicture::Display(write) => write(to_bytes(picture, exposure).texels(), picture.size()),
        WritePicture::Linear(write) => write(picture),
    };
    atomic::write(path, &bytes.map_err(|e| MapError::invalid(path, e))?)
}
