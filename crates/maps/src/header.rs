//! The JSON that travels with a normal distribution map, under the key `ndfmap`. See `docs/formats.md`.

use std::path::Path;

use ndfmap_core::compact::{Bits, Compact, Range};
use ndfmap_core::ndf::Encoding;
use ndfmap_core::surface::{Wrap, Wraps};
use serde::{Deserialize, Serialize};

use crate::MapError;

/// Version of headers of maps in floats, all levels of them.
pub const VERSION: u32 = 1;

/// Version of headers with [`Header::compact`] or [`Header::from_level`], and the highest that is read.
pub const COMPACT_VERSION: u32 = 2;

/// Description of a normal distribution map, stored in its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of this header.
    pub version: u32,
    /// Spelling of the method.
    pub method: String,
    /// Texels in a row of level 0.
    pub width: usize,
    /// Rows of level 0.
    pub height: usize,
    /// Wraps along rows and along columns: `repeat` or `clamp`.
    pub wrap: [String; 2],
    /// Encoding of the channels, such as `sums` or `sums-about-pole`.
    pub encoding: String,
    /// Attributes that each lobe carries, layer after layer behind the lobes' own; empty for linear methods.
    pub attributes: Vec<Attribute>,
    /// Source that the map was baked from.
    pub source: Source,
    /// Storage of the channels as integers; `None` for floats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compact: Option<Integers>,
    /// Level of the source that the map's finest is: finer ones are left out.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub from_level: usize,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands fields on by reference")]
fn is_zero(level: &usize) -> bool {
    *level == 0
}

/// Storage of channels as integers, each in a range of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Integers {
    /// Bits of a channel: 8, 10 or 16.
    pub bits: u32,
    /// Values of 0 and of the greatest integer, for each channel, four a layer.
    pub ranges: Vec<[f32; 2]>,
}

impl Integers {
    /// Description of a compact form.
    #[must_use]
    pub fn of(compact: &Compact) -> Self {
        let ranges = compact.ranges().iter().map(|Range { low, high }| [*low, *high]).collect();
        Self { bits: compact.bits().count(), ranges }
    }

    /// Compact form that it describes, of the channels of an encoding in so many RGBA layers.
    ///
    /// # Errors
    /// [`MapError`] for bits that there are not, and for ranges that are none; `path` is for the message.
    pub fn compact(&self, path: &Path, encoding: Encoding, layers: usize) -> Result<Compact, MapError> {
        let bits = Bits::ALL.into_iter().find(|bits| bits.count() == self.bits);
        let unknown = || MapError::unsupported(path, format!("has channels of {} bits", self.bits));
        let ranges: Vec<Range> =
            self.ranges.iter().map(|[low, high]| Range { low: *low, high: *high }).collect();
        if ranges.len() != 4 * layers || !ranges.iter().all(|range| range.is_sound()) {
            return Err(MapError::invalid(path, "its header has no sound range for each channel"));
        }
        Ok(Compact::new(bits.ok_or_else(unknown)?, ranges, encoding))
    }
}

/// Attribute: a map whose values each lobe carries, times its weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attribute {
    /// File name without folders.
    pub name: String,
    /// Channels in use, 1 to 4; the others are those of `(0, 0, 0, 1)`.
    pub channels: usize,
    /// Transfer of the file: `linear`, or `srgb` when its values were decoded from sRGB. The map's own are
    /// always linear.
    pub transfer: String,
}

/// Source that a map was baked from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// File name without folders, or `builtin:NAME`.
    pub file: String,
    /// Kind of the source: normals or heights.
    pub kind: SourceKind,
    /// SHA-256 of the file, in hexadecimal; empty for built-in maps.
    pub sha256: String,
    /// Texture widths per unit of height, for heights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_scale: Option<f64>,
    /// Direction of the file's green, for normals: `opengl` or `directx`. The map is always y up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convention: Option<String>,
}

/// Kind of a source: normals or heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SourceKind {
    /// A normal map.
    Normal,
    /// A height map.
    Height,
}

impl Header {
    /// Spells [`Wraps`].
    #[must_use]
    pub fn spell_wraps(wraps: Wraps) -> [String; 2] {
        [wraps.x, wraps.y].map(|wrap| wrap.to_string())
    }

    /// [`Wraps`] that the header spells.
    ///
    /// # Errors
    /// [`MapError`] for any other word.
    pub fn wraps(&self, path: &Path) -> Result<Wraps, MapError> {
        let wrap = |word: &str| {
            let unknown = |_| MapError::invalid(path, format!("its header has the unknown wrap `{word}`"));
            word.parse::<Wrap>().map_err(unknown)
        };
        Ok(Wraps { x: wrap(&self.wrap[0])?, y: wrap(&self.wrap[1])? })
    }

    /// JSON text of the header.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|e| unreachable!("a header has string keys only: {e}"))
    }

    /// Reads the JSON text.
    ///
    /// # Errors
    /// [`MapError`] when the text is no header, or a newer one.
    pub fn from_json(path: &Path, text: &str) -> Result<Self, MapError> {
        let header: Self = serde_json::from_str(text)
            .map_err(|e| MapError::invalid(path, format!("its `ndfmap` key cannot be read: {e}")))?;
        if header.version > COMPACT_VERSION {
            let reason =
                format!("has header version {}; this program reads up to {COMPACT_VERSION}", header.version);
            return Err(MapError::unsupported(path, reason));
        }
        Ok(header)
    }
}
