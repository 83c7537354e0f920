//! Sources: pictures, and built-in surfaces, read as normal maps or height maps.

mod fit;
mod heights;
mod identity;
mod normals;

use std::path::Path;
use std::sync::Arc;

use ndfmap_core::grid::Size;
use ndfmap_core::procedural;
use ndfmap_core::surface::{SlopeFilter, Surface, Wraps};
use ndfmap_core::words;
use sha2::{Digest, Sha256};

pub use self::fit::{HeightFit, fit_height_scale};
pub use self::identity::{Identity, NormalLayout, PictureKind, identify};
pub use self::normals::ConventionEvidence;

use self::heights::height_field;
use self::normals::EncodedNormals;
use crate::formats::{read_file, read_image, read_image_layer};
use crate::header::{Source, SourceKind};
use crate::{Image, MapError, Samples};

/// Direction of green in a normal map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// Up the picture.
    OpenGl,
    /// Down the picture.
    DirectX,
}

words!(Convention { OpenGl => "opengl", DirectX => "directx" });

/// Options for reading a picture as a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceOptions {
    /// Name of the layer, part or channel to read, of an OpenEXR file that has several.
    pub layer: Option<String>,
    /// Kind of the map, normals or heights; `None` decides by [`identify`].
    pub kind: Option<SourceKind>,
    /// Direction of green, for normal maps; `None` decides by [`ConventionEvidence`].
    pub convention: Option<Convention>,
    /// Texture widths that one unit of height stands for, for height maps (full white of an integer picture
    /// is one unit); `None` for [`DEFAULT_HEIGHT_SCALE`], where that gives slopes that a surface can have.
    pub height_scale: Option<f64>,
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
            layer: None,
            kind: None,
            convention: None,
            height_scale: None,
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
    /// Evidence of the direction of green, for pictures of normals.
    pub convention: Option<ConventionEvidence>,
    /// Warnings of the reader.
    pub warnings: Vec<String>,
}

/// Prefix of the names of built-in surfaces.
pub const BUILTIN_PREFIX: &str = "builtin:";

/// Reads `map`: a file, or `builtin:NAME`.
///
/// # Errors
/// [`MapError`] when there is no such surface, or the file cannot be read.
pub fn read_source(map: &Path, options: &SourceOptions) -> Result<SourceMap, MapError> {
    if let Some(name) = map.to_str().and_then(|m| m.strip_prefix(BUILTIN_PREFIX)) {
        return builtin(map, name, options);
    }
    source_of_bytes(map, &read_file(map)?, options)
}

/// Reads the bytes of a whole file. The path names it, and tells the format of those few that have no
/// signature.
///
/// # Errors
/// [`MapError`], as for a file.
pub fn source_of_bytes(map: &Path, bytes: &[u8], options: &SourceOptions) -> Result<SourceMap, MapError> {
    let image = match &options.layer {
        Some(layer) => read_image_layer(map, bytes, layer)?,
        None => read_image(map, bytes)?,
    };
    let sha256 = Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect();
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
    Ok(SourceMap { surface: surface.into(), source, convention: None, warnings })
}

/// Reads a decoded picture as a surface; the layer has been chosen.
///
/// # Errors
/// [`MapError`] for a picture that does not fit the options, and where they leave open what it does not tell:
/// one that looks like no map, and a normal map whose green may point up or down.
pub fn source_of_image(
    path: &Path,
    image: Image,
    sha256: String,
    options: &SourceOptions,
) -> Result<SourceMap, MapError> {
    let mut warnings = image.warnings.clone();
    let identity = match options.kind {
        Some(SourceKind::Normal) => identity::identify_normals(path, &image),
        _ => identify(path, &image),
    };
    let kind = match (options.kind, identity.kind) {
        (Some(kind), _) => kind,
        (None, PictureKind::Normal) => SourceKind::Normal,
        (None, PictureKind::Height) => SourceKind::Height,
        (None, other) => {
            let why = identity.evidence.join("; ");
            let reason = format!(
                "looks like {}, not like normals or heights ({why}): `--from normal` or `--from height` takes it \
                 all the same",
                other.described()
            );
            return Err(MapError::NoMap { path: path.to_owned(), reason });
        }
    };
    let file = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut source = Source { file, kind, sha256, height_scale: None, convention: None };
    if kind == SourceKind::Height {
        // Of more than 8 bits are heights, not masks.
        let coarse = matches!(image.samples, Samples::U8(_));
        if options.kind.is_none() && coarse && identity.evidence == [identity::GREY_ALONE] {
            warnings.push(format!("{}, and is taken as heights", identity::GREY_ALONE));
        }
        if options.convention.is_some() {
            warnings.push("is taken as heights: `--convention` does nothing".to_owned());
        }
        let surface = height_field(path, &image, options, &mut warnings)?;
        source.height_scale = Some(options.height_scale.unwrap_or(DEFAULT_HEIGHT_SCALE));
        return Ok(SourceMap { surface: Arc::new(surface), source, convention: None, warnings });
    }
    if options.height_scale.is_some() || options.invert {
        warnings.push("is taken as normals: `--height-scale` and `--invert` do nothing".to_owned());
    }
    let mut normals = EncodedNormals::new(path, image, &identity, options.wraps)?;
    let evidence = ConventionEvidence::of(path, &normals);
    let convention = evidence.follow(path, options.convention, &mut warnings)?;
    normals.turn(convention);
    normals.check(&identity, &mut warnings);
    source.convention = Some(convention.name().to_owned());
    Ok(SourceMap { surface: Arc::new(normals), source, convention: Some(evidence), warnings })
}
