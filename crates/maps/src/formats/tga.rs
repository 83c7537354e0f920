//! Truevision TGA, by the `image` crate. The format has no signature, so it goes by name.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::tga::TgaDecoder;

use super::{
    Format,
    decoded::{Capacity, read_integers},
};
use crate::image::check_size;
use crate::{Image, MapError};

pub(super) const FORMAT: Format = Format { name: "TGA", extensions: &["tga"], ..Format::read_by(read) };

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // Sides lie at offsets 12 and 14 of the 18-byte header; they are checked before the decoder sees them.
    let header: &[u8; 18] =
        bytes.first_chunk().ok_or_else(|| MapError::invalid(path, "is too short for a TGA header"))?;
    let side = |at: usize| usize::from(u16::from_le_bytes([header[at], header[at + 1]]));
    check_size(path, side(12), side(14))?;
    let decoder = TgaDecoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    // A run-length packet is a byte and a texel, for up to 128 texels.
    read_integers(path, decoder, &Capacity { bytes: bytes.len(), texels_per_byte: 128 })
}
