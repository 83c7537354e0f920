//! Basis Universal, in its own container (.basis) and in KTX2, by the `basisu` crate: ETC1S and UASTC.

use std::borrow::Cow;
use std::path::Path;

use ::basisu::{DecodeFlags, Error, SourceFormat, TargetFormat, Transcoder};
use ::ktx2::{Header as KtxHeader, Index, LevelIndex, SupercompressionScheme};
use ndfmap_core::grid::Size;

use super::Format;
use super::decoded::guarded;
use super::ktx2::Container;
use super::uastc;
use crate::image::{Orientation, check_size};
use crate::{Image, MapError, Samples};

pub(super) const FORMAT: Format = Format {
    name: "Basis Universal",
    extensions: &["basis"],
    // Two letters, and the version of the only format there is.
    magic: &[b"sB\x13\0"],
    ..Format::read_by(read)
};

/// Texels that a byte of ETC1S can stand for: no bound of the format, whose runs have no end.
const TEXELS_PER_BYTE: usize = 32_768;

/// Side of a block, of both codecs.
const SIDE: usize = 4;

/// Colour models of KTX2's data format descriptor.
const ETC1S: u8 = 163;
const UASTC: u8 = uastc::COLOUR_MODEL;

/// Flags of a .basis file: the lowest row comes first, and the colours are those of another file.
const FROM_BELOW: u8 = 2;
const SHARED_COLOURS: u8 = 8;

/// Reads a .basis file (`basis_file_header` of the reference transcoder).
fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let header: &[u8; 77] =
        bytes.first_chunk().ok_or_else(|| MapError::invalid(path, "is truncated within its Basis header"))?;
    let images = u32::from_le_bytes([header[17], header[18], header[19], 0]);
    let kind = match header[23] {
        2 => Some("a cube map".to_owned()),
        3 => Some("a video".to_owned()),
        4 => Some("a volume".to_owned()),
        _ if header[21] & SHARED_COLOURS != 0 => {
            Some("a texture whose colours are in another file".to_owned())
        }
        _ if images > 1 => Some(format!("an array of {images} pictures")),
        _ => None,
    };
    if let Some(kind) = kind {
        return Err(MapError::unsupported(path, format!("is {kind}; a texture of one picture is read")));
    }
    let image = transcoded(path, bytes)?;
    Ok(image.oriented(Orientation { from_below: header[21] & FROM_BELOW != 0, ..Orientation::default() }))
}

/// Reads the picture of a KTX2 file without a Vulkan format.
pub(super) fn read_ktx2(
    path: &Path,
    bytes: &[u8],
    file: &Container<'_>,
    size: Size,
) -> Result<Image, MapError> {
    let descriptor = file.descriptor()?;
    let byte = |at: usize| descriptor.get(at).copied().unwrap_or_default();
    // Colour model, and what the samples are (Khronos Data Format Specification 1.3, sections 5.6.14 and
    // 5.6.16): a texture of two channels has the second in alpha, or as its second sample.
    // None at all stands for those that there are.
    let channels: &[usize] = match (byte(12), byte(31) & 15, byte(47) & 15) {
        (ETC1S, 3, 4) | (UASTC, 5, _) => &[0, 3],
        (ETC1S, 3, _) | (UASTC, 4, _) => &[0],
        (UASTC, 6, _) => &[0, 1],
        (ETC1S | UASTC, ..) => &[],
        (other, ..) => {
            let reason =
                format!("has no Vulkan format, and is of colour model {other}; ETC1S and UASTC are read");
            return Err(MapError::unsupported(path, reason));
        }
    };
    let bytes = match file.header.supercompression_scheme {
        Some(SupercompressionScheme::BasisLZ) => Cow::Borrowed(bytes),
        _ if file.is_compressed()? => decompressed(file, descriptor, size)?.into(),
        _ => Cow::Borrowed(bytes),
    };
    let image = transcoded(path, &bytes)?;
    Ok(if channels.is_empty() { image } else { image.channels(channels) })
}

/// File of the first level of UASTC blocks alone, without Zstandard.
fn decompressed(file: &Container<'_>, descriptor: &[u8], size: Size) -> Result<Vec<u8>, MapError> {
    let length = size.width.div_ceil(SIDE) * size.height.div_ceil(SIDE) * uastc::BLOCK_BYTES;
    let level = file.level(0, length as u64)?;
    let start = KtxHeader::LENGTH + LevelIndex::LENGTH;
    let index = Index {
        dfd_byte_offset: start as u32,
        dfd_byte_length: descriptor.len() as u32,
        kvd_byte_offset: 0,
        kvd_byte_length: 0,
        sgd_byte_offset: 0,
        sgd_byte_length: 0,
    };
    let header = KtxHeader { level_count: 1, supercompression_scheme: None, index, ..file.header };
    let place = LevelIndex {
        byte_offset: (start + descriptor.len()) as u64,
        byte_length: length as u64,
        uncompressed_byte_length: length as u64,
    };
    Ok([&header.as_bytes(), &place.as_bytes() as &[u8], descriptor, &level].concat())
}

/// First picture of a file in either container.
fn transcoded(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let refused =
        |error: Error| MapError::invalid(path, format!("is no sound Basis Universal file: {error:?}"));
    guarded(path, "Basis Universal", || {
        let transcoder = Transcoder::new(bytes).map_err(refused)?;
        let texels_per_byte = match transcoder.source_format() {
            SourceFormat::Etc1s => TEXELS_PER_BYTE,
            SourceFormat::UastcLdr => 1,
            other => {
                let reason = format!("holds Basis Universal {other:?}; ETC1S and UASTC are read");
                return Err(MapError::unsupported(path, reason));
            }
        };
        let info = transcoder.image_level_info(0).map_err(refused)?;
        let size = check_size(path, info.width as usize, info.height as usize)?;
        let blocks = [info.num_blocks_x, info.num_blocks_y].map(|count| count as usize);
        if size.area() / texels_per_byte > bytes.len()
            || blocks != [size.width, size.height].map(|side| side.div_ceil(SIDE))
        {
            let reason = format!(
                "is truncated: {} bytes cannot hold {} × {} texels",
                bytes.len(),
                size.width,
                size.height
            );
            return Err(MapError::invalid(path, reason));
        }
        let texels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(refused)?;
        let image = Image::new(path, size, 4, Samples::U8(texels))?;
        Ok(if transcoder.has_alpha() { image } else { image.channels(&[0, 1, 2]) })
    })?
}
