//! Radiance HDR (RGBE), by the `image` crate.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;

use super::{Format, decoded::decode};
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "Radiance HDR",
    extensions: &["hdr", "pic"],
    magic: &[b"#?RADIANCE", b"#?RGBE"],
    read_image: Some(read),
    read_ndf: None,
};

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    let (size, buffer) = decode(path, decoder, bytes.len())?;
    let samples = buffer.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
    Image::new(path, size, 3, Samples::F32(samples))
}
