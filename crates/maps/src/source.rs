//! Sources: pictures, and built-in surfaces, read as normal maps or height maps.

use std::path::Path;
use std::sync::Arc;

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::procedural;
use ndfmap_core::surface::{
    HeightField, MAX_SLOPE, SlopeFilter, Surface, SurfaceRow, Wraps, integrability, unit_or_up,
};
use sha2::{Digest, Sha256};

use ndfmap_core::words;

use crate::formats::{read_file, read_image};
use crate::header::{Source, SourceKind};
use crate::{Image, MapError, Samples};

/// Direction of green in a normal map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convention {
    /// Up the picture.
    #[default]
    OpenGl,
    /// Down the picture.
    DirectX,
}

words!(Convention { OpenGl => "opengl", DirectX => "directx" });

/// Options for reading a picture as a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceOptions {
    /// Kind of the map, normals or heights; `None` decides by the picture: grey ones are heights.
    pub kind: Option<SourceKind>,
    /// Direction of green, for normal maps.
    pub convention: Convention,
    /// Texture widths that one unit of height stands for, for height maps (full white of an integer picture
    /// is one unit).
    pub height_scale: f64,
    /// White is deep, for height maps.
    pub invert: bool,
    /// Filter that takes slopes from heights, for height maps.
    pub slope_filter: SlopeFilter,
    /// Continuation beyond the edges, on each axis.
    pub wraps: Wraps,
    /// Size of a built-in surface.
    pub builtin_size: Size,
}

/// Default height of full white, in texture widths.
pub const DEFAULT_HEIGHT_SCALE: f64 = 0.05;

impl Default for SourceOptions {
    fn default() -> Self {
        Self {
            kind: None,
            convention: Convention::default(),
            height_scale: DEFAULT_HEIGHT_SCALE,
            invert: false,
            slope_filter: SlopeFilter::default(),
            wraps: Wraps::default(),
            builtin_size: Size { width: 512, height: 512 },
        }
    }
}

/// A source, ready to be baked.
pub struct SourceMap {
    /// The finest level.
    pub surface: Arc<dyn Surface>,
    /// Description of the source, for headers.
    pub source: Source,
    /// Warnings of the reader.
    pub warnings: Vec<String>,
}

/// Prefix of the names of built-in surfaces.
pub const BUILTIN_PREFIX: &str = "builtin:";

/// Heights beyond this many texture widths are not real: NaN, infinity, or a "no data" that no tag names.
const ABSURD_HEIGHT: f32 = 1e6;

/// Largest span of heights in texture widths: wider ones are surely in other units.
const STEEP_SPAN: f32 = 2.0;

/// Signed [`integrability`] below which a map contradicts its convention. The check must stay silent at the
/// values of real maps that tell nothing (0.22, linen).
const CONTRADICTION: f64 = -0.25;

/// Reads `map`: a file, or `builtin:NAME`.
///
/// # Errors
/// [`MapError`] when there is no such surface, or the file cannot be read.
pub fn read_source(map: &Path, options: &SourceOptions) -> Result<SourceMap, MapError> {
    if let Some(name) = map.to_str().and_then(|m| m.strip_prefix(BUILTIN_PREFIX)) {
        return builtin(map, name, options);
    }
    let bytes = read_file(map)?;
    let image = read_image(map, &bytes)?;
    let sha256 = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
    drop(bytes);
    source_of_image(map, image, sha256, options)
}

fn builtin(map: &Path, name: &str, options: &SourceOptions) -> Result<SourceMap, MapError> {
    let row = procedural::find(name).ok_or_else(|| {
        let names: Vec<&str> = procedural::TABLE.iter().map(|row| row.name).collect();
        MapError::unsupported(
            map,
            format!("there is no built-in surface `{name}`; there are {}", names.join(", ")),
        )
    })?;
    let surface = (row.build)(options.builtin_size);
    let (kind, height_scale, convention) = if surface.has_height() {
        (SourceKind::Height, Some(1.0), None)
    } else {
        (SourceKind::Normal, None, Some(Convention::OpenGl.name().to_owned()))
    };
    let source = Source {
        file: format!("{BUILTIN_PREFIX}{name}"),
        kind,
        sha256: String::new(),
        height_scale,
        convention,
    };
    let own = SourceOptions { builtin_size: options.builtin_size, ..SourceOptions::default() };
    let warnings = if *options == own {
        Vec::new()
    } else {
        vec!["is built in: only its size can be chosen, other source options do nothing".to_owned()]
    };
    Ok(SourceMap { surface: surface.into(), source, warnings })
}

