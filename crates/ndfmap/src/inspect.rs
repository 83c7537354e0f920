//! Descriptions of files and texels, for people and scripts.

use std::path::Path;

use glam::{DVec2, DVec3};
use ndfmap_core::grid::Size;
use ndfmap_core::ndf::{Decoded, NormalLobe};
use ndfmap_core::surface::{Surface, SurfaceRow, integrability, slope_of_normal};
use ndfmap_maps::formats::{read_file, read_image, read_image_layer};
use ndfmap_maps::model::{ModelOptions, read_model};
use ndfmap_maps::source::{
    BUILTIN_PREFIX, Convention, DEFAULT_HEIGHT_SCALE, NormalLayout, PictureKind, SourceMap, SourceOptions,
    identify, read_source, source_of_image,
};
use ndfmap_maps::{Header, MapError, NdfMap, Source, SourceKind};
use ndfmap_scene::{Material, MaterialMap, Mesh, SceneOptions};
use serde::{Serialize, Serializer};

use crate::Error;

/// Description of a baked map.
#[derive(Clone, Debug, Serialize)]
pub struct MapReport {
    /// Header of the file.
    #[serde(flatten)]
    pub header: Header,
    /// RGBA layers.
    pub layers: usize,
    /// Bits of a stored channel: `half` or `single`.
    pub precision: String,
    /// Sizes of the levels, finest first.
    pub levels: Vec<LevelSize>,
}

/// Size of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LevelSize {
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Description of a picture: what it looks like, and its surface where it holds one.
#[derive(Clone, Debug, Serialize)]
pub struct PictureReport {
    /// Kind that it looks like, or is taken as.
    pub kind: PictureKind,
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Samples a texel.
    pub channels: usize,
    /// Smallest and largest finite sample; integers run from 0 to 1.
    pub range: [f32; 2],
    /// Channels of a normal, for normals.
    pub layout: Option<NormalLayout>,
    /// Direction of green, for normals: `opengl` is up, `directx` down; `None` where nothing tells it.
    pub convention: Option<&'static str>,
    /// Sentences that tell what it looks like.
    pub evidence: Vec<String>,
    /// Surface that it holds, for normals and heights.
    #[serde(flatten)]
    pub surface: Option<SurfaceReport>,
    /// Warnings of its reader.
    pub warnings: Vec<String>,
}

/// Description of a surface that is to be baked.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceReport {
    /// Source that it was read from.
    pub source: Source,
    /// Length of the mean normal; 1 for a flat map.
    pub mean_normal_length: f64,
    /// Variance of the slopes along x and along y.
    pub slope_variance: [f64; 2],
    /// Measure of how well the slopes are the gradient of some height with green up: 1 for a perfect
    /// gradient, near 0 when nothing can be said, negative when green points down.
    pub integrability: f64,
}

/// Description of a model.
#[derive(Clone, Debug, Serialize)]
pub struct ModelReport {
    /// `model`.
    pub kind: &'static str,
    /// Meshes, a material each.
    pub meshes: usize,
    /// Vertices of all meshes.
    pub vertices: usize,
    /// Triangles of all meshes.
    pub triangles: usize,
    /// Materials that meshes have.
    pub materials: Vec<MaterialReport>,
    /// Warnings of its reader.
    pub warnings: Vec<String>,
}

/// Description of a material.
#[derive(Clone, Debug, Serialize)]
pub struct MaterialReport {
    /// Name.
    pub name: String,
    /// Texels in a row of its map; 1 where it has none.
    pub width: usize,
    /// Rows of its map.
    pub height: usize,
    /// Variance of the slopes of its normals, along x and along y; 0 for a flat map.
    pub slope_variance: [f64; 2],
}

