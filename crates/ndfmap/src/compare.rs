//! Bakes a surface with several methods and measures each against the truth, level by level.

use std::iter::repeat;
use std::path::PathBuf;
use std::time::Instant;

use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::Lobe;
use ndfmap_core::compact::Storage;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::measure::{
    BakedMap, Estimate, FilteringError, LevelErrors, TexelTruth, filtering_errors, lattice_for, level_errors,
};
use ndfmap_core::ndf::{AnyMethod, Shows};
use ndfmap_core::observe::Observer;
use ndfmap_core::pyramid::{Precision, Pyramid, level_sizes};
use ndfmap_core::roughness::{EngineLobe, RoughSurface};
use ndfmap_core::surface::Surface;
use ndfmap_core::units::{Alpha, PerceptualRoughness};
use ndfmap_maps::{MapError, NdfMap};
use serde::{Serialize, Serializer};

use crate::Error;
use crate::roughness::Origin;

/// Subject of a comparison.
pub struct Subject<'a> {
    /// Name of the map, for the report.
    pub name: &'a str,
    /// The map.
    pub surface: &'a dyn Surface,
    /// Lobe that its texels are seen through.
    pub lobe: &'a dyn Lobe,
    /// Methods that bake it.
    pub methods: &'a [AnyMethod],
    /// Maps that were baked from it before, each with its name.
    pub baked: &'a [BakedFile],
    /// Formulas and fits of one lobe, as engines' own materials shade them: about the mean normal made unit.
    pub engines: &'a [Origin],
    /// Storage of a channel.
    pub storage: Storage,
    /// True to measure between texels too.
    pub filtering: bool,
}

/// Map that was baked before, as its file holds it.
pub struct BakedFile {
    /// Name of the file.
    pub path: PathBuf,
    /// The map.
    pub map: NdfMap,
}

/// Comparison of methods on a map; its JSON form is the output of `ndfmap compare --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Name of the map.
    pub map: String,
    /// Texels in a row of the finest level.
    pub width: usize,
    /// Rows of the finest level.
    pub height: usize,
    /// Spelling of the lobe.
    pub brdf: String,
    /// Sizes of the levels, finest first.
    #[serde(skip)]
    pub sizes: Vec<Size>,
    /// Error that factoring a measured material makes by itself, one a level: that of the normals as they
    /// are, shaded by its factors. Empty for other lobes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub factoring: Vec<LevelError>,
    /// Maps and errors, a row a method; as JSON an object with a key a method.
    #[serde(rename = "methods", serialize_with = "by_method")]
    pub rows: Vec<Row>,
}

/// Map and errors of one method.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Spelling of the method, name of a baked file, or `rule:` and the name of an engine's formula or a fit.
    #[serde(skip)]
    pub method: String,
    /// Bytes of a texel of the finest level that is stored.
    pub bytes_per_texel: usize,
    /// Level that is the finest of the map; it leaves out finer ones.
    #[serde(skip)]
    pub from_level: usize,
    /// Seconds that the bake took.
    pub bake_seconds: f64,
    /// The baked map.
    #[serde(skip)]
    pub pyramid: Pyramid,
    /// Errors, one a level from the finest that is stored on.
    pub levels: Vec<LevelError>,
    /// Errors between texels, where asked for.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "between_texels")]
    pub filtering: Vec<FilteringError>,
}

/// Error of a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelError {
    /// The level, 0 the finest.
    pub level: usize,
    /// Relative L2 error of the effective lobes, 0 for perfect ones.
    pub error: f64,
    /// Standard error of that, 0 where all texels were measured.
    pub standard_error: f64,
    /// Texels measured.
    pub texels: usize,
}

impl LevelError {
    fn of(level: usize, estimate: &Estimate) -> Self {
        let Estimate { error, standard_error, places } = *estimate;
        Self { level, error, standard_error, texels: places }
    }

    /// The error as an estimate.
    #[must_use]
    pub fn estimate(&self) -> Estimate {
        let Self { error, standard_error, texels: places, .. } = *self;
        Estimate { error, standard_error, places }
    }
}

/// Errors of every level from one on, finest first.
fn of_levels(from: usize, estimates: &[Estimate]) -> Vec<LevelError> {
    estimates.iter().enumerate().map(|(level, e)| LevelError::of(from + level, e)).collect()
}

/// Rows as an object with a key a method.
fn by_method<S: Serializer>(rows: &[Row], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(rows.iter().map(|row| (&row.method, row)))
}

/// Errors between texels, by the names that scripts know.
fn between_texels<S: Serializer>(errors: &[FilteringError], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Between {
        level: usize,
        texels: f64,
        between: f64,
        reference: f64,
        /// Of the error between.
        standard_error: f64,
        corners: usize,
    }
    serializer.collect_seq(errors.iter().map(|e| Between {
        level: e.level,
        texels: e.texels.error,
        between: e.filtered.error,
        reference: e.reference.error,
        standard_error: e.filtered.standard_error,
        corners: e.filtered.places,
    }))
}

