//! KTX2 as a texture: its first level, whatever Vulkan format or Basis Universal codec that is in.

use std::path::Path;

use ::ktx2::Format as VkFormat;

use super::KEY;
use super::container::Container;
#[cfg(feature = "basis")]
use crate::formats::basis;
use crate::formats::texels::{Block, Fields, Number, RGB10, Texels};
use crate::image::{Component, Orientation, check_size};
use crate::{Image, MapError};

/// Key of the order of rows, columns and slices.
const ORIENTATION: &str = "KTXorientation";

/// Key of the channels that red, green, blue and alpha are taken from.
const SWIZZLE: &str = "KTXswizzle";

/// Reads the texture of a file without our own key.
pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let file = Container::new(path, bytes)?;
    if file.value(KEY)?.is_some() {
        return Err(MapError::baked(path));
    }
    let header = &file.header;
    let kind = match (header.pixel_depth, header.face_count, header.layer_count) {
        (0, 1, 0..=1) => None,
        (0, 1, layers) => Some(format!("an array of {layers} layers")),
        (0, faces, _) => Some(format!("a cube map of {faces} faces")),
        (depth, ..) => Some(format!("a volume of {depth} layers")),
    };
    if let Some(kind) = kind {
        return Err(MapError::unsupported(path, format!("is {kind}; a texture of one picture is read")));
    }
    let size = check_size(path, header.pixel_width as usize, header.pixel_height as usize)?;
    let image = match header.format {
        Some(format) => {
            let texels = texels(path, format)?;
            texels.decode(path, size, &file.level(0, texels.bytes(size) as u64)?)?
        }
        #[cfg(feature = "basis")]
        None => basis::read_ktx2(path, bytes, &file, size)?,
        #[cfg(not(feature = "basis"))]
        None => {
            return Err(MapError::unsupported(path, "holds Basis Universal, which this build does not read"));
        }
    };
    let image = match file.value(SWIZZLE)? {
        Some(swizzle) => swizzled(path, image, swizzle)?,
        None => image,
    };
    let (from_right, from_below) = match file.value(ORIENTATION)?.unwrap_or("rd") {
        "rd" => (false, false),
        "ru" => (false, true),
        "ld" => (true, false),
        "lu" => (true, true),
        other => {
            let reason = format!("has a {ORIENTATION} of `{other}`; rd, ru, ld and lu are read");
            return Err(MapError::unsupported(path, reason));
        }
    };
    Ok(image.oriented(Orientation { transposed: false, from_right, from_below }))
}

