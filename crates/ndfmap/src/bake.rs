//! Bakes of files: a normal or height map in, a normal distribution map out.

use std::path::Path;
use std::time::Instant;

use ndfmap_core::bake::{Bake, BakeReport as Baked};
use ndfmap_core::grid::Size;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::{Observer, Unobserved};
use ndfmap_core::pyramid::{Precision, level_sizes};
use ndfmap_maps::attribute::AttributeMap;
use ndfmap_maps::formats::to_write;
use ndfmap_maps::source::SourceMap;
use ndfmap_maps::{ChannelLayout, Header, MAX_ATTRIBUTES, MapError, NdfMap, VERSION, WriteOptions};
use serde::Serialize;

use crate::Error;
use crate::choose::Choice;

/// Bake of a source by a method, put together, then [saved](BakeJob::save) or [kept in
/// memory](BakeJob::to_map).
#[derive(Clone)]
pub struct BakeJob<'a> {
    map: &'a SourceMap,
    method: AnyMethod,
    precision: Precision,
    attributes: &'a [AttributeMap],
    observer: &'a dyn Observer,
}

/// What a bake made; as JSON, what `ndfmap bake --json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct BakeReport {
    /// The method's spelling.
    pub method: String,
    /// Texels in a row of the finest level.
    pub width: usize,
    /// Rows of the finest level.
    pub height: usize,
    /// Levels.
    pub levels: usize,
    /// RGBA layers, those of attributes among them.
    pub layers: usize,
    /// Format of the file: `ktx2`, `exr` or `exr-bumpslopes`.
    pub format: String,
    /// Length of the file.
    pub bytes: u64,
    /// Threads that were at work.
    pub threads: usize,
    /// Times.
    pub seconds: BakeSeconds,
    /// What the source's reader warned of.
    pub warnings: Vec<String>,
    /// How the method was chosen, where it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub auto: Option<Choice>,
}

/// Seconds that a bake took.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct BakeSeconds {
    /// Reading the source and the attributes; for who did that to say.
    pub read: f64,
    /// Baking, and writing with it where rows go straight into the file.
    pub bake: f64,
    /// Writing, or giving the finished file its name.
    pub write: f64,
}

impl<'a> BakeJob<'a> {
    /// Bake into half floats, without attributes, unobserved.
    #[must_use]
    pub fn new(map: &'a SourceMap, method: impl Into<AnyMethod>) -> Self {
        let method = method.into();
        Self { map, method, precision: Precision::Half, attributes: &[], observer: &Unobserved }
    }

    /// The same into channels of this precision.
    #[must_use]
    pub fn precision(self, precision: Precision) -> Self {
        Self { precision, ..self }
    }

    /// The same with attributes for the lobes to carry.
    #[must_use]
    pub fn attributes(self, attributes: &'a [AttributeMap]) -> Self {
        Self { attributes, ..self }
    }

    /// The same for somebody to watch and to stop.
    #[must_use]
    pub fn observer(self, observer: &'a dyn Observer) -> Self {
        Self { observer, ..self }
    }

    /// The header of what comes out.
    #[must_use]
    pub fn header(&self) -> Header {
        let Size { width, height } = self.map.surface.size();
        Header {
            version: VERSION,
            method: self.method.to_string(),
            width,
            height,
            wrap: Header::spell_wraps(self.map.surface.wraps()),
            encoding: self.method.encoding().name().to_owned(),
            attributes: self.attributes.iter().map(|a| a.attribute.clone()).collect(),
            source: self.map.source.clone(),
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
        match self.attributes.iter().find(|a| a.values.size() != size) {
            Some(a) => {
                let (own, Size { width, height }) = (a.values.size(), size);
                let (name, of) = (&a.attribute.name, format!("{} × {}", own.width, own.height));
                Err(Error::Request(format!("attribute {name} is {of}, and the map {width} × {height}")))
            }
            None => Ok(()),
        }
    }

    /// Bakes into memory.
    ///
    /// # Errors
    /// [`Error::Request`] for attributes that do not fit or channels too large for the precision, and
    /// [`Error::Cancelled`].
    pub fn to_map(&self) -> Result<NdfMap, Error> {
        self.check()?;
        let values: Vec<_> = self.attributes.iter().map(|a| a.values.clone()).collect();
        let bake = Bake::new(&*self.map.surface, &*self.method)
            .precision(self.precision)
            .attributes(&values)
            .observer(self.observer);
        self.observer.begin(&self.method.to_string());
        let (pyramid, report) = bake.to_pyramid()?;
        refuse_overflow(report, Path::new(&self.map.source.file))?;
        Ok(NdfMap { header: self.header(), pyramid })
    }

    /// Bakes into a file, in the format that its name asks for: whole, or not at all.
    ///
    /// # Errors
    /// As [`Self::to_map`], and [`Error::Map`] for a file that cannot be written, or not with these options.
    pub fn save(&self, path: &Path, options: &WriteOptions) -> Result<BakeReport, Error> {
        self.check()?;
        let format = to_write(path)?;
        let start = Instant::now();
        let plain = options.zstd.is_none() && options.channels == ChannelLayout::Native;
        let (bytes, baked) = match format.open_sink.filter(|_| plain) {
            // Straight into the file, so that writing counts as baking; what remains is the rename.
            Some(open) => {
                let values: Vec<_> = self.attributes.iter().map(|a| a.values.clone()).collect();
                let bake = Bake::new(&*self.map.surface, &*self.method)
                    .precision(self.precision)
                    .attributes(&values)
                    .observer(self.observer);
                let mut sink = open(path, &self.header(), bake.layout())?;
                self.observer.begin(&self.method.to_string());
                let report = bake.run(&mut sink)?;
                refuse_overflow(report, path)?;
                let baked = start.elapsed().as_secs_f64();
                (sink.finish()?, baked)
            }
            None => {
                // Bumpslopes of heights change their units, so they are rounded when written, and only then.
                let bumpslopes = options.channels == ChannelLayout::Bumpslopes;
                if bumpslopes && !self.method.knows_displacement() {
                    let why = "the bumpslopes layout needs an output ending in .exr and `--method slopes`";
                    return Err(Error::Request(why.to_owned()));
                }
                let converts = bumpslopes && self.map.surface.has_height();
                let job = if converts { self.clone().precision(Precision::Single) } else { self.clone() };
                let map = job.to_map()?;
                let baked = start.elapsed().as_secs_f64();
                let options = WriteOptions { precision: Some(self.precision), ..*options };
                (map.save(path, &options)?, baked)
            }
        };
        let size = self.map.surface.size();
        let suffix = if options.channels == ChannelLayout::Native { "" } else { "-bumpslopes" };
        Ok(BakeReport {
            method: self.method.to_string(),
            width: size.width,
            height: size.height,
            levels: level_sizes(size).len(),
            layers: self.method.layers_with(self.attributes.len()),
            format: format!("{}{suffix}", format.extensions[0]),
            bytes,
            threads: rayon::current_num_threads(),
            seconds: BakeSeconds { read: 0.0, bake: baked, write: start.elapsed().as_secs_f64() - baked },
            warnings: self.map.warnings.clone(),
            auto: None,
        })
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
