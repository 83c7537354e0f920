//! Baking: from the finest level to every level of a normal distribution map, in bands of rows.
//!
//! Each texel is the exact area-weighted mean of the finest texels under it. A level is averaged from
//! the coarsest finer level whose texels nest in its own, which for powers of two is the one before, and
//! from the surface itself where none nests. A band carries its rows through as many nesting levels as it
//! can while they are in cache, so the finest levels are never held in floats. Bands are fixed by the map,
//! not by the number of threads, so the bytes are too. Methods that are fitted go another way (`fitted.rs`).

mod average;
mod fitted;
mod plan;

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use self::average::{RowAverager, Sums, copy_row, halve};
use self::plan::{BAND, Band, Plan, split_layers};

use crate::fit::Rgba;
use crate::grid::{Grid, Size};
use crate::ndf::Method;
use crate::observe::{Cancelled, Forward, Observer, Unobserved};
use crate::pyramid::{Layout, LevelMismatch, Precision, Pyramid, footprint, level_sizes};
use crate::surface::{Surface, SurfaceRow};

/// Place of rows of stored texels in the pyramid.
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
    /// Error of writing.
    type Error;

    /// Takes whole rows of one layer of one level.
    ///
    /// # Errors
    /// Any error of the sink; the bake stops and hands it on.
    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), Self::Error>;

    /// All levels, if the sink keeps them in memory; they are then written in place, by all threads.
    fn memory(&mut self) -> Option<&mut [Vec<u8>]> {
        None
    }
}

impl<S: LevelSink + ?Sized> LevelSink for Box<S> {
    type Error = S::Error;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), Self::Error> {
        (**self).write_rows(place, bytes)
    }

    fn memory(&mut self) -> Option<&mut [Vec<u8>]> {
        (**self).memory()
    }
}

/// Bake of a surface by a method: put together, then [run](Bake::run) into a sink or [into
/// memory](Bake::to_pyramid).
///
/// ```
/// use ndfmap_core::bake::Bake;
/// use ndfmap_core::grid::Size;
/// use ndfmap_core::ndf::Vmf;
/// use ndfmap_core::procedural;
///
/// let armour = procedural::find("armour").expect("a built-in map");
/// let surface = (armour.build)(Size { width: 64, height: 64 });
/// let (pyramid, _) = Bake::new(&*surface, &Vmf::new(4)?).to_pyramid()?;
/// assert_eq!((pyramid.layers(), pyramid.sizes().len()), (4, 7));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy)]
pub struct Bake<'a> {
    surface: &'a dyn Surface,
    method: &'a dyn Method,
    precision: Precision,
    attributes: &'a [Grid<Rgba>],
    observer: &'a dyn Observer,
}

/// Error of a bake that did not come to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BakeError<E> {
    /// The observer stopped it.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The sink could not take rows.
    #[error("{0}")]
    Sink(E),
}

/// Report of a bake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BakeReport {
    /// Channels too large for the precision, which became infinite.
    pub overflowed: usize,
}

/// Tasks a thread may have waiting for the sink at once.
const WAVE: usize = 4;

impl<'a> Bake<'a> {
    /// Bake into half floats, without attributes, unobserved.
    #[must_use]
    pub fn new(surface: &'a dyn Surface, method: &'a dyn Method) -> Self {
        Self { surface, method, precision: Precision::Half, attributes: &[], observer: &Unobserved }
    }

    /// Returns it with channels of this precision.
    #[must_use]
    pub fn precision(self, precision: Precision) -> Self {
        Self { precision, ..self }
    }

    /// Returns it with attributes, other maps of the surface's size: each lobe carries its weight times the
    /// mean of their values over its normals, in a further layer an attribute.
    ///
    /// Baking panics when the method's lobes carry no attributes ([`Describe::carries_attributes`]), or an
    /// attribute has another size.
    ///
    /// [`Describe::carries_attributes`]: crate::ndf::Describe::carries_attributes
    #[must_use]
    pub fn attributes(self, attributes: &'a [Grid<Rgba>]) -> Self {
        Self { attributes, ..self }
    }

    /// Returns it with an observer, which watches the bake and may stop it.
    #[must_use]
    pub fn observer(self, observer: &'a dyn Observer) -> Self {
        Self { observer, ..self }
    }

    /// Layout of the pyramid to be baked: size, layers and precision.
    #[must_use]
    pub fn layout(&self) -> Layout {
        Layout {
            size: self.surface.size(),
            layers: self.method.layers_with(self.attributes.len()),
            precision: self.precision,
            wraps: self.surface.wraps(),
        }
    }

