//! Attributes: pictures of the map's size (albedo, material weights) whose values each fitted lobe is to
//! carry.

use std::path::Path;

use ndfmap_core::grid::{Grid, Size};

use crate::formats::{read_file, read_image};
use crate::{Attribute, Image, MapError};

/// Transfer function of an attribute's values in its file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Transfer {
    /// Values as they are.
    #[default]
    Linear,
    /// sRGB, whose first three channels are decoded: colours mix only when linear.
    Srgb,
}

/// An attribute and its values, `(0, 0, 0, 1)` where a channel is missing.
pub struct AttributeMap {
    /// Description of the attribute, for headers.
    pub attribute: Attribute,
    /// Values, one a fine texel.
    pub values: Grid<[f32; 4]>,
}

/// Reads an attribute for a map of this size.
///
/// # Errors
/// [`MapError`] when the file cannot be read, has another size, or holds values that are not finite.
pub fn read_attribute(path: &Path, transfer: Transfer, size: Size) -> Result<AttributeMap, MapError> {
    let image = read_image(path, &read_file(path)?)?;
    if image.size != size {
        let (found, due) = (image.size, size);
        return Err(MapError::unsupported(
            path,
            format!(
                "is {} × {}; an attribute must be as large as the map, {} × {}",
                found.width, found.height, due.width, due.height
            ),
        ));
    }
    attribute_of_image(path, &image, transfer)
}

/// Takes a decoded picture as an attribute.
///
/// # Errors
/// [`MapError`] when it holds values that are not finite.
pub fn attribute_of_image(path: &Path, image: &Image, transfer: Transfer) -> Result<AttributeMap, MapError> {
    let channels = image.channels.min(4);
    let value = |x: usize, y: usize| {
        let first = (y * image.size.width + x) * image.channels;
        let mut value = [0.0, 0.0, 0.0, 1.0];
        for (c, value) in value.iter_mut().enumerate().take(channels) {
            let stored = image.samples.get(first + c);
            *value = if transfer == Transfer::Srgb && c < 3 { linear(stored) } else { stored };
        }
        value
    };
    let values = Grid::from_fn(image.size, value);
    if values.texels().iter().flatten().any(|v| !v.is_finite()) {
        return Err(MapError::invalid(path, "holds values that are not finite, and cannot be an attribute"));
    }
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let transfer = match transfer {
        Transfer::Linear => "linear",
        Transfer::Srgb => "srgb",
    };
    Ok(AttributeMap { attribute: Attribute { name, channels, transfer: transfer.to_owned() }, values })
}

/// Linear light of an sRGB value (IEC 61966-2-1).
fn linear(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
