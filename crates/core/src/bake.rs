//! Baking: from the finest level to every level of a normal distribution map, in bands of rows.
//!
//! Each texel is the exact area-weighted mean of the finest texels under it. A level is averaged from
//! the coarsest finer level whose texels nest in its own, which for powers of two is the one before, and
//! from the surface itself where none nests. Level 0 is never held in floats: it is written band by band
//! while level 1 is summed. Bands are fixed by the map, not by the number of threads, so the bytes are too.

use std::ops::Range;

use rayon::prelude::*;

use crate::grid::Size;
use crate::ndf::Method;
use crate::pyramid::{Layout, LevelMismatch, Precision, Pyramid, footprint, level_sizes};
use crate::surface::{Surface, SurfaceRow};

/// Where rows of stored texels belong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Level, 0 the finest.
    pub level: usize,
    /// RGBA layer.
    pub layer: usize,
    /// First of the rows.
    pub row: usize,
}

/// Takes the stored rows of a bake, in any order of places, each place once.
pub trait LevelSink {
    /// What can go wrong while writing.
    type Error;

    /// Takes whole rows of one layer of one level.
    ///
    /// # Errors
    /// Whatever the sink meets; the bake stops and hands it on.
    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), Self::Error>;
}

/// A bake to be done.
pub struct Bake<'a> {
    /// The finest level.
    pub surface: &'a dyn Surface,
    /// The representation.
    pub method: &'a dyn Method,
    /// Bits of a stored channel.
    pub precision: Precision,
    /// Called now and then with the fraction done, from one thread.
    pub progress: &'a (dyn Fn(f64) + Sync),
}

/// What a bake met on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BakeReport {
    /// Channels too large for the precision, which became infinite.
    pub overflowed: usize,
}

/// Level-1 rows that one task makes: large enough to amortise, small enough to stay in cache.
const BAND: usize = 16;

/// Tasks whose results may wait for the sink at once.
const WAVE: usize = 8;

