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

    /// Samples at these places, in this order.
    #[must_use]
    pub(crate) fn gathered(&self, places: impl Iterator<Item = usize>) -> Self {
        match self {
            Self::U8(v) => Self::U8(places.map(|i| v[i]).collect()),
            Self::U16(v) => Self::U16(places.map(|i| v[i]).collect()),
            Self::F32(v) => Self::F32(places.map(|i| v[i]).collect()),
        }
    }

    /// Samples of planes one after another, channels interleaved.
    #[cfg(feature = "tiff")]
    #[must_use]
    pub(crate) fn interleaved(&self, channels: usize) -> Self {
        let area = self.len() / channels;
        self.gathered((0..area * channels).map(|i| i % channels * area + i / channels))
    }

    /// Samples of texels whose channels come from these sources.
    fn composed(&self, channels: usize, chosen: &[Component]) -> Self {
        fn compose<T: Copy>(
            texels: &[T],
            channels: usize,
            chosen: &[Component],
            [zero, one]: [T; 2],
        ) -> Vec<T> {
            let sample = |texel: &[T], component: &Component| match component {
                Component::Zero => zero,
                Component::One => one,
                Component::Channel(channel) => texel[*channel],
            };
            let texels = texels.chunks_exact(channels);
            texels.flat_map(|texel| chosen.iter().map(move |component| sample(texel, component))).collect()
        }
        match self {
            Self::U8(v) => Self::U8(compose(v, channels, chosen, [0, u8::MAX])),
            Self::U16(v) => Self::U16(compose(v, channels, chosen, [0, u16::MAX])),
            Self::F32(v) => Self::F32(compose(v, channels, chosen, [0.0, 1.0])),
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
    /// True where the format says that samples run from -1 to 1. Other floats may or may not.
    pub signed: bool,
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
        Ok(Self { size, channels, samples, signed: false, warnings: Vec::new() })
    }
}

/// Source of a channel of a composed picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    /// The value 0.
    Zero,
    /// The largest value of integers, and 1 of floats.
    One,
    /// A channel.
    Channel(usize),
}

/// Order in which a file holds its texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Orientation {
    /// Stored rows are columns of the picture.
    pub(crate) transposed: bool,
    /// Texels run from the right of the picture to its left.
    pub(crate) from_right: bool,
    /// Texels run from the bottom of the picture to its top.
    pub(crate) from_below: bool,
}

impl Image {
    /// The picture of texels that were stored in this order.
    #[must_use]
    pub(crate) fn oriented(self, orientation: Orientation) -> Self {
        if orientation == Orientation::default() {
            return self;
        }
        let (stored, channels) = (self.size, self.channels);
        let size = match orientation.transposed {
            true => Size { width: stored.height, height: stored.width },
            false => stored,
        };
        let texel = |i: usize| {
            let (x, y) = (i % size.width, i / size.width);
            let x = if orientation.from_right { size.width - 1 - x } else { x };
            let y = if orientation.from_below { size.height - 1 - y } else { y };
            let (column, row) = if orientation.transposed { (y, x) } else { (x, y) };
            row * stored.width + column
        };
        let places = (0..size.area()).flat_map(|i| {
            let first = texel(i) * channels;
            first..first + channels
        });
        Self { size, samples: self.samples.gathered(places), ..self }
    }

    /// The picture of these channels alone, in this order.
    #[must_use]
    pub(crate) fn channels(self, chosen: &[usize]) -> Self {
        let places = (0..self.size.area()).flat_map(|i| chosen.iter().map(move |c| i * self.channels + c));
        Self { channels: chosen.len(), samples: self.samples.gathered(places), ..self }
    }

    /// The picture whose channels come from these sources.
    #[must_use]
    pub(crate) fn composed(self, chosen: &[Component]) -> Self {
        Self { channels: chosen.len(), samples: self.samples.composed(self.channels, chosen), ..self }
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
