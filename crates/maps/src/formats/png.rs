//! PNG, 8 and 16 bits, by the `png` crate. A damaged ancillary chunk (colour profile, text) is ignored:
//! normal maps have no colours to manage.

use std::io::Cursor;
use std::path::Path;

use ::png::{BitDepth, ColorType, DecodeOptions, Decoder, Limits, Transformations};
use ndfmap_core::grid::Size;

use super::{EncodedPicture, Format, WritePicture};
use crate::image::check_size;
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "PNG",
    extensions: &["png"],
    magic: &[b"\x89PNG\r\n\x1a\n"],
    write_picture: Some(WritePicture::Display(encode)),
    ..Format::read_by(read)
};

/// Deflate cannot shrink below 1/1032 of its output.
const MAX_DEFLATE_RATIO: usize = 1032;

/// PNG file of an 8-bit RGB picture.
///
/// # Errors
/// Failure of the encoder, as text.
pub fn encode(pixels: &[[u8; 3]], size: Size) -> EncodedPicture {
    encoded(pixels.as_flattened(), size, ColorType::Rgb)
}

/// PNG file of an 8-bit RGBA picture.
///
/// # Errors
/// Failure of the encoder, as text.
pub(super) fn encode_rgba(pixels: &[[u8; 4]], size: Size) -> EncodedPicture {
    encoded(pixels.as_flattened(), size, ColorType::Rgba)
}

fn encoded(samples: &[u8], size: Size, colour: ColorType) -> EncodedPicture {
    let encode = || {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, size.width as u32, size.height as u32);
        encoder.set_color(colour);
        encoder.set_depth(BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(samples)?;
        writer.finish()?;
        Ok(bytes)
    };
    encode().map_err(|e: ::png::EncodingError| e.to_string())
}

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let invalid = |e: ::png::DecodingError| MapError::invalid(path, e);
    let mut options = DecodeOptions::default();
    options.set_ignore_iccp_chunk(true);
    options.set_ignore_text_chunk(true);
    options.set_skip_ancillary_crc_failures(true);
    let mut decoder = Decoder::new_with_options(Cursor::new(bytes), options);
    decoder.set_limits(Limits { bytes: usize::MAX });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(invalid)?;
    let info = reader.info();
    let size = check_size(path, info.width as usize, info.height as usize)?;
    // Rows as they are deflated, a bit a texel perhaps.
    if info.raw_bytes() / MAX_DEFLATE_RATIO > bytes.len() {
        let reason = format!(
            "is truncated: {} bytes cannot hold {} × {} texels",
            bytes.len(),
            size.width,
            size.height
        );
        return Err(MapError::invalid(path, reason));
    }
    let length = reader.output_buffer_size().unwrap_or(usize::MAX);
    let mut buffer = vec![0; length];
    let frame = reader.next_frame(&mut buffer).map_err(invalid)?;
    // Data after the picture may be missing; the picture itself is whole here.
    let channels = match frame.color_type {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
        ColorType::Indexed => return Err(MapError::invalid(path, "has a palette that did not expand")),
    };
    let samples = match frame.bit_depth {
        BitDepth::Sixteen => {
            Samples::U16(buffer.as_chunks::<2>().0.iter().map(|b| u16::from_be_bytes(*b)).collect())
        }
        _ => Samples::U8(buffer),
    };
    // Grey with alpha is a grey picture: alpha means nothing to a height map.
    let image = Image::new(path, size, channels, samples)?;
    Ok(if channels == 2 { image.channels(&[0]) } else { image })
}
