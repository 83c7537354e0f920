//! WebP, lossy and lossless, by the `image` crate.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::webp::WebPDecoder;

use super::{
    Format,
    decoded::{Capacity, guarded, read_integers},
};
use crate::{Image, MapError};

pub(super) const FORMAT: Format =
    Format { name: "WebP", extensions: &["webp"], magic: &[b"RIFF"], ..Format::read_by(read) };

/// Texels that a byte can stand for: no bound of the format, whose codes of one colour have no bits; the
/// reference encoder comes to 25517 with 8192 × 8192 texels of one colour.
const TEXELS_PER_BYTE: usize = 32_768;

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // The length of what follows the first eight bytes stands behind `RIFF`.
    let length =
        bytes.get(4..).and_then(|rest| rest.first_chunk()).map_or(0, |four| u32::from_le_bytes(*four));
    if bytes.len() < 8 + length as usize {
        return Err(MapError::invalid(path, "is truncated: its RIFF header is longer than the file"));
    }
    guarded(path, "WebP", || {
        let decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
        if decoder.has_animation() {
            return Err(MapError::unsupported(path, "is an animation; a WebP file of one picture is read"));
        }
        read_integers(path, decoder, &Capacity { bytes: bytes.len(), texels_per_byte: TEXELS_PER_BYTE })
    })?
}
