//! Radiance HDR (RGBE), by the `image` crate.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;

use super::{
    Format,
    decoded::{Capacity, decode},
};
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "Radiance HDR",
    extensions: &["hdr", "pic"],
    magic: &[b"#?RADIANCE", b"#?RGBE"],
    read_image: Some(read),
    ..Format::READ_ONLY
};

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // Run-length coded RGBE: two bytes stand for at most 127 of a texel's four.
    let capacity = Capacity { bytes: bytes.len(), texels_per_byte: 64 };
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    let (size, buffer) = decode(path, decoder, &capacity)?;
    let samples = buffer.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
    Image::new(path, size, 3, Samples::F32(samples))
}
