//! A baked map with its header, and the checks that make the two agree.

use std::path::Path;

use glam::DVec3;
use ndfmap_core::brdf::{Brdf, SurfaceParams};
use ndfmap_core::compact::Compact;
use ndfmap_core::lookup::{Filtering, PixelFootprint, Texels};
use ndfmap_core::ndf::{AnyMethod, Decoded, FilteredTexel, IncidentLight, Method};
use ndfmap_core::pyramid::{Layout, Precision, Pyramid};

use crate::formats::{WriteOptions, check_integers, read_file, read_ndf, to_write};
use crate::image::check_size;
use crate::{COMPACT_VERSION, Header, MapError, VERSION};

/// A normal distribution map.
#[derive(Clone, Debug, PartialEq)]
pub struct NdfMap {
    /// Header: method, size, encoding and source.
    pub header: Header,
    /// Pyramid of the levels.
    pub pyramid: Pyramid,
}

impl NdfMap {
    /// Reads a baked map.
    ///
    /// # Errors
    /// [`MapError`] for a file that cannot be read, is damaged, or holds a plain picture.
    pub fn open(path: &Path) -> Result<Self, MapError> {
        let plain = || MapError::unsupported(path, "is a plain picture, no baked map");
        read_ndf(path, &read_file(path)?)?.ok_or_else(plain)
    }

    /// Writes the map to a file, whole or not at all, in the format that its name asks for; returns its
    /// length in bytes.
    ///
    /// # Errors
    /// [`MapError`] for a name or options that no format has, and for a file that cannot be written.
    pub fn save(&self, path: &Path, options: &WriteOptions) -> Result<u64, MapError> {
        let format = to_write(path)?;
        check_integers(path, format, options)?;
        if options.compact.is_none() && self.header.compact.is_some() {
            // Floats have no ranges.
            let version = if self.header.from_level == 0 { VERSION } else { COMPACT_VERSION };
            let header = Header { version, compact: None, ..self.header.clone() };
            return Self { header, pyramid: self.pyramid.clone() }.save(path, options);
        }
        match format.write_ndf {
            Some(write) => write(path, self, options),
            None => unreachable!("formats to write have a writer"),
        }
    }

    /// Form of the map's integers, as its file holds them; `None` for floats.
    ///
    /// # Errors
    /// [`MapError`] for a header that does not fit the map; `path` is for the message.
    pub fn compact(&self, path: &Path) -> Result<Option<Compact>, MapError> {
        let own = self.header.compact.as_ref();
        own.map(|own| own.compact(path, self.method(path)?.encoding(), self.pyramid.layers())).transpose()
    }

    /// Method that decodes the map.
    ///
    /// # Errors
    /// [`MapError`] when the header names no method; `path` is for the message.
    pub fn method(&self, path: &Path) -> Result<AnyMethod, MapError> {
        method_of(path, &self.header)
    }

    /// Returns the map as another method reads it: `slopes:9` reads bakes of `slopes`, `naive` those of
    /// `toksvig`, `sh:4` those of `sh:7`. Lobes stay as they were fitted, whatever alignment the method would
    /// have asked for.
    ///
    /// # Errors
    /// [`MapError`] for a method that reads other channels, and for a header that names no method; `path` is
    /// for the message.
    pub fn read_by(&self, path: &Path, method: &dyn Method) -> Result<Self, MapError> {
        let own = self.method(path)?;
        if !method.reads(&own.encoding()) {
            let reason = format!("was baked by `{own}`, whose channels `{method}` does not read");
            return Err(MapError::unsupported(path, reason));
        }
        let header = Header { method: method.to_string(), ..self.header.clone() };
        if self.header.attributes.is_empty() {
            return Ok(Self { header, pyramid: self.pyramid.first_layers(method.layers()) });
        }
        Ok(Self { header, pyramid: self.pyramid.clone() })
    }

    /// A texel as it is stored; `None` beyond the map, or where the header names no method.
    #[must_use]
    pub fn texel(&self, level: usize, x: usize, y: usize) -> Option<NdfTexel> {
        self.pyramid.sizes().get(level).filter(|size| x < size.width && y < size.height)?;
        let method = self.header.method.parse().ok()?;
        Some(NdfTexel { method, channels: self.pyramid.texel(level, x, y) })
    }

    /// Texel that a pixel sees, filtered over its footprint; `None` where the header names no method.
    #[must_use]
    pub fn sample(&self, pixel: &PixelFootprint, filtering: Filtering) -> Option<NdfTexel> {
        let method: AnyMethod = self.header.method.parse().ok()?;
        let mut channels = vec![0.0; self.pyramid.channels()];
        self.pyramid.filtered(pixel, filtering, &mut channels);
        Some(NdfTexel { method, channels })
    }

    /// Puts a map together from a file's parts, checking that they agree.
    pub(crate) fn assemble(
        path: &Path,
        header: Header,
        precision: Precision,
        levels: Vec<Vec<u8>>,
    ) -> Result<Self, MapError> {
        let layout = layout_of(path, &header, precision)?;
        let pyramid = Pyramid::new(layout, levels).map_err(|e| MapError::invalid(path, e))?;
        Ok(Self { header, pyramid })
    }
}

/// A texel of a map, stored or filtered.
#[derive(Clone, Debug, PartialEq)]
pub struct NdfTexel {
    /// The method that reads it.
    pub method: AnyMethod,
    /// Channels, four a layer, those of attributes last.
    pub channels: Vec<f32>,
}

impl NdfTexel {
    /// Channels of the method itself, without those of attributes.
    fn own(&self) -> &[f32] {
        &self.channels[..4 * self.method.layers()]
    }

    /// Distribution of normals that the texel stands for.
    #[must_use]
    pub fn decoded(&self) -> Decoded {
        self.method.describe(self.own())
    }

    /// Value of an attribute that a lobe carries; `None` without such an attribute or lobe.
    #[must_use]
    pub fn attribute(&self, attribute: usize, lobe: usize) -> Option<[f32; 4]> {
        self.method.lobe_layout()?.attribute(&self.channels, attribute, lobe)
    }

    /// Light that the texel sends to the eye, linear RGB: every light on every normal. The material has one
    /// colour and roughness everywhere.
    #[must_use]
    pub fn shade(&self, brdf: &Brdf, params: &SurfaceParams, lights: &[IncidentLight]) -> DVec3 {
        let texel = FilteredTexel {
            channels: self.own(),
            params: &|_| *params,
            prepared: &self.method.prepare(brdf, params.roughness),
            at_means: false,
            slope_map: None,
        };
        self.method.reflect(&texel, lights)
    }
}

/// Attributes that a map may carry.
pub const MAX_ATTRIBUTES: usize = 15;

pub(crate) fn method_of(path: &Path, header: &Header) -> Result<AnyMethod, MapError> {
    header.method.parse::<AnyMethod>().map_err(|e| MapError::unsupported(path, e))
}

/// The layout that a header promises.
pub(crate) fn layout_of(path: &Path, header: &Header, precision: Precision) -> Result<Layout, MapError> {
    let size = check_size(path, header.width, header.height)?;
    let method = method_of(path, header)?;
    let carried = header.attributes.len();
    if carried > 0 && !method.carries_attributes() || carried > MAX_ATTRIBUTES {
        let reason = format!("says that `{}` carries {carried} attributes", header.method);
        return Err(MapError::invalid(path, reason));
    }
    let layers = method.layers_with(carried);
    Ok(Layout { size, layers, precision, wraps: header.wraps(path)? })
}