/// Describes a model.
///
/// # Errors
/// [`Error::Map`] when it cannot be read.
pub fn describe_model(path: &Path) -> Result<ModelReport, Error> {
    let options = ModelOptions { staging: SceneOptions::default(), material: None };
    let (scene, warnings) = read_model(path, &options)?;
    let used = |(at, _): &(usize, &Material)| scene.objects.iter().any(|object| object.material == *at);
    let material = |(_, material): (usize, &Material)| {
        let size = material.map.size();
        let slope_variance = match &material.map {
            MaterialMap::Surface(surface) => SlopeStatistics::of(&**surface).variance(),
            MaterialMap::Baked(_) => [0.0; 2],
        };
        let Size { width, height } = size;
        MaterialReport { name: material.name.clone(), width, height, slope_variance }
    };
    let count = |of: fn(&Mesh) -> usize| scene.objects.iter().map(|object| of(&object.mesh)).sum();
    Ok(ModelReport {
        kind: "model",
        meshes: scene.objects.len(),
        vertices: count(|mesh| mesh.vertices.len()),
        triangles: count(|mesh| mesh.triangles.len()),
        materials: scene.materials.iter().enumerate().filter(used).map(material).collect(),
        warnings,
    })
}

/// Texel of a baked map, decoded.
#[derive(Clone, Debug, Serialize)]
pub struct TexelReport {
    /// Level, 0 the finest.
    pub level: usize,
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Spelling of the method.
    pub method: String,
    /// Distribution of its normals.
    #[serde(flatten)]
    pub decoded: DecodedReport,
}

/// Distribution of normals, in a form for scripts.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum DecodedReport {
    /// A mean normal.
    Mean {
        /// Mean normal.
        mean: [f64; 3],
    },
    /// A Gaussian in space.
    Gaussian {
        /// Mean normal.
        mean: [f64; 3],
        /// Covariance of the normals.
        covariance: [[f64; 3]; 3],
    },
    /// A Gaussian of slopes.
    Slopes {
        /// Mean slope.
        mean: [f64; 2],
        /// Covariance of the slopes.
        covariance: [[f64; 2]; 2],
        /// Mean height in texture widths.
        height: f64,
    },
    /// A Gaussian of normals on the plane, seen from the pole below.
    Projected {
        /// Mean.
        mean: [f64; 2],
        /// Covariance.
        covariance: [[f64; 2]; 2],
    },
    /// Coefficients of real spherical harmonics.
    Coefficients {
        /// Coefficients: l, then m from -l to l.
        coefficients: Vec<f64>,
    },
    /// Lobes.
    Lobes {
        /// Lobes that are alive.
        lobes: Vec<LobeReport>,
    },
    /// Phong peaks.
    Peaks {
        /// The peaks.
        peaks: Vec<LobeReport>,
    },
}

/// Lobe, in a form for scripts; of the three widths it has the one of its kind.
#[derive(Clone, Debug, Serialize)]
pub struct LobeReport {
    /// Number among the lobes of the texel.
    #[serde(rename = "layer")]
    pub index: usize,
    /// Share of the texel.
    pub weight: f64,
    /// Mean direction; two numbers for a planar lobe.
    pub mean: Vec<f64>,
    /// Concentration of a von Mises-Fisher lobe.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kappa: Option<f64>,
    /// Exponent of a Phong peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exponent: Option<f64>,
    /// Variance of a planar lobe, on one axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub variance: Option<f64>,
    /// Attributes that the lobe carries: mean of each over its normals, by the attribute's name.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "by_name")]
    pub attributes: Vec<CarriedAttribute>,
}

/// Mean of an attribute over a lobe's normals.
#[derive(Clone, Debug, PartialEq)]
pub struct CarriedAttribute {
    /// Name of the attribute.
    pub name: String,
    /// Mean of each channel.
    pub mean: Vec<f32>,
}

/// Attributes as an object with a key a name.
fn by_name<S: Serializer>(attributes: &[CarriedAttribute], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(attributes.iter().map(|a| (&a.name, &a.mean)))
}

/// Largest `kappa` or exponent, of a lobe whose stored form has no spread; JSON has no infinity.
const MOST_KAPPA: f64 = 1e6;

/// Describes a baked map.
#[must_use]
pub fn describe_map(map: &NdfMap) -> MapReport {
    let size = |s: &Size| LevelSize { width: s.width, height: s.height };
    MapReport {
        header: map.header.clone(),
        layers: map.pyramid.layers(),
        precision: format!("{:?}", map.pyramid.precision()).to_lowercase(),
        levels: map.pyramid.sizes().iter().map(size).collect(),
    }
}

