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

    /// The same samples of planes one after another, channels interleaved.
    #[cfg(feature = "tiff")]
    pub(crate) fn interleaved(self, channels: usize) -> Self {
        fn weave<T: Copy>(planes: &[T], channels: usize) -> Vec<T> {
            let area = planes.len() / channels;
            (0..area * channels).map(|i| planes[i % channels * area + i / channels]).collect()
        }
        match self {
            Self::U8(v) => Self::U8(weave(&v, channels)),
            Self::U16(v) => Self::U16(weave(&v, channels)),
            Self::F32(v) => Self::F32(weave(&v, channels)),
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
        let samples = match &self.samples {
            Samples::U8(v) => Samples::U8(gather(v, channels, size, texel)),
            Samples::U16(v) => Samples::U16(gather(v, channels, size, texel)),
            Samples::F32(v) => Samples::F32(gather(v, channels, size, texel)),
        };
        Self { size, samples, ..self }
    }

    /// The picture in a larger or smaller frame, its first texel at a place of that; the rest is 0.
    #[must_use]
    pub(crate) fn within(self, frame: Size, place: [i32; 2]) -> Self {
        let Samples::F32(values) = &self.samples else { return self };
        let (size, channels) = (self.size, self.channels);
        let inside = |at: usize, place: i32, length: usize| {
            usize::try_from(at as i64 - i64::from(place)).ok().filter(|at| *at < length)
        };
        let mut framed = vec![0.0; frame.area() * channels];
        for (i, texel) in framed.chunks_exact_mut(channels).enumerate() {
            let x = inside(i % frame.width, place[0], size.width);
            let y = inside(i / frame.width, place[1], size.height);
            if let (Some(x), Some(y)) = (x, y) {
                texel.copy_from_slice(&values[(y * size.width + x) * channels..][..channels]);
            }
        }
        Self { size: frame, samples: Samples::F32(framed), ..self }
    }

    /// The first channels alone.
    #[must_use]
    pub(crate) fn first_channels(self, count: usize) -> Self {
        let keep = |i: &usize| i % self.channels < count;
        let kept = (0..self.samples.len()).filter(keep);
        let samples = match &self.samples {
            Samples::U8(v) => Samples::U8(kept.map(|i| v[i]).collect()),
            Samples::U16(v) => Samples::U16(kept.map(|i| v[i]).collect()),
            Samples::F32(v) => Samples::F32(kept.map(|i| v[i]).collect()),
        };
        Self { channels: count, samples, ..self }
    }
}

/// Samples of texels in another order: texel `i` of the result is `texel(i)` of the values.
fn gather<T: Copy>(values: &[T], channels: usize, size: Size, texel: impl Fn(usize) -> usize) -> Vec<T> {
    (0..size.area()).flat_map(|i| values[texel(i) * channels..][..channels].iter().copied()).collect()
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
