//! JPEG, baseline and progressive, by the `image` crate.

use std::io::Cursor;
use std::path::Path;

use ::image::codecs::jpeg::JpegDecoder;

use super::{
    Format,
    decoded::{Capacity, read_integers},
};
use crate::{Image, MapError};

pub(super) const FORMAT: Format =
    Format { name: "JPEG", extensions: &["jpg", "jpeg"], magic: &[b"\xFF\xD8\xFF"], ..Format::read_by(read) };

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // The decoder fills missing parts with grey, and a map must not come out half invented.
    if !is_complete(bytes) {
        return Err(MapError::invalid(path, "is truncated: it lacks a JPEG end-of-image marker"));
    }
    let decoder = JpegDecoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    // A sequential block of 64 texels takes at least two bits a component; progressive files of one colour
    // pack runs of blocks, and 4096 leaves room for those.
    read_integers(path, decoder, &Capacity { bytes: bytes.len(), texels_per_byte: 4096 })
}

/// True where the end-of-image marker follows the last scan. Cameras and tools append to files: what comes
/// after the marker is no part of the picture. (Previews, which end in such a marker too, lie in segments.)
fn is_complete(bytes: &[u8]) -> bool {
    let mut at = 2;
    loop {
        // In a scan, 0xFF is followed by a zero, by another, or by the number of a restart.
        let marker = |pair: &[u8]| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xFF | 0xD0..=0xD7);
        let rest = bytes.get(at..).unwrap_or_default();
        let Some(found) = rest.windows(2).position(marker) else { return false };
        if rest[found + 1] == 0xD9 {
            return true;
        }
        let length = rest[found + 2..].first_chunk().map_or(2, |length| u16::from_be_bytes(*length));
        at += found + 2 + usize::from(length.max(2));
    }
}
