//! TIFF by the `tiff` crate: integers of 1 to 32 bits, signed and unsigned, floats, and palettes.
//!
//! Unsigned 8 and 16-bit samples run from 0 to 1 as in any picture. Signed and wider integers are
//! measurements (metres, say) and keep their values, as floats do. GDAL's "no data" value becomes the
//! lowest height there is.

use std::io::Cursor;
use std::path::Path;

use ::tiff::ColorType;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::Tag;
use ndfmap_core::grid::Size;

use super::Format;
use crate::image::{MAX_TEXELS, Orientation, check_size};
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "TIFF",
    extensions: &["tif", "tiff"],
    magic: &[b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"],
    ..Format::read_by(read)
};

/// Tag GDAL_NODATA: value, as text, of posts that were not measured.
const NO_DATA: Tag = Tag::Unknown(42113);

/// Tag of how samples stand for colours.
const PHOTOMETRIC: u16 = 262;

/// Value of the tag Compression for Zstandard.
const ZSTD: u16 = 50000;

/// Values of the tag Compression for facsimiles: CCITT's group 3, in one dimension and in two, and group 4.
const FACSIMILE: std::ops::RangeInclusive<u16> = 2..=4;

/// Value of the tag FillOrder for bytes whose bits are turned around.
const BITS_REVERSED: u16 = 2;

/// Value of [`PHOTOMETRIC`] for grey, zero black.
const GREY: u16 = 1;

/// Value of [`PHOTOMETRIC`] for indices into a palette.
const PALETTE: u16 = 3;

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    // The decoder knows no palettes: it is told that the indices are grey.
    let Some(indices) = palette_as_grey(bytes) else { return read_samples(path, bytes) };
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    let palette = decoder.get_tag_u16_vec(Tag::ColorMap).map_err(|e| MapError::invalid(path, e))?;
    // All reds, then all greens, then all blues.
    let count = palette.len() / 3;
    let indices = read_samples(path, &indices)?;
    let largest = match &indices.samples {
        Samples::U8(_) => 255.0,
        Samples::U16(_) => 65535.0,
        Samples::F32(_) => return Err(MapError::unsupported(path, "has a palette beside no whole numbers")),
    };
    let bits = decoder.get_tag_unsigned(Tag::BitsPerSample).unwrap_or(8_u32);
    let largest = if bits < 8 { ((1_u32 << bits) - 1) as f32 } else { largest };
    let index = |i: usize| (indices.samples.get(i) * largest).round() as usize;
    let entries = (0..indices.samples.len()).map(|i| match index(i) {
        at if at < count => Ok([at, count + at, 2 * count + at]),
        at => Err(MapError::invalid(path, format!("has index {at} into a palette of {count} colours"))),
    });
    let entries = entries.collect::<Result<Vec<[usize; 3]>, _>>()?.into_flattened();
    // Writers of 8-bit colours scale them by 256 or 257, or forget to.
    let byte = |v: &u16| v & 255 == 0 || v & 255 == v >> 8;
    let samples = if palette.iter().all(|v| *v < 256) {
        Samples::U8(entries.iter().map(|at| palette[*at] as u8).collect())
    } else if palette.iter().all(byte) {
        Samples::U8(entries.iter().map(|at| (palette[*at] >> 8) as u8).collect())
    } else {
        Samples::U16(entries.iter().map(|at| palette[*at]).collect())
    };
    Image::new(path, indices.size, 3, samples)
}

/// The file with its first image called grey, where that has a palette. (BigTIFF is left as it is.)
fn palette_as_grey(bytes: &[u8]) -> Option<Vec<u8>> {
    let little = bytes.starts_with(b"II*\0");
    let u16_at = |at: usize| -> Option<u16> {
        let two = *bytes.get(at..)?.first_chunk()?;
        Some(if little { u16::from_le_bytes(two) } else { u16::from_be_bytes(two) })
    };
    let four: [u8; 4] = *bytes.get(4..)?.first_chunk()?;
    let directory = if little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) } as usize;
    if !little && !bytes.starts_with(b"MM\0*") {
        return None;
    }
    // Entries of twelve bytes: tag, type, count, value.
    let mut entries = (0..usize::from(u16_at(directory)?)).map(|i| directory + 2 + 12 * i);
    let value = entries.find(|at| u16_at(*at) == Some(PHOTOMETRIC))? + 8;
    if u16_at(value)? != PALETTE {
        return None;
    }
    let mut grey = bytes.to_vec();
    grey[value..value + 2].copy_from_slice(&if little { GREY.to_le_bytes() } else { GREY.to_be_bytes() });
    Some(grey)
}

