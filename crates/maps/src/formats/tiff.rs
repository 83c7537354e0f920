//! TIFF by the `tiff` crate: 8, 16 and 32-bit integers, signed and unsigned, and floats.
//!
//! Unsigned 8 and 16-bit samples run from 0 to 1 as in any picture. Signed and wider integers are
//! measurements (metres, say) and keep their values, as floats do. GDAL's "no data" value becomes the
//! lowest height there is.

use std::io::Cursor;
use std::path::Path;

use ::tiff::ColorType;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::Tag;

use super::Format;
use crate::image::{MAX_TEXELS, check_size};
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "TIFF",
    extensions: &["tif", "tiff"],
    magic: &[b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"],
    read_image: Some(read),
    ..Format::READ_ONLY
};

/// Tag GDAL_NODATA: value, as text, of posts that were not measured.
const NO_DATA: Tag = Tag::Unknown(42113);

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let invalid = |e: ::tiff::TiffError| MapError::invalid(path, e);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_TEXELS * 16;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(invalid)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(invalid)?;
    let size = check_size(path, width as usize, height as usize)?;
    let channels = match decoder.colortype().map_err(invalid)? {
        ColorType::Gray(_) => 1,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        ColorType::Multiband { num_samples, .. } if (1..=4).contains(&num_samples) => {
            usize::from(num_samples)
        }
        other => {
            return Err(MapError::unsupported(
                path,
                format!("has {other:?} texels; grey, RGB and RGBA are read"),
            ));
        }
    };
    let no_data: Option<f32> =
        decoder.get_tag_ascii_string(NO_DATA).ok().and_then(|t| t.trim_end_matches('\0').trim().parse().ok());
    // Deflate's ratio bounds what a file this long can hold, as for PNG; LZW and PackBits stay below it.
    if size.area() / 1032 > bytes.len() {
        return Err(MapError::invalid(
            path,
            format!("is truncated: {} bytes cannot hold {width} × {height} texels", bytes.len()),
        ));
    }
    let samples = match decoder.read_image().map_err(invalid)? {
        DecodingResult::U8(v) => Samples::U8(v),
        DecodingResult::U16(v) => Samples::U16(v),
        DecodingResult::F32(v) => Samples::F32(v),
        DecodingResult::F16(v) => Samples::F32(v.into_iter().map(f32::from).collect()),
        DecodingResult::F64(v) => Samples::F32(v.into_iter().map(|s| s as f32).collect()),
        DecodingResult::I8(v) => Samples::F32(v.into_iter().map(f32::from).collect()),
        DecodingResult::I16(v) => Samples::F32(v.into_iter().map(f32::from).collect()),
        DecodingResult::I32(v) => Samples::F32(v.into_iter().map(|s| s as f32).collect()),
        DecodingResult::U32(v) => Samples::F32(v.into_iter().map(|s| s as f32).collect()),
        DecodingResult::I64(_) | DecodingResult::U64(_) => {
            return Err(MapError::unsupported(path, "has 64-bit integers; up to 32 bits are read"));
        }
    };
    let mut image = Image::new(path, size, channels, samples)?;
    if let Some(hole) = no_data {
        let filled = match &mut image.samples {
            Samples::U8(v) => fill(v, |s| f32::from(*s) == hole),
            Samples::U16(v) => fill(v, |s| f32::from(*s) == hole),
            Samples::F32(v) => fill(v, |s| *s == hole || s.is_nan() && hole.is_nan()),
        };
        if filled > 0 {
            image.warnings.push(format!("{filled} texels without data take the lowest value there is"));
        }
    }
    Ok(image)
}

/// Fills holes with the lowest measured value; returns the number of holes.
fn fill<T: Copy + PartialOrd>(values: &mut [T], is_hole: impl Fn(&T) -> bool) -> usize {
    let lower = |a: T, b: T| if b < a { b } else { a };
    let Some(lowest) = values.iter().copied().filter(|v| !is_hole(v)).reduce(lower) else { return 0 };
    values.iter_mut().filter(|v| is_hole(v)).map(|v| *v = lowest).count()
}
