//! Rendered pictures as files: linear light or display values, as the format has it.

use std::path::Path;

use ndfmap_core::grid::Grid;
use ndfmap_scene::metrics::{Picture, display};

use crate::formats::{WritePicture, picture_writer};
use crate::{MapError, atomic};

/// Display values in 8 bits.
#[must_use]
pub fn to_bytes(picture: &Picture, exposure: f32) -> Grid<[u8; 3]> {
    let size = picture.size();
    let byte = |v: f32| (v * 255.0).round() as u8;
    Grid::from_fn(size, |x, y| display(picture.row(y)[x], exposure).to_array().map(byte))
}

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