/// Samples of the first image, as its colours or as grey.
fn read_samples(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let invalid = |e: ::tiff::TiffError| MapError::invalid(path, e);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = MAX_TEXELS * 16;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(invalid)?.with_limits(limits);
    let (width, height) = decoder.dimensions().map_err(invalid)?;
    let size = check_size(path, width as usize, height as usize)?;
    let samples_each = decoder.get_tag_unsigned(Tag::SamplesPerPixel).unwrap_or(1_u16);
    if samples_each > 4 {
        let reason = format!(
            "has {samples_each} channels a texel; up to 4 are read (a bumpslopes texture is read as OpenEXR: \
             `maketx --bumpslopes --format openexr`)"
        );
        return Err(MapError::unsupported(path, reason));
    }
    let (channels, bits) = match decoder.colortype().map_err(invalid)? {
        ColorType::Gray(bits) => (1, bits),
        ColorType::GrayA(bits) => (2, bits),
        ColorType::RGB(bits) => (3, bits),
        ColorType::RGBA(bits) => (4, bits),
        ColorType::Multiband { num_samples, bit_depth } if (1..=4).contains(&num_samples) => {
            (usize::from(num_samples), bit_depth)
        }
        other => {
            return Err(MapError::unsupported(
                path,
                format!("has {other:?} texels; grey, RGB and RGBA are read"),
            ));
        }
    };
    if bits == 0 || bits < 8 && channels > 1 {
        return Err(MapError::unsupported(
            path,
            format!("has {channels} channels of {bits} bits; 8 are read"),
        ));
    }
    let no_data: Option<f32> =
        decoder.get_tag_ascii_string(NO_DATA).ok().and_then(|t| t.trim_end_matches('\0').trim().parse().ok());
    // The compression's ratio bounds what a file this long can hold, as for PNG. Zstandard's blocks of one
    // repeated byte stand for 128 KiB in four; LZW and PackBits stay below Deflate.
    let compression = decoder.get_tag_unsigned(Tag::Compression).unwrap_or(1_u16);
    let most = if compression == ZSTD { 1 << 15 } else { 1032 };
    let sample_bits: u16 = decoder.get_tag_unsigned(Tag::BitsPerSample).unwrap_or(8);
    // A row of a facsimile takes a bit at least.
    let least = match FACSIMILE.contains(&compression) {
        true => size.height / 8,
        false => size.area() / 8 * usize::from(sample_bits.clamp(1, 64)) / most,
    };
    if least > bytes.len() {
        return Err(MapError::invalid(
            path,
            format!("is truncated: {} bytes cannot hold {width} × {height} texels", bytes.len()),
        ));
    }
    if decoder.get_tag_unsigned(Tag::FillOrder).is_ok_and(|order: u16| order == BITS_REVERSED) {
        return Err(MapError::unsupported(
            path,
            "has the bits of its bytes reversed (FillOrder 2): save it without",
        ));
    }
    let tiled = decoder.find_tag(Tag::TileWidth).map_err(invalid)?.is_some();
    if tiled && decoder.get_tag_unsigned(Tag::PlanarConfiguration).is_ok_and(|plan: u16| plan == 2) {
        return Err(MapError::unsupported(
            path,
            "has planes in tiles: save it in strips, or with its channels together",
        ));
    }
    let orientation = orientation(path, decoder.get_tag_unsigned(Tag::Orientation).unwrap_or(1))?;
    let planar = decoder.get_tag_unsigned(Tag::PlanarConfiguration).is_ok_and(|plan: u16| plan == 2);
    let alpha = decoder.find_tag_unsigned_vec(Tag::ExtraSamples).map_err(invalid)?;
    let alpha =
        channels == 2 && alpha.is_some_and(|kinds: Vec<u16>| kinds.iter().any(|k| *k == 1 || *k == 2));
    let mut result = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut result).map_err(invalid)?;
    let samples = match result {
        DecodingResult::U8(v) if bits < 8 => Samples::U16(unpack(&v, size, bits)),
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
    let samples = if planar { samples.interleaved(channels) } else { samples };
    let mut image = Image::new(path, size, channels, samples)?.oriented(orientation);
    if alpha {
        image = image.channels(&[0]);
    }
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

/// Order of texels by the tag Orientation: where the first row and the first column lie.
fn orientation(path: &Path, tag: u16) -> Result<Orientation, MapError> {
    let (transposed, from_right, from_below) = match tag {
        1 => (false, false, false),
        2 => (false, true, false),
        3 => (false, true, true),
        4 => (false, false, true),
        5 => (true, false, false),
        6 => (true, true, false),
        7 => (true, true, true),
        8 => (true, false, true),
        other => return Err(MapError::invalid(path, format!("has orientation {other}; there are 1 to 8"))),
    };
    Ok(Orientation { transposed, from_right, from_below })
}

/// Samples of fewer than eight bits, packed from the highest bit of each row's first byte, over all 16 bits.
fn unpack(packed: &[u8], size: Size, bits: u8) -> Vec<u16> {
    let bits = usize::from(bits);
    let stride = (size.width * bits).div_ceil(8);
    let largest = (1_u32 << bits) - 1;
    let sample = |row: &[u8], x: usize| {
        let bit = |i: usize| u32::from(row[i / 8] >> (7 - i % 8) & 1);
        let code = (x * bits..(x + 1) * bits).fold(0, |code, i| code << 1 | bit(i));
        ((code * 65535 + largest / 2) / largest) as u16
    };
    packed.chunks_exact(stride).flat_map(|row| (0..size.width).map(move |x| sample(row, x))).collect()
}

/// Fills holes with the lowest measured value; returns the number of holes.
fn fill<T: Copy + PartialOrd>(values: &mut [T], is_hole: impl Fn(&T) -> bool) -> usize {
    let lower = |a: T, b: T| if b < a { b } else { a };
    let Some(lowest) = values.iter().copied().filter(|v| !is_hole(v)).reduce(lower) else { return 0 };
    values.iter_mut().filter(|v| is_hole(v)).map(|v| *v = lowest).count()
}
