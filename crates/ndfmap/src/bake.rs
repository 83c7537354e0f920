//! Bakes of files: a normal or height map in, a normal distribution map out.

use std::path::Path;
use std::time::Instant;

use ndfmap_core::bake::{Bake, BakeReport as Baked, LevelSink, Place};
use ndfmap_core::compact::{Compact, Storage};
use ndfmap_core::fit::Rgba;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::ndf::{AnyMethod, Encoding};
use ndfmap_core::observe::{Observer, Unobserved};
use ndfmap_core::pyramid::{Layout, Precision, level_sizes};
use ndfmap_maps::attribute::AttributeMap;
use ndfmap_maps::formats::{NdfSink, check_integers, to_write};
use ndfmap_maps::source::SourceMap;
use ndfmap_maps::{
    COMPACT_VERSION, ChannelLayout, Header, Integers, MAX_ATTRIBUTES, MapError, NdfMap, VERSION, WriteOptions,
};
use serde::Serialize;

use crate::Error;
use crate::choose::Choice;

/// Bake of a source by a method, put together, then [saved](BakeJob::save) or [kept in
/// memory](BakeJob::to_map).
#[derive(Clone)]
pub struct BakeJob<'a> {
    map: &'a SourceMap,
    method: AnyMethod,
    storage: Storage,
    from_level: usize,
    attributes: &'a [AttributeMap],
    observer: &'a dyn Observer,
}

/// Report of a bake; its JSON form is the output of `ndfmap bake --json`.
#[derive(Clone, Debug, Serialize)]
pub struct BakeReport {
    /// Spelling of the method.
    pub method: String,
    /// Texels in a row of the finest level.
    pub width: usize,
    /// Rows of the finest level.
    pub height: usize,
    /// Number of levels.
    pub levels: usize,
    /// RGBA layers, including those of attributes.
    pub layers: usize,
    /// Format of the file: `ktx2`, `exr` or `exr-bumpslopes`.
    pub format: String,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Bytes of all levels in video memory, where they lie as they are.
    pub video_bytes: u64,
    /// Threads that were at work.
    pub threads: usize,
    /// Times of the parts of the work.
    pub seconds: BakeSeconds,
    /// Warnings of the source's reader.
    pub warnings: Vec<String>,
    /// Choice of the method, where one was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub auto: Option<Choice>,
}

/// Seconds that a bake took.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct BakeSeconds {
    /// Reading the source and the attributes; the caller, who did that, fills it in.
    pub read: f64,
    /// Baking, and writing with it where rows go straight into the file.
    pub bake: f64,
    /// Writing, or only compressing the finished rows, or only giving the finished file its name.
    pub write: f64,
}

impl<'a> BakeJob<'a> {
    /// Bake into half floats, all levels, without attributes, unobserved.
    #[must_use]
    pub fn new(map: &'a SourceMap, method: impl Into<AnyMethod>) -> Self {
        let (method, storage) = (method.into(), Storage::default());
        Self { map, method, storage, from_level: 0, attributes: &[], observer: &Unobserved }
    }

    /// Returns it with channels stored so.
    #[must_use]
    pub fn storage(self, storage: impl Into<Storage>) -> Self {
        Self { storage: storage.into(), ..self }
    }

    /// Returns it without levels finer than this one. Level 0 is a normal map itself, which a renderer has.
    #[must_use]
    pub fn from_level(self, from_level: usize) -> Self {
        Self { from_level, ..self }
    }

    /// Sizes of the levels that are kept, finest first.
    fn sizes(&self) -> Vec<Size> {
        let mut sizes = level_sizes(self.map.surface.size());
        sizes.drain(..self.from_level.min(sizes.len()));
        sizes
    }

    /// Returns it with attributes for the lobes to carry.
    #[must_use]
    pub fn attributes(self, attributes: &'a [AttributeMap]) -> Self {
        Self { attributes, ..self }
    }

    /// Returns it with an observer, who may watch and stop it.
    #[must_use]
    pub fn observer(self, observer: &'a dyn Observer) -> Self {
        Self { observer, ..self }
    }

    /// Header of the baked map.
    #[must_use]
    pub fn header(&self) -> Header {
        let Size { width, height } = self.sizes().first().copied().unwrap_or(Size { width: 0, height: 0 });
        Header {
            version: if self.from_level == 0 { VERSION } else { COMPACT_VERSION },
            method: self.method.to_string(),
            width,
            height,
            wrap: Header::spell_wraps(self.map.surface.wraps()),
            encoding: self.method.encoding().name().to_owned(),
            attributes: self.attributes.iter().map(|a| a.attribute.clone()).collect(),
            source: self.map.source.clone(),
            compact: None,
            from_level: self.from_level,
        }
    }

    fn check(&self) -> Result<(), Error> {
        if self.attributes.len() > MAX_ATTRIBUTES {
            return Err(Error::Request(format!("at most {MAX_ATTRIBUTES} attributes are carried")));
        }
        if !self.attributes.is_empty() && !self.method.carries_attributes() {
            let why = "has no lobes that carry attributes; `vmf` and `gmm` have";
            return Err(Error::Request(format!("`{}` {why}", self.method)));
        }
        let size = self.map.surface.size();
        if self.sizes().is_empty() {
            let levels = level_sizes(size).len();
            let why =
                format!("the map has levels 0 to {}: there is none from {}", levels - 1, self.from_level);
            return Err(Error::Request(why));
        }
        match self.attributes.iter().find(|a| a.values.size() != size) {
            Some(a) => {
                let (own, Size { width, height }) = (a.values.size(), size);
                let (name, of) = (&a.attribute.name, format!("{} × {}", own.width, own.height));
                Err(Error::Request(format!("attribute {name} is {of}, and the map {width} × {height}")))
            }
            None => Ok(()),
        }
    }