    /// Bakes into memory.
    ///
    /// # Errors
    /// [`Cancelled`] by the observer.
    ///
    /// # Panics
    /// When there are attributes that the method's lobes do not carry, or one of another size.
    pub fn to_pyramid(&self) -> Result<(Pyramid, BakeReport), Cancelled> {
        let mut sink = MemorySink::new(self.layout());
        match self.run(&mut sink) {
            Ok(report) => Ok((sink.finish(), report)),
            Err(BakeError::Cancelled(cancelled)) => Err(cancelled),
            Err(BakeError::Sink(never)) => match never {},
        }
    }

    /// Bakes into `sink`, every level down to 1 × 1.
    ///
    /// # Errors
    /// The first error of the sink, or [`Cancelled`] by the observer.
    ///
    /// # Panics
    /// When there are attributes that the method's lobes do not carry, or one of another size.
    pub fn run<S: LevelSink>(&self, sink: &mut S) -> Result<BakeReport, BakeError<S::Error>> {
        let carried = self.attributes.is_empty() || self.method.carries_attributes();
        assert!(carried, "only the lobes of fitted methods carry attributes");
        let observer = Forward::new(self.observer);
        let bake = Bake { observer: &observer, ..*self };
        match self.method.fit() {
            Some(fit) => bake.run_fitted(&fit, sink),
            None => bake.run_linear(sink),
        }
    }

    fn run_linear<S: LevelSink>(&self, sink: &mut S) -> Result<BakeReport, BakeError<S::Error>> {
        let plan = Plan::new(self.layout());
        let mut report = BakeReport::default();
        let mut sums: Vec<Option<Sums>> = vec![None; plan.sizes.len()];
        sums[plan.kept] = Some(self.finest(&plan, sink, &mut report)?);
        for level in plan.kept + 1..plan.sizes.len() {
            let made = self.coarser(&plan, level, &sums);
            self.observer.check()?;
            report.overflowed += self.store(sink, level, &made).map_err(BakeError::Sink)?;
            sums[level] = Some(made);
            for (finer, slot) in sums.iter_mut().enumerate().take(level) {
                if (level + 1..plan.sizes.len()).all(|later| plan.nearest_nesting(later) != finer) {
                    *slot = None;
                }
            }
            self.observer
                .progress(1.0 - 0.1 * (plan.sizes.len() - 1 - level) as f64 / plan.sizes.len() as f64);
        }
        self.observer.progress(1.0);
        Ok(report)
    }

