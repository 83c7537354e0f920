//! What pictures have in common that the `image` crate decodes.

use std::path::Path;

use ::image::{ColorType, ImageDecoder};
use ndfmap_core::grid::Size;

use crate::image::check_size;
use crate::{Image, MapError, Samples};

/// Decodes a picture of 8-bit grey, RGB or RGBA.
pub(super) fn read_integers(path: &Path, decoder: impl ImageDecoder) -> Result<Image, MapError> {
    let channels = match decoder.color_type() {
        ColorType::L8 => 1,
        ColorType::Rgb8 => 3,
        ColorType::Rgba8 => 4,
        other => {
            return Err(MapError::unsupported(
                path,
                format!("has {other:?} texels; 8-bit grey, RGB and RGBA are read"),
            ));
        }
    };
    let (size, buffer) = decode(path, decoder, usize::MAX)?;
    Image::new(path, size, channels, Samples::U8(buffer))
}

/// All bytes of a picture, its size checked first. `length` is the file's, for formats whose
/// run lengths bound what a byte can stand for.
pub(super) fn decode(
    path: &Path,
    decoder: impl ImageDecoder,
    length: usize,
) -> Result<(Size, Vec<u8>), MapError> {
    let (width, height) = decoder.dimensions();
    let size = check_size(path, width as usize, height as usize)?;
    // Run-length coded RGBE: two bytes stand for at most 127 of a texel's four.
    if size.area() / 64 > length {
        return Err(MapError::invalid(
            path,
            format!("is truncated: {length} bytes cannot hold {width} × {height} texels"),
        ));
    }
    let bytes = usize::try_from(decoder.total_bytes()).map_err(|e| MapError::unsupported(path, e))?;
    let mut buffer = vec![0; bytes];
    decoder.read_image(&mut buffer).map_err(|e| MapError::invalid(path, e))?;
    Ok((size, buffer))
}