    /// Values of the attributes.
    fn values(&self) -> Vec<Grid<Rgba>> {
        self.attributes.iter().map(|a| a.values.clone()).collect()
    }

    /// Core's bake of the map; the observer is told that it begins.
    fn begin<'b>(&'b self, values: &'b [Grid<Rgba>]) -> Bake<'b> {
        self.observer.begin(&self.method.to_string());
        Bake::new(&*self.map.surface, &*self.method)
            .precision(self.storage.baked())
            .attributes(values)
            .observer(self.observer)
    }

    /// Bakes into memory.
    ///
    /// # Errors
    /// [`Error::Request`] for attributes that do not fit, [`Error::Map`] for channels too large for the
    /// precision, and [`Error::Cancelled`].
    pub fn to_map(&self) -> Result<NdfMap, Error> {
        self.to_map_for(Path::new(&self.map.source.file))
    }

    /// [`Self::to_map`]; errors name this file.
    fn to_map_for(&self, file: &Path) -> Result<NdfMap, Error> {
        self.check()?;
        let values = self.values();
        let (pyramid, report) = self.begin(&values).to_pyramid()?;
        refuse_overflow(report, file)?;
        let (header, pyramid) = (self.header(), pyramid.from_level(self.from_level));
        let Storage::Compact(bits) = self.storage else { return Ok(NdfMap { header, pyramid }) };
        let compact = Compact::of(bits, &pyramid, self.method.encoding());
        let own = Some(Integers::of(&compact));
        let header = Header { version: COMPACT_VERSION, compact: own, ..header };
        Ok(NdfMap { header, pyramid: compact.rounded(&pyramid) })
    }

    /// Bakes into a file, in the format that its name asks for: whole, or not at all.
    ///
    /// # Errors
    /// As [`Self::to_map`], and [`Error::Map`] for a file that cannot be written, or not with these options.
    pub fn save(&self, path: &Path, options: &WriteOptions) -> Result<BakeReport, Error> {
        self.check()?;
        let format = to_write(path)?;
        let bumpslopes = options.channels == ChannelLayout::Bumpslopes;
        let exr = format.extensions.contains(&"exr");
        // Known before the minutes of baking.
        if bumpslopes && (!exr || self.method.encoding() != Encoding::SlopeMoments) {
            let why = "the bumpslopes layout needs an output ending in .exr and `--method slopes`";
            return Err(Error::Request(why.to_owned()));
        }
        if options.zstd.is_some() && exr {
            return Err(Error::Request("Zstandard is for KTX2; an EXR is compressed as it is".to_owned()));
        }
        let compact = match self.storage {
            Storage::Float(_) => None,
            Storage::Compact(bits) => Some(bits),
        };
        let options = &WriteOptions { compact, ..*options };
        check_integers(path, format, options)?;
        let start = Instant::now();
        let (bytes, baked) = match format.open_sink {
            // Rows go straight into a file, so writing counts as baking; what remains is to compress it, if
            // asked for, and to name it.
            Some(open) => {
                let values = self.values();
                let bake = self.begin(&values);
                let layout = Layout { size: self.sizes()[0], ..bake.layout() };
                let sink = open(path, &self.header(), layout, options)?;
                let mut sink = FromLevel { sink, from_level: self.from_level };
                let report = bake.run(&mut sink)?;
                refuse_overflow(report, path)?;
                let baked = start.elapsed().as_secs_f64();
                (sink.sink.finish()?, baked)
            }
            None => {
                // Bumpslopes of heights change their units, so they are rounded only when written.
                let converts = bumpslopes && self.map.surface.has_height();
                let job = if converts { self.clone().storage(Precision::Single) } else { self.clone() };
                let map = job.to_map_for(path)?;
                let baked = start.elapsed().as_secs_f64();
                let options = WriteOptions { precision: Some(self.storage.baked()), ..*options };
                (map.save(path, &options)?, baked)
            }
        };
        let sizes = self.sizes();
        let size = sizes[0];
        let layers = self.method.layers_with(self.attributes.len());
        let texels: usize = sizes.iter().map(|size| size.area()).sum();
        let suffix = if bumpslopes { "-bumpslopes" } else { "" };
        Ok(BakeReport {
            method: self.method.to_string(),
            width: size.width,
            height: size.height,
            levels: sizes.len(),
            layers,
            format: format!("{}{suffix}", format.extensions[0]),
            bytes,
            video_bytes: (texels * self.storage.texel_bytes(layers)) as u64,
            threads: rayon::current_num_threads(),
            seconds: BakeSeconds { read: 0.0, bake: baked, write: start.elapsed().as_secs_f64() - baked },
            warnings: self.map.warnings.clone(),
            auto: None,
        })
    }
}

/// Sink that leaves out levels finer than one.
struct FromLevel {
    sink: Box<dyn NdfSink>,
    from_level: usize,
}

impl LevelSink for FromLevel {
    type Error = MapError;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), MapError> {
        match place.level.checked_sub(self.from_level) {
            Some(level) => self.sink.write_rows(Place { level, ..place }, bytes),
            None => Ok(()),
        }
    }
}

fn refuse_overflow(report: Baked, output: &Path) -> Result<(), Error> {
    if report.overflowed == 0 {
        return Ok(());
    }
    let reason = format!(
        "{} channels are too large for half floats (65504): use `--precision single` or a smaller `--height-scale`",
        report.overflowed
    );
    Err(Error::Map(MapError::unsupported(output, reason)))
}