/// Reads a decoded picture as a surface.
///
/// # Errors
/// [`MapError`] for a picture that does not fit the options.
pub fn source_of_image(
    path: &Path,
    image: Image,
    sha256: String,
    options: &SourceOptions,
) -> Result<SourceMap, MapError> {
    let mut warnings = image.warnings.clone();
    let kind =
        options.kind.unwrap_or_else(|| if is_grey(&image) { SourceKind::Height } else { SourceKind::Normal });
    let file = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let (surface, height_scale, convention): (Arc<dyn Surface>, _, _) = match kind {
        SourceKind::Height => {
            if options.kind.is_none() && image.channels > 1 {
                warnings.push(
                    "is grey, so it is taken as heights; `--from normal` takes it as normals".to_owned(),
                );
            }
            let field = height_field(path, &image, options, &mut warnings)?;
            (Arc::new(field), Some(options.height_scale), None)
        }
        SourceKind::Normal => {
            if options.height_scale != DEFAULT_HEIGHT_SCALE || options.invert {
                warnings.push("is taken as normals: `--height-scale` and `--invert` do nothing".to_owned());
            }
            let normals = EncodedNormals::new(path, image, options, &mut warnings)?;
            (Arc::new(normals), None, Some(options.convention.name().to_owned()))
        }
    };
    Ok(SourceMap { surface, source: Source { file, kind, sha256, height_scale, convention }, warnings })
}

/// True for one channel, or three that never differ by more than JPEG's colour noise (8 of 255).
fn is_grey(image: &Image) -> bool {
    if image.channels < 3 {
        return image.channels == 1;
    }
    let texel = |i: usize| [0, 1, 2].map(|c| image.samples.get(i * image.channels + c));
    (0..image.size.area()).map(texel).all(|[r, g, b]| r.max(g).max(b) - r.min(g).min(b) <= 8.0 / 255.0)
}