impl Bake<'_> {
    /// Size, layers and precision of what will come out.
    #[must_use]
    pub fn layout(&self) -> Layout {
        Layout {
            size: self.surface.size(),
            layers: self.method.layers(),
            precision: self.precision,
            wraps: self.surface.wraps(),
        }
    }

    /// Bakes into memory.
    #[must_use]
    pub fn to_pyramid(&self) -> (Pyramid, BakeReport) {
        let mut sink = MemorySink::new(self.layout());
        let report = self.run(&mut sink).unwrap_or_else(|never| match never {});
        (sink.finish(), report)
    }

    /// Bakes into `sink`, every level down to 1 × 1.
    ///
    /// # Errors
    /// The first error of the sink.
    pub fn run<S: LevelSink>(&self, sink: &mut S) -> Result<BakeReport, S::Error> {
        let sizes = level_sizes(self.surface.size());
        let mut report = BakeReport::default();
        let mut sums: Vec<Option<Sums>> = vec![None; sizes.len()];
        if sizes.len() == 1 {
            let band = self.fine_band(&(0..1), sizes[0]);
            report.overflowed += band.overflowed;
            write_rows(sink, 0, 0, &band.layers)?;
            return Ok(report);
        }
        sums[1] = Some(self.finest_two(&sizes, sink, &mut report)?);
        for level in 1..sizes.len() {
            if level > 1 {
                sums[level] = Some(self.coarser(&sizes, level, &sums));
            }
            let Some(made) = &sums[level] else { continue };
            report.overflowed += self.write_level(sink, level, made)?;
            for (finer, slot) in sums.iter_mut().enumerate().take(level) {
                if (level + 1..sizes.len()).all(|later| nearest_nesting(&sizes, later) != finer) {
                    *slot = None;
                }
            }
            (self.progress)(1.0 - 0.1 * (sizes.len() - 1 - level) as f64 / sizes.len() as f64);
        }
        Ok(report)
    }

    /// Writes level 0 band by band and returns the sums of level 1.
    fn finest_two<S: LevelSink>(
        &self,
        sizes: &[Size],
        sink: &mut S,
        report: &mut BakeReport,
    ) -> Result<Sums, S::Error> {
        let (fine, coarse) = (sizes[0], sizes[1]);
        let mut level1 = Sums::zero(coarse, self.method.layers());
        let bands: Vec<Range<usize>> =
            (0..coarse.height).step_by(BAND).map(|r| r..(r + BAND).min(coarse.height)).collect();
        for wave in bands.chunks(WAVE * rayon::current_num_threads()) {
            let made: Vec<Band> = wave.par_iter().map(|rows| self.fine_band(rows, coarse)).collect();
            for (rows, band) in wave.iter().zip(made) {
                let first = rows.start * fine.height / coarse.height;
                write_rows(sink, 0, first, &band.layers)?;
                report.overflowed += band.overflowed;
                level1.place(rows, &band.level1);
            }
            let done = wave.last().map_or(0, |rows| rows.end);
            (self.progress)(0.9 * done as f64 / coarse.height as f64);
        }
        Ok(level1)
    }

    /// The stored rows of level 0 that belong to level-1 `rows`, and those level-1 sums.
    fn fine_band(&self, rows: &Range<usize>, coarse: Size) -> Band {
        let (fine, layers) = (self.surface.size(), self.method.layers());
        let mut row = SurfaceRow::flat(fine.width);
        let mut values = vec![0.0; fine.width * 4 * layers];
        let mut averager = RowAverager::new(fine.width, coarse.width);
        let mut band = Band {
            layers: vec![Vec::new(); layers],
            level1: Sums::zero(Size { height: rows.len(), ..coarse }, layers),
            overflowed: 0,
        };
        let written = rows.start * fine.height / coarse.height..rows.end * fine.height / coarse.height;
        for bytes in &mut band.layers {
            bytes.reserve_exact(written.len() * fine.width * self.precision.texel_bytes());
        }
        let covered = written.start..(rows.end * fine.height).div_ceil(coarse.height);
        for y in covered {
            self.surface.read_row(y, &mut row);
            self.method.accumulate_row(&row, &mut values);
            for j in rows.clone() {
                let (range, weight) = footprint(fine.height, coarse.height, j);
                if range.contains(&y) {
                    band.level1.add_row(j - rows.start, &values, weight(y) as f32, &mut averager);
                }
            }
            if written.contains(&y) {
                self.method.finish_row(&mut values);
                for (values, bytes) in values.chunks_exact(fine.width * 4).zip(&mut band.layers) {
                    band.overflowed += self.precision.pack(values, bytes);
                }
            }
        }
        band
    }

    /// The sums of `level` from the nearest nesting finer level, or from the surface.
    fn coarser(&self, sizes: &[Size], level: usize, sums: &[Option<Sums>]) -> Sums {
        let (size, layers) = (sizes[level], self.method.layers());
        let from = nearest_nesting(sizes, level);
        let rows: Vec<Sums> = (0..size.height)
            .into_par_iter()
            .map(|j| {
                let mut out = Sums::zero(Size { height: 1, ..size }, layers);
                let mut averager = RowAverager::new(sizes[from].width, size.width);
                let (range, weight) = footprint(sizes[from].height, size.height, j);
                let mut row = SurfaceRow::flat(if from == 0 { sizes[0].width } else { 0 });
                let mut values = vec![0.0; sizes[from].width * 4 * layers];
                for y in range {
                    match &sums[from] {
                        Some(finer) => finer.copy_row(y, &mut values),
                        None => {
                            self.surface.read_row(y, &mut row);
                            self.method.accumulate_row(&row, &mut values);
                        }
                    }
                    out.add_row(0, &values, weight(y) as f32, &mut averager);
                }
                out
            })
            .collect();
        let mut whole = Sums::zero(size, layers);
        for (j, row) in rows.iter().enumerate() {
            whole.place(&(j..j + 1), row);
        }
        whole
    }

    /// Stores a level; returns how many channels overflowed.
    fn write_level<S: LevelSink>(&self, sink: &mut S, level: usize, sums: &Sums) -> Result<usize, S::Error> {
        let row_length = sums.size.width * 4;
        let rows: Vec<(Vec<Vec<u8>>, usize)> = (0..sums.size.height)
            .into_par_iter()
            .map(|y| {
                let mut values = vec![0.0; row_length * sums.layers];
                sums.copy_row(y, &mut values);
                self.method.finish_row(&mut values);
                let mut overflowed = 0;
                let pack = |part: &[f32]| {
                    let mut bytes = Vec::new();
                    overflowed += self.precision.pack(part, &mut bytes);
                    bytes
                };
                (values.chunks_exact(row_length).map(pack).collect(), overflowed)
            })
            .collect();
        for (y, (layers, _)) in rows.iter().enumerate() {
            write_rows(sink, level, y, layers)?;
        }
        Ok(rows.iter().map(|(_, overflowed)| overflowed).sum())
    }
}

/// Hands the same rows of every layer to the sink.
fn write_rows<S: LevelSink>(
    sink: &mut S,
    level: usize,
    row: usize,
    layers: &[Vec<u8>],
) -> Result<(), S::Error> {
    layers
        .iter()
        .enumerate()
        .try_for_each(|(layer, bytes)| sink.write_rows(Place { level, layer, row }, bytes))
}