/// Texels of a Vulkan format. Packed words are little-endian, their channels named from the highest bits.
fn texels(path: &Path, format: VkFormat) -> Result<Texels, MapError> {
    let bytes = |channels: usize, signed: bool| Fields::of_bytes(channels, signed);
    let ten = Fields { masks: RGB10, ..bytes(4, false) };
    Ok(match format {
        VkFormat::R8_UNORM | VkFormat::R8_SRGB => Texels::Fields(bytes(1, false)),
        VkFormat::R8_SNORM => Texels::Fields(bytes(1, true)),
        VkFormat::R8G8_UNORM | VkFormat::R8G8_SRGB => Texels::Fields(bytes(2, false)),
        VkFormat::R8G8_SNORM => Texels::Fields(bytes(2, true)),
        VkFormat::R8G8B8_UNORM | VkFormat::R8G8B8_SRGB => Texels::Fields(bytes(3, false)),
        VkFormat::R8G8B8_SNORM => Texels::Fields(bytes(3, true)),
        VkFormat::B8G8R8_UNORM | VkFormat::B8G8R8_SRGB => Texels::Fields(bytes(3, false).blue_first()),
        VkFormat::B8G8R8_SNORM => Texels::Fields(bytes(3, true).blue_first()),
        VkFormat::R8G8B8A8_UNORM
        | VkFormat::R8G8B8A8_SRGB
        | VkFormat::A8B8G8R8_UNORM_PACK32
        | VkFormat::A8B8G8R8_SRGB_PACK32 => Texels::Fields(bytes(4, false)),
        VkFormat::R8G8B8A8_SNORM | VkFormat::A8B8G8R8_SNORM_PACK32 => Texels::Fields(bytes(4, true)),
        VkFormat::B8G8R8A8_UNORM | VkFormat::B8G8R8A8_SRGB => Texels::Fields(bytes(4, false).blue_first()),
        VkFormat::B8G8R8A8_SNORM => Texels::Fields(bytes(4, true).blue_first()),
        VkFormat::A2B10G10R10_UNORM_PACK32 => Texels::Fields(ten),
        VkFormat::A2R10G10B10_UNORM_PACK32 => Texels::Fields(ten.blue_first()),
        VkFormat::R16_UNORM => Texels::Numbers(Number::Unorm16, 1),
        VkFormat::R16_SNORM => Texels::Numbers(Number::Snorm16, 1),
        VkFormat::R16_SFLOAT => Texels::Numbers(Number::Half, 1),
        VkFormat::R16G16_UNORM => Texels::Numbers(Number::Unorm16, 2),
        VkFormat::R16G16_SNORM => Texels::Numbers(Number::Snorm16, 2),
        VkFormat::R16G16_SFLOAT => Texels::Numbers(Number::Half, 2),
        VkFormat::R16G16B16_UNORM => Texels::Numbers(Number::Unorm16, 3),
        VkFormat::R16G16B16_SNORM => Texels::Numbers(Number::Snorm16, 3),
        VkFormat::R16G16B16_SFLOAT => Texels::Numbers(Number::Half, 3),
        VkFormat::R16G16B16A16_UNORM => Texels::Numbers(Number::Unorm16, 4),
        VkFormat::R16G16B16A16_SNORM => Texels::Numbers(Number::Snorm16, 4),
        VkFormat::R16G16B16A16_SFLOAT => Texels::Numbers(Number::Half, 4),
        VkFormat::R32_SFLOAT => Texels::Numbers(Number::Single, 1),
        VkFormat::R32G32_SFLOAT => Texels::Numbers(Number::Single, 2),
        VkFormat::R32G32B32_SFLOAT => Texels::Numbers(Number::Single, 3),
        VkFormat::R32G32B32A32_SFLOAT => Texels::Numbers(Number::Single, 4),
        VkFormat::BC1_RGB_UNORM_BLOCK | VkFormat::BC1_RGB_SRGB_BLOCK => Texels::Blocks(Block::Bc1Opaque),
        VkFormat::BC1_RGBA_UNORM_BLOCK | VkFormat::BC1_RGBA_SRGB_BLOCK => Texels::Blocks(Block::Bc1),
        VkFormat::BC2_UNORM_BLOCK | VkFormat::BC2_SRGB_BLOCK => Texels::Blocks(Block::Bc2),
        VkFormat::BC3_UNORM_BLOCK | VkFormat::BC3_SRGB_BLOCK => Texels::Blocks(Block::Bc3),
        VkFormat::BC4_UNORM_BLOCK => Texels::Blocks(Block::Bc4),
        VkFormat::BC4_SNORM_BLOCK => Texels::Blocks(Block::Bc4Signed),
        VkFormat::BC5_UNORM_BLOCK => Texels::Blocks(Block::Bc5),
        VkFormat::BC5_SNORM_BLOCK => Texels::Blocks(Block::Bc5Signed),
        VkFormat::BC6H_UFLOAT_BLOCK => Texels::Blocks(Block::Bc6h),
        VkFormat::BC6H_SFLOAT_BLOCK => Texels::Blocks(Block::Bc6hSigned),
        VkFormat::BC7_UNORM_BLOCK | VkFormat::BC7_SRGB_BLOCK => Texels::Blocks(Block::Bc7),
        other => {
            let reason = format!("has texels of {other:?}; BC1 to BC7 and plain channels are read");
            return Err(MapError::unsupported(path, reason));
        }
    })
}

/// The picture whose red, green, blue and alpha are taken from the channels that these letters name (KTX 2.0,
/// `KTXswizzle`). Missing colours are 0, and missing alpha is 1, as a sampler has them.
///
/// `rrr` means grey, alone or beside a second channel. Constants at the end are left out: a picture of two
/// channels stays one.
fn swizzled(path: &Path, image: Image, letters: &str) -> Result<Image, MapError> {
    let component = |letter: char| match letter {
        '0' => Some(Component::Zero),
        '1' => Some(Component::One),
        letter => match "rgba".find(letter)? {
            channel if channel < image.channels => Some(Component::Channel(channel)),
            3 => Some(Component::One),
            _ => Some(Component::Zero),
        },
    };
    let chosen: Option<Vec<Component>> = letters.chars().map(component).collect();
    let Some(mut chosen) = chosen.filter(|chosen| chosen.len() == 4) else {
        let reason = format!("has a {SWIZZLE} of `{letters}`; four of r, g, b, a, 0 and 1 are read");
        return Err(MapError::invalid(path, reason));
    };
    if chosen[0] == chosen[1] && chosen[1] == chosen[2] {
        chosen.drain(1..3);
    }
    while chosen.len() > 1 && !matches!(chosen[chosen.len() - 1], Component::Channel(_)) {
        chosen.pop();
    }
    Ok(image.composed(&chosen))
}