/// Describes a picture, or a built-in surface.
///
/// # Errors
/// [`Error::Map`] when it cannot be read as the options say.
pub fn describe_picture(path: &Path, options: &SourceOptions) -> Result<PictureReport, Error> {
    if path.to_str().is_some_and(|name| name.starts_with(BUILTIN_PREFIX)) {
        return Ok(describe_builtin(&read_source(path, options)?));
    }
    let bytes = read_file(path)?;
    let image = match &options.layer {
        Some(layer) => read_image_layer(path, &bytes, layer)?,
        None => read_image(path, &bytes)?,
    };
    let identity = identify(path, &image);
    let samples = (0..image.samples.len()).map(|i| image.samples.get(i)).filter(|v| v.is_finite());
    let range = samples.fold([f32::MAX, f32::MIN], |[low, high], v| [low.min(v), high.max(v)]);
    let mut report = PictureReport {
        kind: identity.kind,
        width: image.size.width,
        height: image.size.height,
        channels: image.channels,
        range,
        layout: identity.layout,
        convention: None,
        evidence: identity.evidence,
        surface: None,
        warnings: image.warnings.clone(),
    };
    let kind = options.kind.or(match identity.kind {
        PictureKind::Normal => Some(SourceKind::Normal),
        PictureKind::Height => Some(SourceKind::Height),
        _ => None,
    });
    let Some(kind) = kind else { return Ok(report) };
    // A description is given where a bake would ask: of the slopes with green up, and at the default scale.
    let told = SourceOptions {
        kind: Some(kind),
        convention: options.convention.or(Some(Convention::OpenGl)).filter(|_| kind == SourceKind::Normal),
        height_scale: options
            .height_scale
            .or(Some(DEFAULT_HEIGHT_SCALE))
            .filter(|_| kind == SourceKind::Height),
        ..options.clone()
    };
    let mut map = source_of_image(path, image.clone(), String::new(), &told)?;
    if let Some(evidence) = map.convention {
        let verdict = options.convention.or(evidence.verdict());
        if verdict != told.convention && verdict.is_some() {
            map =
                source_of_image(path, image, String::new(), &SourceOptions { convention: verdict, ..told })?;
        }
        report.convention = verdict.map(Convention::name);
        report.evidence.push(evidence.to_string());
        report.kind = PictureKind::Normal;
    } else {
        report.kind = PictureKind::Height;
    }
    report.warnings = map.warnings.clone();
    let mut surface = describe_surface(&map);
    if let Some(evidence) = map.convention {
        surface.integrability = evidence.integrability;
        surface.source.convention = report.convention.map(str::to_owned);
    }
    report.surface = Some(surface);
    Ok(report)
}

fn describe_builtin(map: &SourceMap) -> PictureReport {
    let size = map.surface.size();
    let normal = map.source.kind == SourceKind::Normal;
    PictureReport {
        kind: if normal { PictureKind::Normal } else { PictureKind::Height },
        width: size.width,
        height: size.height,
        channels: 3,
        range: [0.0, 1.0],
        layout: normal.then_some(NormalLayout::Xyz),
        convention: normal.then_some(Convention::OpenGl.name()),
        evidence: vec!["is built in".to_owned()],
        surface: Some(describe_surface(map)),
        warnings: map.warnings.clone(),
    }
}

fn describe_surface(map: &SourceMap) -> SurfaceReport {
    let statistics = SlopeStatistics::of(&*map.surface);
    SurfaceReport {
        source: map.source.clone(),
        mean_normal_length: statistics.mean_normal.length(),
        slope_variance: statistics.variance(),
        integrability: integrability(&*map.surface),
    }
}

/// Means over a surface's texels.
struct SlopeStatistics {
    mean_normal: DVec3,
    mean_slope: DVec2,
    mean_square: DVec2,
}