    /// Writes levels 0 to `plan.kept` band by band and returns the sums of the last of them.
    fn finest<S: LevelSink>(
        &self,
        plan: &Plan,
        sink: &mut S,
        report: &mut BakeReport,
    ) -> Result<Sums, BakeError<S::Error>> {
        let mut kept = Sums::zero(plan.sizes[plan.kept], plan.layout.layers);
        let bands = plan.bands();
        let (width, layers) = (kept.size.width, kept.layers);
        let lengths: Vec<usize> = bands.iter().map(|b| b.rows(plan, plan.kept).len() * width * 4).collect();
        let kept_bands = split_layers(&mut kept.values, layers, &lengths);
        let pool = ScratchPool::default();
        let make = |band: &Band, mut outputs: BandOutputs<'_>| {
            if self.observer.cancelled() {
                return 0;
            }
            let mut scratch = pool.take(|| Scratch::new(plan));
            let overflowed = self.band(plan, band, &mut outputs, &mut scratch);
            pool.give(scratch);
            overflowed
        };
        if let Some(memory) = sink.memory() {
            let mut stored: Vec<Vec<Stored<'_>>> = bands.iter().map(|_| Vec::new()).collect();
            for (level, bytes) in memory.iter_mut().enumerate().take(plan.kept + 1) {
                let lengths: Vec<usize> = bands.iter().map(|b| b.bytes(plan, level)).collect();
                let split = split_layers(bytes, layers, &lengths);
                stored.iter_mut().zip(split).for_each(|(band, part)| band.push(part));
            }
            let outputs =
                stored.into_iter().zip(kept_bands).map(|(stored, kept)| BandOutputs { stored, kept });
            let work = bands.par_iter().zip(outputs.collect::<Vec<_>>());
            report.overflowed += work.map(|(band, outputs)| make(band, outputs)).sum::<usize>();
            self.observer.check()?;
            self.observer.progress(0.9);
            return Ok(kept);
        }
        let wave = WAVE * rayon::current_num_threads();
        let mut buffers: Vec<Vec<Vec<Vec<u8>>>> = vec![vec![vec![Vec::new(); layers]; plan.kept + 1]; wave];
        let mut kept_bands = kept_bands.into_iter();
        for (done, bands) in bands.chunks(wave).enumerate() {
            let kept: Vec<_> = kept_bands.by_ref().take(bands.len()).collect();
            let work = bands.par_iter().zip(&mut buffers).zip(kept);
            let overflowed = work.map(|((band, buffers), kept)| {
                let fit = |(level, layers): (usize, &mut Vec<Vec<u8>>)| {
                    layers.iter_mut().for_each(|bytes| bytes.resize(band.bytes(plan, level), 0));
                };
                buffers.iter_mut().enumerate().for_each(fit);
                let stored =
                    buffers.iter_mut().map(|l| l.iter_mut().map(Vec::as_mut_slice).collect()).collect();
                make(band, BandOutputs { stored, kept })
            });
            report.overflowed += overflowed.sum::<usize>();
            self.observer.check()?;
            for (band, buffers) in bands.iter().zip(&buffers) {
                for (level, layers) in buffers.iter().enumerate() {
                    write_rows(sink, level, band.rows(plan, level).start, layers).map_err(BakeError::Sink)?;
                }
            }
            self.observer
                .progress(0.9 * (((done + 1) * wave * BAND) as f64 / plan.unit().height as f64).min(1.0));
        }
        Ok(kept)
    }

    /// Stores a band's rows of every level it reaches, keeps the sums of the last, and returns how many
    /// channels overflowed.
    fn band(&self, plan: &Plan, band: &Band, outputs: &mut BandOutputs<'_>, scratch: &mut Scratch) -> usize {
        let (fine, coarse) = (plan.sizes[0], plan.unit());
        let Scratch { row, values, averager, level: current, next } = scratch;
        let mut overflowed = 0;
        let written = band.rows(plan, 0);
        let plane = band.0.len() * coarse.width * 4;
        current.clear();
        current.resize(plane * plan.layout.layers, 0.0);
        // A band may read one row further than it writes.
        for y in written.start..(band.0.end * fine.height).div_ceil(coarse.height) {
            self.surface.read_row(y, row);
            self.method.accumulate_row(row, values);
            for j in band.0.clone() {
                let (range, weight) = footprint(fine.height, coarse.height, j);
                if range.contains(&y) {
                    let layers = current.chunks_exact_mut(plane).zip(values.chunks_exact(fine.width * 4));
                    for (layer, values) in layers {
                        let out = &mut layer[(j - band.0.start) * coarse.width * 4..][..coarse.width * 4];
                        averager.add(values, weight(y) as f32, out);
                    }
                }
            }
            if written.contains(&y) {
                self.method.finish_row(values);
                let at = (y - written.start) * plan.row_bytes(0);
                for (layer, values) in outputs.stored[0].iter_mut().zip(values.chunks_exact(fine.width * 4)) {
                    overflowed += self.precision.pack_into(values, &mut layer[at..][..plan.row_bytes(0)]);
                }
            }
        }
        for level in 1..=plan.kept {
            let (rows, width) = (band.rows(plan, level).len(), plan.sizes[level].width);
            for y in 0..rows {
                copy_row(current, (rows, width), y, values);
                self.method.finish_row(&mut values[..width * 4 * plan.layout.layers]);
                let at = y * plan.row_bytes(level);
                for (layer, values) in outputs.stored[level].iter_mut().zip(values.chunks_exact(width * 4)) {
                    overflowed += self.precision.pack_into(values, &mut layer[at..][..plan.row_bytes(level)]);
                }
            }
            if level < plan.kept {
                halve(current, (rows, width), next);
                std::mem::swap(current, next);
            }
        }
        for (kept, layer) in
            outputs.kept.iter_mut().zip(current.chunks_exact(current.len() / plan.layout.layers))
        {
            kept.copy_from_slice(layer);
        }
        overflowed
    }

    /// The sums of `level` from the nearest nesting finer level, or from the surface.
    fn coarser(&self, plan: &Plan, level: usize, sums: &[Option<Sums>]) -> Sums {
        let (size, layers) = (plan.sizes[level], plan.layout.layers);
        let from = plan.nearest_nesting(level);
        let fine = plan.sizes[from];
        let mut made = Sums::zero(size, layers);
        let rows = split_layers(&mut made.values, layers, &vec![size.width * 4; size.height]);
        let averager = RowAverager::new(fine.width, size.width);
        let scratch = || (SurfaceRow::flat(fine.width), vec![0.0; fine.width * 4 * layers]);
        rows.into_par_iter().enumerate().for_each_init(scratch, |(row, values), (j, mut out)| {
            let (range, weight) = footprint(fine.height, size.height, j);
            for y in range {
                match &sums[from] {
                    Some(finer) => copy_row(&finer.values, (fine.height, fine.width), y, values),
                    None => {
                        self.surface.read_row(y, row);
                        self.method.accumulate_row(row, values);
                    }
                }
                for (out, values) in out.iter_mut().zip(values.chunks_exact(fine.width * 4)) {
                    averager.add(values, weight(y) as f32, out);
                }
            }
        });
        made
    }

    /// Stores a level; returns how many channels overflowed.
    fn store<S: LevelSink>(&self, sink: &mut S, level: usize, sums: &Sums) -> Result<usize, S::Error> {
        let (row_length, row_bytes) = (sums.size.width * 4, sums.size.width * self.precision.texel_bytes());
        let mut own = Vec::new();
        let memory = sink.memory();
        let in_place = memory.is_some();
        let bytes = match memory {
            Some(levels) => &mut levels[level],
            None => {
                own.resize(row_bytes * sums.size.height * sums.layers, 0);
                &mut own
            }
        };
        let rows = split_layers(bytes, sums.layers, &vec![row_bytes; sums.size.height]);
        let values = || vec![0.0; row_length * sums.layers];
        let overflowed = rows
            .into_par_iter()
            .enumerate()
            .map_init(values, |values, (y, stored)| {
                copy_row(&sums.values, (sums.size.height, sums.size.width), y, values);
                self.method.finish_row(values);
                let layers = stored.into_iter().zip(values.chunks_exact(row_length));
                layers.map(|(stored, values)| self.precision.pack_into(values, stored)).sum::<usize>()
            })
            .sum();
        if !in_place {
            let layers: Vec<&[u8]> = own.chunks_exact(row_bytes * sums.size.height).collect();
            write_rows(sink, level, 0, &layers)?;
        }
        Ok(overflowed)
    }
}

