//! DDS, the container of Direct3D's textures ("Programming Guide for DDS", Microsoft): the first level.
//!
//! Texels are told by a format of DXGI, by a code of four letters, by a number of Direct3D 9's formats in its
//! place, or by masks.

use std::path::Path;

use super::Format;
use super::texels::{Block, Fields, Number, RGB10, Texels};
use crate::image::check_size;
use crate::{Image, MapError};

pub(super) const FORMAT: Format =
    Format { name: "DDS", extensions: &["dds"], magic: &[b"DDS "], ..Format::read_by(read) };

/// First byte behind the plain header.
const HEADER: usize = 128;

/// First byte behind the header that has DXGI's format.
const LONG_HEADER: usize = 148;

/// Flags of the pixel format (DDPF).
mod flag {
    pub(super) const ALPHA_BESIDE: u32 = 0x1;
    pub(super) const ALPHA: u32 = 0x2;
    pub(super) const FOUR_CC: u32 = 0x4;
    pub(super) const RGB: u32 = 0x40;
    pub(super) const LUMINANCE: u32 = 0x2_0000;
    pub(super) const SIGNED: u32 = 0x8_0000;
}

/// Bits of `dwCaps2`: the first face of a cube, all six, and a volume.
const FACE: u32 = 0x400;
const FACES: u32 = 0xFC00;
const VOLUME: u32 = 0x20_0000;

/// Values of DXGI's header: a volume, and a cube.
const DIMENSION_3D: u32 = 4;
const CUBE: u32 = 0x4;

fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let truncated = || MapError::invalid(path, "is truncated within its DDS header");
    let number = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let header = |at: usize| number(at).ok_or_else(truncated);
    let (height, width) = (header(12)? as usize, header(16)? as usize);
    let long = header(80)? & flag::FOUR_CC != 0 && &header(84)?.to_le_bytes() == b"DX10";
    let (caps, depth) = (header(112)?, header(24)?);
    let mut faces = (caps & FACES).count_ones();
    let mut layers = 1;
    let mut volume = caps & VOLUME != 0;
    let texels = if long {
        volume |= header(132)? == DIMENSION_3D;
        layers = header(140)?;
        if header(136)? & CUBE != 0 {
            faces = (FACES / FACE).count_ones();
        }
        of_dxgi(path, header(128)?)?
    } else if header(80)? & flag::FOUR_CC != 0 {
        of_four_cc(path, header(84)?)?
    } else {
        of_masks(path, header(80)?, header(88)?, [header(92)?, header(96)?, header(100)?, header(104)?])?
    };
    let kind = match (volume && depth > 1, faces, layers) {
        (true, ..) => Some(format!("a volume of {depth} layers")),
        (_, 1.., _) => Some(format!("a cube map of {faces} faces")),
        (.., 2..) => Some(format!("an array of {layers} layers")),
        _ => None,
    };
    if let Some(kind) = kind {
        return Err(MapError::unsupported(path, format!("is {kind}; a texture of one picture is read")));
    }
    let size = check_size(path, width, height)?;
    let start = if long { LONG_HEADER } else { HEADER };
    // Rows are not padded, whatever the header's pitch says (as the guide advises).
    let level = bytes.get(start..).unwrap_or_default().get(..texels.bytes(size));
    let level = level.ok_or_else(|| {
        let reason = format!("is truncated: {} bytes cannot hold {width} × {height} texels", bytes.len());
        MapError::invalid(path, reason)
    })?;
    texels.decode(path, size, level)
}

/// Texels of a DXGI format (`dxgiformat.h`). One without a type stands for its unsigned normalised form.
fn of_dxgi(path: &Path, format: u32) -> Result<Texels, MapError> {
    const BYTES: Fields = Fields::of_bytes(4, false);
    let words = |channels: usize| Texels::Numbers(Number::Unorm16, channels);
    Ok(match format {
        1 | 2 => Texels::Numbers(Number::Single, 4),
        5 | 6 => Texels::Numbers(Number::Single, 3),
        10 => Texels::Numbers(Number::Half, 4),
        9 | 11 => words(4),
        13 => Texels::Numbers(Number::Snorm16, 4),
        15 | 16 => Texels::Numbers(Number::Single, 2),
        23 | 24 => Texels::Fields(Fields { masks: RGB10, ..BYTES }),
        27..=29 => Texels::Fields(BYTES),
        31 => Texels::Fields(Fields::of_bytes(4, true)),
        34 => Texels::Numbers(Number::Half, 2),
        33 | 35 => words(2),
        37 => Texels::Numbers(Number::Snorm16, 2),
        39 | 41 => Texels::Numbers(Number::Single, 1),
        48 | 49 => Texels::Fields(Fields::of_bytes(2, false)),
        51 => Texels::Fields(Fields::of_bytes(2, true)),
        54 => Texels::Numbers(Number::Half, 1),
        53 | 56 => words(1),
        58 => Texels::Numbers(Number::Snorm16, 1),
        60 | 61 | 65 => Texels::Fields(Fields::of_bytes(1, false)),
        63 => Texels::Fields(Fields::of_bytes(1, true)),
        70..=72 => Texels::Blocks(Block::Bc1),
        73..=75 => Texels::Blocks(Block::Bc2),
        76..=78 => Texels::Blocks(Block::Bc3),
        79 | 80 => Texels::Blocks(Block::Bc4),
        81 => Texels::Blocks(Block::Bc4Signed),
        82 | 83 => Texels::Blocks(Block::Bc5),
        84 => Texels::Blocks(Block::Bc5Signed),
        85 => Texels::Fields(Fields { bytes: 2, masks: [0xF800, 0x7E0, 0x1F, 0], signed: false }),
        86 => Texels::Fields(Fields { bytes: 2, masks: [0x7C00, 0x3E0, 0x1F, 0x8000], signed: false }),
        87 | 90 | 91 => Texels::Fields(BYTES.blue_first()),
        88 | 92 | 93 => Texels::Fields(Fields { bytes: 4, ..Fields::of_bytes(3, false).blue_first() }),
        94 | 95 => Texels::Blocks(Block::Bc6h),
        96 => Texels::Blocks(Block::Bc6hSigned),
        97..=99 => Texels::Blocks(Block::Bc7),
        115 => Texels::Fields(Fields { bytes: 2, masks: [0xF00, 0xF0, 0xF, 0xF000], signed: false }),
        other => {
            let name = match other {
                26 => "R11G11B10_FLOAT",
                67 => "R9G9B9E5_SHAREDEXP",
                133..=187 => "ASTC",
                _ => "see dxgiformat.h",
            };
            return Err(unread(path, &format!("the DXGI format {other} ({name})")));
        }
    })
}