fn height_field(
    path: &Path,
    image: &Image,
    options: &SourceOptions,
    warnings: &mut Vec<String>,
) -> Result<HeightField, MapError> {
    // Scaling by the full range keeps depth positive for integers; measurements are only negated.
    let one = if matches!(image.samples, Samples::F32(_)) { 0.0 } else { 1.0 };
    let scale = options.height_scale as f32;
    let mut bad = 0;
    let height = |x: usize, y: usize| {
        let h = image.samples.get((y * image.size.width + x) * image.channels);
        let h = if options.invert { one - h } else { h } * scale;
        if h.abs() < ABSURD_HEIGHT {
            h
        } else {
            bad += 1;
            0.0
        }
    };
    let heights = Grid::from_fn(image.size, height);
    if bad == image.size.area() {
        return Err(MapError::invalid(
            path,
            "holds no height: all are NaN, infinite or beyond a million texture widths",
        ));
    }
    let (low, high) = heights.texels().iter().fold((f32::MAX, f32::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    if high - low > STEEP_SPAN {
        let span = high - low;
        warnings.push(format!(
            "spans {span} texture widths of height: `--height-scale` is texture widths for one unit of height"
        ));
    }
    if bad > 0 {
        warnings.push(format!(
            "{bad} texels are NaN, infinite or beyond a million texture widths and take height 0"
        ));
    }
    Ok(HeightField { heights, wraps: options.wraps, filter: options.slope_filter })
}

/// True where red is full everywhere and alpha is not the same everywhere: no normals of a surface all point
/// along x, but DXT5nm has its x in alpha and its y in green.
fn is_swizzled(image: &Image) -> bool {
    let sample = |i: usize, c: usize| image.samples.get(i * image.channels + c);
    let mut texels = 0..image.size.area();
    image.channels == 4
        && texels.clone().all(|i| sample(i, 0) == 1.0)
        && texels.any(|i| sample(i, 3) != sample(0, 3))
}

/// Texels that tell what a picture holds: more would tell no more.
const WITNESSES: usize = 1 << 16;

/// Share of texels whose vectors have length one, to a tenth: more than 8 bits and JPEG move it. Black texels
/// and those that are not finite do not count.
fn unit_share(image: &Image, positive: bool) -> f64 {
    let (mut unit, mut all) = (0_usize, 0_usize);
    // An odd step goes over all columns of a map whose width is a power of two.
    for i in (0..image.size.area()).step_by((image.size.area() / WITNESSES) | 1) {
        let stored = Vec3::from_array([0, 1, 2].map(|c| image.samples.get(i * image.channels + c)));
        if stored == Vec3::ZERO || !stored.is_finite() {
            continue;
        }
        let vector = if positive { 2.0 * stored - 1.0 } else { stored };
        all += 1;
        unit += usize::from((vector.length() - 1.0).abs() < 0.1);
    }
    if all == 0 { 1.0 } else { unit as f64 / all as f64 }
}

/// True where stored values are the components themselves, from -1 to 1; else they run from 0 to 1. Floats of
/// which the format says nothing may be either: the decoding that makes more vectors of length one is right.
/// Without z, values from 0 to 1 lie around a half, and components around 0.
fn is_signed(image: &Image, two_channels: bool) -> bool {
    let Samples::F32(values) = &image.samples else { return false };
    if image.signed {
        return true;
    }
    if two_channels {
        let xy = values.chunks_exact(image.channels).flat_map(|texel| &texel[..2]);
        let (sum, count) =
            xy.filter(|v| v.is_finite()).fold((0.0, 0), |(s, n), v| (s + f64::from(*v), n + 1));
        return sum < 0.25 * f64::from(count);
    }
    let (signed, positive) = (unit_share(image, false), unit_share(image, true));
    signed > positive || signed == positive && values.iter().any(|v| *v < 0.0)
}

/// A normal map in the precision of its file, decoded a row at a time.
struct EncodedNormals {
    image: Image,
    wraps: Wraps,
    /// True when z is rebuilt from x and y.
    two_channels: bool,
    /// True when stored values run from 0 to 1 and stand for -1 to 1.
    positive: bool,
    /// Sign of green: 1, or -1 to turn DirectX's.
    green: f32,
}

impl EncodedNormals {
    fn new(
        path: &Path,
        image: Image,
        options: &SourceOptions,
        warnings: &mut Vec<String>,
    ) -> Result<Self, MapError> {
        if image.channels < 2 {
            return Err(MapError::unsupported(
                path,
                "has one channel: no normal map. `--from height` takes it as heights",
            ));
        }
        let image = if is_swizzled(&image) {
            warnings.push("is full in red: x is taken from alpha and y from green (DXT5nm)".to_owned());
            image.channels(&[3, 1])
        } else {
            image
        };
        let texels = || 0..image.size.area();
        let sample = |i: usize, c: usize| image.samples.get(i * image.channels + c);
        let no_blue = image.channels > 2 && texels().all(|i| sample(i, 2) == 0.0);
        if no_blue {
            warnings.push("has no blue: z is rebuilt from red and green".to_owned());
        }
        let two_channels = image.channels == 2 || no_blue;
        let positive = !is_signed(&image, two_channels);
        if !two_channels {
            let share = unit_share(&image, positive);
            if share < 0.5 {
                warnings.push(format!(
                    "holds few vectors of length one ({:.0} %): no tangent-space normal map, or blue is not z, or \
                     the channels are in another order",
                    100.0 * share
                ));
            }
        }
        let green = match options.convention {
            Convention::OpenGl => 1.0,
            Convention::DirectX => -1.0,
        };
        let normals = Self { two_channels, wraps: options.wraps, positive, green, image };
        normals.check_normals(options.convention, warnings);
        Ok(normals)
    }

    /// Counts texels that hold no normal, and checks whether the convention can be right.
    fn check_normals(&self, convention: Convention, warnings: &mut Vec<String>) {
        let mut row = SurfaceRow::flat(self.image.size.width);
        let below: usize = (0..self.image.size.height)
            .map(|y| {
                self.read_row(y, &mut row);
                row.z.iter().filter(|z| **z <= 0.0).count()
            })
            .sum();
        let count = |is: fn(f32) -> bool, need_all: bool| {
            let at = |i: usize, c: usize| is(self.image.samples.get(i * self.image.channels + c));
            let texel = |i: &usize| match need_all {
                true => at(*i, 0) && at(*i, 1) && at(*i, 2),
                false => (0..self.image.channels).any(|c| at(*i, c)),
            };
            (0..self.image.size.area()).filter(texel).count()
        };
        // Black in two channels is a legal, if steep, normal.
        let black = if self.two_channels { 0 } else { count(|v| v == 0.0, true) };
        let broken =
            if matches!(self.image.samples, Samples::F32(_)) { count(|v| !v.is_finite(), false) } else { 0 };
        let texels = self.image.size.area() as f64;
        let mut say = |n: usize, what: &str| {
            if n > 0 {
                warnings.push(format!("{n} texels ({:.2} %) {what}", 100.0 * n as f64 / texels));
            }
        };
        say(black, "are black, no direction, and become (0, 0, 1)");
        say(broken, "are NaN or infinite and become (0, 0, 1)");
        say(below, &format!("point to or below the horizon; their slopes are held to {MAX_SLOPE}"));
        let agreement = integrability(self);
        if agreement < CONTRADICTION {
            let other = match convention {
                Convention::OpenGl => Convention::DirectX,
                Convention::DirectX => Convention::OpenGl,
            };
            warnings.push(format!(
                "looks like a {} map (integrability {agreement:.2} as {}): try `--convention {}`",
                other.name(),
                convention.name(),
                other.name()
            ));
        }
    }

    /// Spreads a row of samples over the planes, each decoded to -1 .. 1.
    fn spread<T: Copy>(&self, samples: &[T], y: usize, row: &mut SurfaceRow, decode: impl Fn(T) -> f32) {
        let length = self.image.size.width * self.image.channels;
        let texels = samples[y * length..][..length].chunks_exact(self.image.channels);
        let planes = row.x.iter_mut().zip(&mut row.y).zip(&mut row.z);
        for (texel, ((x, y), z)) in texels.zip(planes) {
            (*x, *y) = (decode(texel[0]), decode(texel[1]));
            *z = if texel.len() > 2 { decode(texel[2]) } else { 0.0 };
        }
    }
}

impl EncodedNormals {
    /// Makes unit normals of decoded samples.
    #[inline(always)]
    fn normalise(&self, row: &mut SurfaceRow) {
        for ((x, y), z) in row.x.iter_mut().zip(&mut row.y).zip(&mut row.z) {
            if self.two_channels {
                *z = (1.0 - *x * *x - *y * *y).max(0.0).sqrt();
            }
            // Black, three zeros, is no direction: unsigned values decode it to the corner below.
            let black = self.positive && !self.two_channels && *x + *y + *z == -3.0;
            let v = if black { Vec3::ZERO } else { Vec3::new(*x, *y * self.green, *z) };
            let n = unit_or_up(v);
            (*x, *y, *z) = (n.x, n.y, n.z);
        }
    }
}

/// Values that the codes of an 8-bit channel stand for.
static DECODE_U8: std::sync::LazyLock<[f32; 256]> =
    std::sync::LazyLock::new(|| std::array::from_fn(|c| 2.0 * (c as f32 / 255.0) - 1.0));

impl Surface for EncodedNormals {
    fn size(&self) -> Size {
        self.image.size
    }

    fn wraps(&self) -> Wraps {
        self.wraps
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        row.height.fill(0.0);
        match &self.image.samples {
            Samples::U8(v) => {
                let table = &*DECODE_U8;
                self.spread(v, y, row, |c| table[usize::from(c)]);
            }
            Samples::U16(v) => self.spread(v, y, row, |c| 2.0 * (f32::from(c) / 65535.0) - 1.0),
            Samples::F32(v) if self.positive => self.spread(v, y, row, |c| 2.0 * c - 1.0),
            Samples::F32(v) => self.spread(v, y, row, |c| c),
        }
        dispatch!(Level::new(), _simd => self.normalise(row));
    }
}