/// Hands the same rows of every layer to the sink.
fn write_rows<S: LevelSink>(
    sink: &mut S,
    level: usize,
    row: usize,
    layers: &[impl AsRef<[u8]>],
) -> Result<(), S::Error> {
    layers
        .iter()
        .enumerate()
        .try_for_each(|(layer, bytes)| sink.write_rows(Place { level, layer, row }, bytes.as_ref()))
}

/// The stored rows of one level, layer by layer.
type Stored<'a> = Vec<&'a mut [u8]>;

/// Rows that a band writes to.
struct BandOutputs<'a> {
    /// Stored rows of each level, from 0 to the kept one.
    stored: Vec<Stored<'a>>,
    /// Sums of the kept level, layer by layer.
    kept: Vec<&'a mut [f32]>,
}

/// Scratch memory of one task.
struct Scratch {
    row: SurfaceRow,
    values: Vec<f32>,
    averager: RowAverager,
    /// Sums of the band's rows on the level at hand, and on the next.
    level: Vec<f32>,
    next: Vec<f32>,
}

impl Scratch {
    fn new(plan: &Plan) -> Self {
        let fine = plan.sizes[0].width;
        Self {
            row: SurfaceRow::flat(fine),
            values: vec![0.0; fine * 4 * plan.layout.layers],
            averager: RowAverager::new(fine, plan.unit().width),
            level: Vec::new(),
            next: Vec::new(),
        }
    }
}

/// Scratch memory that tasks hand on, so that no band asks the system for megabytes anew.
#[derive(Default)]
struct ScratchPool(Mutex<Vec<Scratch>>);

impl ScratchPool {
    fn take(&self, new: impl FnOnce() -> Scratch) -> Scratch {
        let waiting = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop();
        waiting.unwrap_or_else(new)
    }

    fn give(&self, scratch: Scratch) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }
}

/// Sink that keeps a bake in memory.
#[derive(Debug)]
pub struct MemorySink {
    layout: Layout,
    sizes: Vec<Size>,
    levels: Vec<Vec<u8>>,
}

impl MemorySink {
    /// Sink with room for every level of `layout`.
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

    fn memory(&mut self) -> Option<&mut [Vec<u8>]> {
        Some(&mut self.levels)
    }
}
