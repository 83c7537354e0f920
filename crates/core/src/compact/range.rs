//! Ranges of channels, found in two looks: how far the values of each reach, and how they are spread over
//! that.

/// Range of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Value of 0.
    pub low: f32,
    /// Value of the greatest integer, at least `low`.
    pub high: f32,
}

impl Range {
    /// Range of nothing yet.
    const EMPTY: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY };

    /// True for a range that values can be taken to.
    #[must_use]
    pub fn is_sound(self) -> bool {
        self.low.is_finite() && (self.high - self.low).is_finite() && self.low <= self.high
    }
}

/// Ranges of all channels that a map fills, while it is looked through.
#[derive(Clone, Debug)]
pub struct Extent(Vec<Range>);

impl Extent {
    /// Extent of no texels, for so many RGBA layers.
    #[must_use]
    pub fn new(layers: usize) -> Self {
        Self(vec![Range::EMPTY; 4 * layers])
    }

    /// Takes texels of a layer in.
    pub fn add(&mut self, layer: usize, texels: &[f32]) {
        for texel in texels.as_chunks::<4>().0 {
            for (range, value) in self.0[4 * layer..][..4].iter_mut().zip(texel) {
                *range = Range { low: range.low.min(*value), high: range.high.max(*value) };
            }
        }
    }

    /// Ranges of the channels; that of 0 where nothing was taken in, or what is no number.
    pub(super) fn ranges(&self) -> Vec<Range> {
        // A zero has one sign, whichever came first.
        let plain = |range: &Range| Range { low: range.low + 0.0, high: range.high + 0.0 };
        let sound =
            |range: &Range| if range.is_sound() { plain(range) } else { Range { low: 0.0, high: 0.0 } };
        self.0.iter().map(sound).collect()
    }
}

/// Spread of the values of each channel over its extent, by which its range is chosen.
#[derive(Clone, Debug)]
pub struct Spread {
    extent: Extent,
    /// Values in each of [`BINS`] equal parts of each channel's extent.
    counts: Vec<Vec<u64>>,
}

/// Parts of an extent that are told apart.
const BINS: usize = 4096;

impl Spread {
    /// Spread of no texels, over an extent that holds all that are to come.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        let counts = vec![vec![0; BINS]; extent.0.len()];
        Self { extent, counts }
    }

    /// Takes texels of a layer in.
    pub fn add(&mut self, layer: usize, texels: &[f32]) {
        for texel in texels.as_chunks::<4>().0 {
            for (c, value) in (4 * layer..).zip(texel) {
                let Range { low, high } = self.extent.0[c];
                let part = f64::from(value - low) / f64::from(high - low);
                // Where all values are one, that is no number, and the first part is as good as any.
                self.counts[c][((part * BINS as f64) as usize).min(BINS - 1)] += 1;
            }
        }
    }

    /// Range of a channel with this share of its values beyond either end, and 0 within.
    pub(super) fn within(&self, channel: usize, outside: f64) -> Range {
        let (counts, Range { low, high }) = (&self.counts[channel], self.extent.ranges()[channel]);
        let most = (counts.iter().sum::<u64>() as f64 * outside) as u64;
        let cut = |counts: &mut dyn Iterator<Item = &u64>| {
            let mut gone = 0;
            counts
                .take_while(|count| {
                    gone += **count;
                    gone <= most
                })
                .count()
        };
        let (below, above) = (cut(&mut counts.iter()), cut(&mut counts.iter().rev()));
        let step = (f64::from(high) - f64::from(low)) / BINS as f64;
        Range {
            low: ((f64::from(low) + step * below as f64) as f32).min(0.0) + 0.0,
            high: ((f64::from(high) - step * above as f64) as f32).max(0.0) + 0.0,
        }
    }
}
