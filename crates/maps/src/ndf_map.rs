//! A baked map with its header, and the checks that make the two agree.

use std::path::Path;

use ndfmap_core::pyramid::{Layout, Precision, Pyramid};

use crate::image::check_size;
use crate::{Header, MapError};
use ndfmap_core::ndf::AnyMethod;

/// A normal distribution map.
#[derive(Clone, Debug, PartialEq)]
pub struct NdfMap {
    /// What it is.
    pub header: Header,
    /// Its levels.
    pub pyramid: Pyramid,
}

impl NdfMap {
    /// The method that decodes it.
    ///
    /// # Errors
    /// [`MapError`] when the header names none.
    pub fn method(&self, path: &Path) -> Result<AnyMethod, MapError> {
        method_of(path, &self.header)
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

/// Attributes that a map may carry.
pub const MAX_ATTRIBUTES: usize = 15;

fn method_of(path: &Path, header: &Header) -> Result<AnyMethod, MapError> {
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