/// Bakes and measures.
///
/// # Errors
/// [`Error::Cancelled`] by the observer, [`Error::Map`] for a baked map of another size, and
/// [`Error::Request`] for a lobe too narrow to be measured.
pub fn compare(subject: &Subject<'_>, observer: &dyn Observer) -> Result<Comparison, Error> {
    let lattice = lattice_for(subject.lobe)?;
    let size = subject.surface.size();
    let sizes = level_sizes(size);
    for BakedFile { path, map } in subject.baked {
        if sizes.get(map.header.from_level) != Some(&map.pyramid.sizes()[0]) {
            let own = map.pyramid.sizes()[0];
            let reason = format!(
                "is {} × {}, and {} is {} × {}: it was not baked from it",
                own.width, own.height, subject.name, size.width, size.height
            );
            return Err(MapError::unsupported(path, reason).into());
        }
    }
    let mut rows = Vec::new();
    let mut methods: Vec<AnyMethod> = Vec::new();
    for BakedFile { path, map } in subject.baked {
        methods.push(map.method(path)?);
        let compact = map.compact(path)?;
        let storage = compact.map_or(map.pyramid.precision().into(), |own| Storage::Compact(own.bits()));
        rows.push(Row {
            method: path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
            bytes_per_texel: storage.texel_bytes(map.pyramid.layers()),
            from_level: map.header.from_level,
            bake_seconds: 0.0,
            pyramid: map.pyramid.clone(),
            levels: Vec::new(),
            filtering: Vec::new(),
        });
    }
    for method in subject.methods {
        observer.begin(&method.to_string());
        let start = Instant::now();
        let bake = Bake::new(subject.surface, &**method).precision(subject.storage.baked());
        let (pyramid, _) = bake.observer(observer).to_pyramid()?;
        let pyramid = subject.storage.stored(pyramid, method.encoding());
        methods.push(method.clone());
        rows.push(Row {
            method: method.to_string(),
            bytes_per_texel: subject.storage.texel_bytes(method.layers()),
            from_level: 0,
            bake_seconds: start.elapsed().as_secs_f64(),
            levels: Vec::new(),
            filtering: Vec::new(),
            pyramid,
        });
    }
    rows.extend(engines(subject, observer)?);
    observer.begin("errors");
    let truth = TexelTruth::new(subject.surface, subject.lobe, &lattice);
    let shown = methods.iter().map(|method| -> &dyn Shows { &**method }).chain(repeat(&EngineLobe as _));
    let maps: Vec<BakedMap<'_>> = rows
        .iter()
        .zip(shown)
        .map(|(row, method)| BakedMap { pyramid: &row.pyramid, from_level: row.from_level, method })
        .collect();
    let part = if subject.filtering { 0.5 } else { 1.0 };
    let LevelErrors { maps: levels, factoring } = level_errors(&truth, &maps, &observer.part(0.0, part))?;
    // Level 0 is the map itself, filtered as maps have always been.
    let between: Vec<usize> = if subject.filtering { (1..sizes.len()).collect() } else { Vec::new() };
    let wraps = subject.surface.wraps();
    let filtering = filtering_errors(&truth, wraps, &between, &maps, &observer.part(part, 1.0))?;
    for ((row, levels), filtering) in rows.iter_mut().zip(levels).zip(filtering) {
        row.levels = of_levels(row.from_level, &levels);
        row.filtering = filtering;
    }
    let (map, brdf) = (subject.name.to_owned(), subject.lobe.to_string());
    Ok(Comparison {
        map,
        width: size.width,
        height: size.height,
        brdf,
        sizes,
        factoring: of_levels(0, &factoring),
        rows,
    })
}

/// Rows of what engines' own materials make of the map.
fn engines(subject: &Subject<'_>, observer: &dyn Observer) -> Result<Vec<Row>, Error> {
    if subject.engines.is_empty() {
        return Ok(Vec::new());
    }
    let lobe = subject.lobe;
    let width = lobe.slope_variance().filter(|_| lobe.measured().is_none());
    let roughness = width.and_then(|width| Alpha::try_from(width).ok()).map(PerceptualRoughness::from);
    let Some(roughness) = roughness.filter(|roughness| roughness.get() <= 1.0) else {
        let why =
            "an engine's formula widens the roughness of a highlight, from 0 to 1, which this lobe has not";
        return Err(Error::Request(format!("{lobe}: {why}")));
    };
    // A normal and a roughness map are not of our storage: half floats, unless others are asked for.
    let precision = match subject.storage {
        Storage::Float(precision) => precision,
        Storage::Compact(_) => Precision::Half,
    };
    let size = subject.surface.size();
    let roughness = Grid::from_fn(size, |_, _| roughness.get() as f32);
    let surface =
        RoughSurface::new(subject.surface, &roughness).map_err(|e| Error::Request(e.to_string()))?;
    let row = |origin: &Origin| {
        let method = format!("rule:{origin}");
        observer.begin(&method);
        let start = Instant::now();
        let levels = origin.levels(&surface, observer)?;
        let pyramid = EngineLobe::map(&surface, &levels, precision, subject.surface.wraps());
        Ok(Row {
            method,
            bytes_per_texel: precision.texel_bytes(),
            from_level: 0,
            bake_seconds: start.elapsed().as_secs_f64(),
            pyramid: pyramid.unwrap_or_else(|_| unreachable!("roughness of every level of the surface")),
            levels: Vec::new(),
            filtering: Vec::new(),
        })
    };
    subject.engines.iter().map(row).collect()
}

/// A number in six columns, three significant digits where it matters.
pub fn three_digits(value: f64) -> String {
    match value {
        v if v < 0.0005 => format!("{v:.0e}"),
        v if v < 10.0 => format!("{v:.3}"),
        v => format!("{v:.1}"),
    }
}
