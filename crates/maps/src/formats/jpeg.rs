//! JPEG, baseline and progressive, by the `image` crate.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::jpeg::JpegDecoder;

use super::{
    Format,
    decoded::{Capacity, read_integers},
};
use crate::{Image, MapError};

pub(super) const FORMAT: Format = Format {
    name: "JPEG",
    extensions: &["jpg", "jpeg"],
    magic: &[b"\xFF\xD8\xFF"],
    read_image: Some(read),
    ..Format::READ_ONLY
};

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // The decoder fills missing parts with grey, and a map must not come out half invented. A sound file
    // ends in the end-of-image marker, perhaps padded.
    let end = bytes.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1);
    if !bytes[..end].ends_with(&[0xFF, 0xD9]) {
        return Err(MapError::invalid(path, "is truncated: it does not end in a JPEG end-of-image marker"));
    }
    let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    // A sequential block of 64 texels takes at least two bits a component; progressive files of one colour
    // pack runs of blocks, and 4096 leaves room for those.
    read_integers(path, decoder, &Capacity { bytes: bytes.len(), texels_per_byte: 4096 })
}