/// The coarsest level finer than `level` (and coarser than 0) whose texels nest in it; else 0, the surface.
fn nearest_nesting(sizes: &[Size], level: usize) -> usize {
    let nests = |k: &usize| {
        sizes[*k].width.is_multiple_of(sizes[level].width)
            && sizes[*k].height.is_multiple_of(sizes[level].height)
    };
    (1..level).rev().find(nests).unwrap_or(0)
}

/// Rows of level 0 ready to be written, with the level-1 sums above them.
struct Band {
    layers: Vec<Vec<u8>>,
    level1: Sums,
    overflowed: usize,
}

/// One level in single floats: layers one after another, each rows of RGBA texels.
#[derive(Clone)]
struct Sums {
    size: Size,
    layers: usize,
    values: Vec<f32>,
}

impl Sums {
    fn zero(size: Size, layers: usize) -> Self {
        Self { size, layers, values: vec![0.0; size.area() * 4 * layers] }
    }

    fn row_mut(&mut self, layer: usize, y: usize) -> &mut [f32] {
        let length = self.size.width * 4;
        &mut self.values[(layer * self.size.height + y) * length..][..length]
    }

    fn row(&self, layer: usize, y: usize) -> &[f32] {
        let length = self.size.width * 4;
        &self.values[(layer * self.size.height + y) * length..][..length]
    }

    /// Copies a band of whole rows into its place.
    fn place(&mut self, rows: &Range<usize>, band: &Self) {
        for layer in 0..self.layers {
            for y in rows.clone() {
                self.row_mut(layer, y).copy_from_slice(band.row(layer, y - rows.start));
            }
        }
    }

    /// Gathers row `y` of every layer, layer after layer.
    fn copy_row(&self, y: usize, out: &mut [f32]) {
        for (layer, out) in out.chunks_exact_mut(self.size.width * 4).enumerate() {
            out.copy_from_slice(self.row(layer, y));
        }
    }

    /// Adds `weight` times a finer row (all layers) to row `y`.
    fn add_row(&mut self, y: usize, finer: &[f32], weight: f32, averager: &mut RowAverager) {
        for (layer, finer) in finer.chunks_exact(averager.fine * 4).enumerate() {
            averager.add(finer, weight, self.row_mut(layer, y));
        }
    }
}

/// Averages rows of RGBA texels from `fine` to `coarse` texels.
struct RowAverager {
    fine: usize,
    coarse: usize,
    /// For each coarse texel its first fine one and the weights from there on; empty when pairs nest.
    taps: Vec<(usize, Vec<f32>)>,
}

impl RowAverager {
    fn new(fine: usize, coarse: usize) -> Self {
        let tap = |i| {
            let (range, weight) = footprint(fine, coarse, i);
            (range.start, range.map(|j| weight(j) as f32).collect())
        };
        let taps = if fine == 2 * coarse { Vec::new() } else { (0..coarse).map(tap).collect() };
        Self { fine, coarse, taps }
    }

    fn add(&self, finer: &[f32], weight: f32, out: &mut [f32]) {
        debug_assert_eq!(out.len(), self.coarse * 4);
        let out = out.as_chunks_mut::<4>().0;
        if self.taps.is_empty() {
            let half = 0.5 * weight;
            for (o, pair) in out.iter_mut().zip(finer.as_chunks::<8>().0) {
                for c in 0..4 {
                    o[c] += half * (pair[c] + pair[c + 4]);
                }
            }
        } else {
            let finer = finer.as_chunks::<4>().0;
            for (o, (first, weights)) in out.iter_mut().zip(&self.taps) {
                for (texel, w) in finer[*first..].iter().zip(weights) {
                    for c in 0..4 {
                        o[c] += weight * w * texel[c];
                    }
                }
            }
        }
    }
}

/// Keeps a bake in memory.
#[derive(Debug)]
pub struct MemorySink {
    layout: Layout,
    sizes: Vec<Size>,
    levels: Vec<Vec<u8>>,
}

impl MemorySink {
    /// Room for every level of `layout`.
    #[must_use]
    pub fn new(layout: Layout) -> Self {
        let sizes = level_sizes(layout.size);
        let levels = sizes.iter().map(|s| vec![0; layout.layer_bytes(*s) * layout.layers]).collect();
        Self { layout, sizes, levels }
    }

    /// The pyramid, once every place has been written.
    #[must_use]
    pub fn finish(self) -> Pyramid {
        let made: Result<Pyramid, LevelMismatch> = Pyramid::new(self.layout, self.levels);
        made.unwrap_or_else(|e| unreachable!("levels were made from the layout: {e}"))
    }
}

impl LevelSink for MemorySink {
    type Error = std::convert::Infallible;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), Self::Error> {
        let size = self.sizes[place.level];
        let start =
            (place.layer * size.height + place.row) * size.width * self.layout.precision.texel_bytes();
        self.levels[place.level][start..start + bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}
