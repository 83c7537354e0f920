//! A decoded picture in the precision of its file, and the bounds that no file may exceed.

use std::path::Path;

use ndfmap_core::grid::Size;

use crate::MapError;

/// Longest side that readers take. Headers beyond it are refused before anything is allocated.
pub const MAX_SIDE: usize = 32_768;

/// Most texels that readers take: 16384 × 16384.
pub const MAX_TEXELS: usize = 1 << 28;

/// Samples of all texels, channels interleaved, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 8-bit integers, 255 the largest value.
    U8(Vec<u8>),
    /// 16-bit integers, 65535 the largest value.
    U16(Vec<u16>),
    /// Floats, as they are.
    F32(Vec<f32>),
}

impl Samples {
    /// Sample `i` as a float; integers run from 0 to 1.
    #[must_use]
    pub fn get(&self, i: usize) -> f32 {
        match self {
            Self::U8(v) => f32::from(v[i]) / 255.0,
            Self::U16(v) => f32::from(v[i]) / 65535.0,
            Self::F32(v) => v[i],
        }
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8(v) => v.len(),
            Self::U16(v) => v.len(),
            Self::F32(v) => v.len(),
        }
    }

    /// True when there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A decoded picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width and height.
    pub size: Size,
    /// Samples a texel, 1 to 4.
    pub channels: usize,
    /// All samples.
    pub samples: Samples,
    /// Warnings of the reader: oddities that do no harm.
    pub warnings: Vec<String>,
}

impl Image {
    /// Puts a picture together.
    ///
    /// # Errors
    /// [`MapError`] when the number of samples does not fit the size.
    pub fn new(path: &Path, size: Size, channels: usize, samples: Samples) -> Result<Self, MapError> {
        let expected = size.area() * channels;
        if samples.len() != expected || channels == 0 {
            let found = samples.len();
            return Err(MapError::invalid(
                path,
                format!("holds {found} samples where its header says {expected}"),
            ));
        }
        Ok(Self { size, channels, samples, warnings: Vec::new() })
    }
}

/// Checks the sides that a header claims.
///
/// # Errors
/// [`MapError`] when a side is zero or too long, or the area too large.
pub(crate) fn check_size(path: &Path, width: usize, height: usize) -> Result<Size, MapError> {
    let size = Size::new(width, height).map_err(|e| MapError::invalid(path, e))?;
    if width > MAX_SIDE || height > MAX_SIDE || size.area() > MAX_TEXELS {
        let reason = format!(
            "claims {width} × {height} texels; at most {MAX_SIDE} a side and {MAX_TEXELS} in all are read"
        );
        return Err(MapError::unsupported(path, reason));
    }
    Ok(size)
}