impl SlopeStatistics {
    fn of(surface: &dyn Surface) -> Self {
        let size = surface.size();
        let (mut normal, mut slope, mut square) = (DVec3::ZERO, DVec2::ZERO, DVec2::ZERO);
        let mut row = SurfaceRow::flat(size.width);
        for y in 0..size.height {
            surface.read_row(y, &mut row);
            for x in 0..size.width {
                let s = slope_of_normal(row.normal(x)).as_dvec2();
                normal += row.normal(x).as_dvec3();
                slope += s;
                square += s * s;
            }
        }
        let texels = size.area() as f64;
        Self { mean_normal: normal / texels, mean_slope: slope / texels, mean_square: square / texels }
    }

    /// Variance of the slopes along x and along y.
    fn variance(&self) -> [f64; 2] {
        (self.mean_square - self.mean_slope * self.mean_slope).to_array()
    }
}

/// Decodes a texel of a baked map, which came from the file at `path`.
///
/// # Errors
/// [`Error::Request`] for a texel beyond the map, and [`Error::Map`] for a header that names no method.
pub fn describe_texel(path: &Path, map: &NdfMap, [level, x, y]: [usize; 3]) -> Result<TexelReport, Error> {
    let sizes = map.pyramid.sizes();
    let inside = sizes.get(level).is_some_and(|s| x < s.width && y < s.height);
    if !inside {
        let range = match sizes.get(level) {
            Some(s) => format!("level {level} is {} × {}", s.width, s.height),
            None => format!("levels run from 0 to {}", sizes.len() - 1),
        };
        return Err(Error::Request(format!("{}: has no texel {level} {x} {y}: {range}", path.display())));
    }
    map.method(path)?;
    let texel = map.texel(level, x, y).ok_or_else(|| MapError::invalid(path, "cannot be decoded"))?;
    let lobe = |l: &NormalLobe| {
        let carried = |(k, attribute): (usize, &ndfmap_maps::Attribute)| {
            let mean = texel.attribute(k, l.index)?[..attribute.channels.min(4)].to_vec();
            Some(CarriedAttribute { name: attribute.name.clone(), mean })
        };
        LobeReport {
            index: l.index,
            weight: l.weight,
            mean: l.mean.to_array().to_vec(),
            kappa: None,
            exponent: None,
            variance: None,
            attributes: map.header.attributes.iter().enumerate().filter_map(carried).collect(),
        }
    };
    let concentration = |l: &NormalLobe| Some(l.variance.get().recip().min(MOST_KAPPA));
    let spherical = |l: &NormalLobe| LobeReport { kappa: concentration(l), ..lobe(l) };
    let peak = |l: &NormalLobe| LobeReport { exponent: concentration(l), ..lobe(l) };
    let planar = |l: &NormalLobe| LobeReport {
        mean: l.mean.truncate().to_array().to_vec(),
        variance: Some(l.variance.get()),
        ..lobe(l)
    };
    let decoded = match texel.decoded() {
        Decoded::Mean(mean) => DecodedReport::Mean { mean: mean.to_array() },
        Decoded::Gaussian { mean, covariance } => {
            DecodedReport::Gaussian { mean: mean.to_array(), covariance: covariance.to_cols_array_2d() }
        }
        Decoded::Slopes { height, mean, covariance: [xx, yy, xy] } => {
            DecodedReport::Slopes { mean: mean.to_array(), covariance: [[xx, xy], [xy, yy]], height }
        }
        Decoded::Projected { mean, covariance: [xx, yy, xy] } => {
            DecodedReport::Projected { mean: mean.to_array(), covariance: [[xx, xy], [xy, yy]] }
        }
        Decoded::Coefficients(coefficients) => DecodedReport::Coefficients { coefficients },
        Decoded::Lobes(lobes) => DecodedReport::Lobes { lobes: lobes.iter().map(spherical).collect() },
        Decoded::Peaks(peaks) => DecodedReport::Peaks { peaks: peaks.iter().map(peak).collect() },
        Decoded::PlanarLobes(lobes) => DecodedReport::Lobes { lobes: lobes.iter().map(planar).collect() },
    };
    Ok(TexelReport { level, x, y, method: map.header.method.clone(), decoded })
}