/// Texels of a code of four letters, or of a number of Direct3D 9's `D3DFORMAT`. Microsoft's guide has `ATI2`
/// for BC5: red, then green.
fn of_four_cc(path: &Path, code: u32) -> Result<Texels, MapError> {
    Ok(match &code.to_le_bytes() {
        b"DXT1" => Texels::Blocks(Block::Bc1),
        b"DXT3" => Texels::Blocks(Block::Bc2),
        b"DXT5" => Texels::Blocks(Block::Bc3),
        b"RXGB" => Texels::Blocks(Block::Bc3RedInAlpha),
        b"ATI1" | b"BC4U" => Texels::Blocks(Block::Bc4),
        b"BC4S" => Texels::Blocks(Block::Bc4Signed),
        b"ATI2" | b"A2XY" | b"BC5U" => Texels::Blocks(Block::Bc5),
        b"BC5S" => Texels::Blocks(Block::Bc5Signed),
        letters => match code {
            36 => Texels::Numbers(Number::Unorm16, 4),
            110 => Texels::Numbers(Number::Snorm16, 4),
            111 => Texels::Numbers(Number::Half, 1),
            112 => Texels::Numbers(Number::Half, 2),
            113 => Texels::Numbers(Number::Half, 4),
            114 => Texels::Numbers(Number::Single, 1),
            115 => Texels::Numbers(Number::Single, 2),
            116 => Texels::Numbers(Number::Single, 4),
            // CxV8U8: z is left to the reader.
            117 => Texels::Fields(Fields::of_bytes(2, true)),
            0..256 => return Err(unread(path, &format!("the Direct3D 9 format {code}"))),
            _ => return Err(unread(path, &format!("the code {}", letters.escape_ascii()))),
        },
    })
}

/// Texels of masks. Luminance with alpha (A8L8) has two channels: Direct3D's tools write R8G8 so. Luminance
/// goes by its size, for Pillow writes masks that lie outside of it. Writers exchange the masks of red and
/// blue in words of 10, 10, 10 and 2 bits (DirectXTex, `DDSPF_A2B10G10R10`).
fn of_masks(path: &Path, flags: u32, bits: u32, masks: [u32; 4]) -> Result<Texels, MapError> {
    let [r, g, b, a] = masks;
    let has = |flag: u32| flags & flag != 0;
    let alpha = if has(flag::ALPHA_BESIDE) { a } else { 0 };
    let masks = if has(flag::SIGNED) {
        [r, g, b, a]
    } else if has(flag::RGB) && g == RGB10[1] {
        [b, g, r, alpha]
    } else if has(flag::RGB) {
        [r, g, b, alpha]
    } else if has(flag::LUMINANCE) {
        [r, 0, 0, alpha]
    } else if has(flag::ALPHA) {
        [0, 0, 0, a]
    } else {
        return Err(unread(path, &format!("the pixel flags {flags:#x}")));
    };
    let inside = |mask: u32| u64::from(mask) >> bits.min(32) == 0;
    let fits = matches!(bits, 8 | 16 | 24 | 32) && masks.into_iter().all(|mask| inside(mask) && is_run(mask));
    match (has(flag::LUMINANCE), bits, alpha) {
        (true, 8, 0) => Ok(Texels::Fields(Fields::of_bytes(1, false))),
        (true, 16, 0) => Ok(Texels::Numbers(Number::Unorm16, 1)),
        (true, 16, _) => Ok(Texels::Fields(Fields::of_bytes(2, false))),
        _ if fits && masks != [0; 4] => {
            Ok(Texels::Fields(Fields { bytes: bits as usize / 8, masks, signed: has(flag::SIGNED) }))
        }
        _ => Err(unread(path, &format!("{bits} bits with the masks {masks:x?}"))),
    }
}

/// True for bits that lie side by side, or none.
fn is_run(mask: u32) -> bool {
    let lowest = mask & mask.wrapping_neg();
    mask & mask.wrapping_add(lowest) == 0
}

fn unread(path: &Path, what: &str) -> MapError {
    MapError::unsupported(path, format!("has texels of {what}; BC1 to BC7 and plain channels are read"))
}
