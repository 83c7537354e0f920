//! Radiance HDR (RGBE), by the `image` crate.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use ::image::codecs::hdr::HdrDecoder;

use super::{
    Format,
    decoded::{Capacity, decode},
};
use crate::image::Orientation;
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "Radiance HDR",
    extensions: &["hdr", "pic"],
    // Followed by the name of the program.
    magic: &[b"#?"],
    ..Format::read_by(read)
};

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // Run-length coded RGBE: two bytes stand for at most 127 of a texel's four.
    let capacity = Capacity { bytes: bytes.len(), texels_per_byte: 64 };
    let (bytes, orientation) = upright(path, bytes)?;
    let decoder = HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    let (size, buffer) = decode(path, decoder, &capacity)?;
    let samples = buffer.as_chunks::<4>().0.iter().map(|b| f32::from_ne_bytes(*b)).collect();
    Ok(Image::new(path, size, 3, Samples::F32(samples))?.oriented(orientation))
}

/// The file with a resolution line that the decoder knows, `-Y HEIGHT +X WIDTH`, and the order of its texels:
/// scanlines may run along either axis, from either side (Radiance's picture format).
fn upright<'a>(path: &Path, bytes: &'a [u8]) -> Result<(Cow<'a, [u8]>, Orientation), MapError> {
    let invalid = |reason: &str| MapError::invalid(path, reason);
    let blank = bytes.windows(2).position(|pair| pair == b"\n\n");
    let start = blank.ok_or_else(|| invalid("has no end of its Radiance header"))? + 2;
    let end = bytes[start..].iter().position(|b| *b == b'\n');
    let end = start + end.ok_or_else(|| invalid("has no resolution line"))?;
    let line = String::from_utf8_lossy(&bytes[start..end]);
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let [scanlines_along, scanlines, texels_along, texels] = words[..] else {
        return Err(invalid("has a resolution line of other than four words"));
    };
    let (transposed, y, x) = match (scanlines_along, texels_along) {
        ("-Y" | "+Y", "-X" | "+X") => (false, scanlines_along, texels_along),
        ("-X" | "+X", "-Y" | "+Y") => (true, texels_along, scanlines_along),
        _ => return Err(invalid("has a resolution line without an X and a Y axis")),
    };
    let orientation = Orientation { transposed, from_right: x == "-X", from_below: y == "+Y" };
    if orientation == Orientation::default() {
        return Ok((bytes.into(), orientation));
    }
    let line = format!("-Y {scanlines} +X {texels}");
    Ok(([&bytes[..start], line.as_bytes(), &bytes[end..]].concat().into(), orientation))
}
