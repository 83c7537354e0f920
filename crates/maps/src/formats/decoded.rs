//! Common part of the formats that other crates decode.

use std::path::Path;

use ::image::{ColorType, ImageDecoder};
use ndfmap_core::grid::Size;

use crate::image::check_size;
use crate::{Image, MapError, Samples};

/// Bytes of a file, and the most texels that one byte can stand for.
pub(super) struct Capacity {
    pub(super) bytes: usize,
    pub(super) texels_per_byte: usize,
}

/// Runs a decoder, some of whose own checks of a hostile file are assertions.
pub(super) fn guarded<T>(path: &Path, decoder: &str, decode: impl FnOnce() -> T) -> Result<T, MapError> {
    let damaged =
        |_| MapError::invalid(path, format!("is damaged in a way that the {decoder} decoder cannot handle"));
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode)).map_err(damaged)
}

/// Decodes a picture of 8-bit grey, RGB or either with alpha. Alpha beside grey is left out, for two channels
/// are those of a normal.
pub(super) fn read_integers(
    path: &Path,
    decoder: impl ImageDecoder,
    capacity: &Capacity,
) -> Result<Image, MapError> {
    let channels = match decoder.color_type() {
        ColorType::L8 => 1,
        ColorType::La8 => 2,
        ColorType::Rgb8 => 3,
        ColorType::Rgba8 => 4,
        other => {
            let reason = format!("has {other:?} texels; 8-bit grey, RGB and RGBA are read");
            return Err(MapError::unsupported(path, reason));
        }
    };
    let (size, buffer) = decode(path, decoder, capacity)?;
    let image = Image::new(path, size, channels, Samples::U8(buffer))?;
    Ok(if channels == 2 { image.channels(&[0]) } else { image })
}

/// All bytes of a picture, its size checked first: against the bounds, and against what the file can hold.
pub(super) fn decode(
    path: &Path,
    decoder: impl ImageDecoder,
    capacity: &Capacity,
) -> Result<(Size, Vec<u8>), MapError> {
    let (width, height) = decoder.dimensions();
    let size = check_size(path, width as usize, height as usize)?;
    if size.area() / capacity.texels_per_byte > capacity.bytes {
        let reason = format!("is truncated: {} bytes cannot hold {width} × {height} texels", capacity.bytes);
        return Err(MapError::invalid(path, reason));
    }
    let bytes = usize::try_from(decoder.total_bytes()).map_err(|e| MapError::unsupported(path, e))?;
    let mut buffer = vec![0; bytes];
    decoder.read_image(&mut buffer).map_err(|e| MapError::invalid(path, e))?;
    Ok((size, buffer))
}
