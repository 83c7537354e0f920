//! Baked maps: a material's map, baked with one method for renderers to look up, and a baked map as the
//! surface of a material.

use glam::DVec3;

use ndfmap_core::bake::Bake;
use ndfmap_core::compact::Storage;
use ndfmap_core::fit::Rgba;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::ndf::{AnyMethod, Decoded, Method};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::pyramid::Pyramid;
use ndfmap_core::surface::{Surface, SurfaceRow, Wraps};

use super::Material;

/// Baked map of one material. Lights, lobes and models come in when shading.
pub struct BakedMaterial {
    /// The method's layers, then those of the attributes that its lobes carry.
    pub pyramid: Pyramid,
    /// Number of attributes that lobes carry: albedo with roughness, and specular colour.
    pub attributes: usize,
    /// Maps of these attributes, finest level, for methods whose lobes carry none.
    pub params: Vec<Grid<Rgba>>,
}

impl BakedMaterial {
    /// Bakes the map, with colours and roughness in the lobes where the method has lobes that can carry them.
    ///
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn new(
        material: &Material,
        method: &dyn Method,
        storage: Storage,
        observer: &dyn Observer,
    ) -> Result<Self, Cancelled> {
        let maps = material.textures.as_ref().map_or_else(Vec::new, |map| map.grids());
        if let Some(pyramid) = material.map.baked(method) {
            return Ok(Self { pyramid, attributes: 0, params: maps });
        }
        let bake = Bake::new(&*material.map, method).precision(storage.baked()).observer(observer);
        let stored = |pyramid: Pyramid| storage.stored(pyramid, method.encoding());
        if method.carries_attributes() {
            let pyramid = stored(bake.attributes(&maps).to_pyramid()?.0);
            return Ok(Self { pyramid, attributes: maps.len(), params: Vec::new() });
        }
        Ok(Self { pyramid: stored(bake.to_pyramid()?.0), attributes: 0, params: maps })
    }
}

/// A baked map, taken for a surface. The method that baked it renders it as it is. The truth sees its finest
/// level, where a texel is one normal, and other methods bake that level.
pub struct BakedSurface {
    /// Method that baked the map.
    pub method: AnyMethod,
    /// The map.
    pub pyramid: Pyramid,
}

impl BakedSurface {
    /// The stored map for a method that reads its channels, or the first of them, and would have fitted the
    /// same lobes.
    #[must_use]
    pub fn read_by(&self, method: &dyn Method) -> Option<Pyramid> {
        let same = method.reads(&self.method.encoding()) && method.fit() == self.method.fit();
        same.then(|| self.pyramid.first_layers(method.layers()))
    }
}

impl Surface for BakedSurface {
    fn size(&self) -> Size {
        self.pyramid.sizes()[0]
    }

    fn wraps(&self) -> Wraps {
        self.pyramid.wraps()
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        row.spread.clear();
        for x in 0..self.size().width {
            let channels = self.pyramid.texel(0, x, y);
            let channels = &channels[..4 * self.method.layers()];
            row.height[x] = match self.method.describe(channels) {
                Decoded::Slopes { height, covariance, .. } => {
                    row.spread.push(covariance.map(|c| c as f32));
                    height as f32
                }
                _ => 0.0,
            };
            let mean = self.method.mean_normal(channels);
            row.set_normal(x, mean.normalize_or(DVec3::Z).as_vec3());
        }
    }

    fn has_height(&self) -> bool {
        // Slopes of a normal map come without heights.
        let mut row = SurfaceRow::flat(self.size().width);
        (0..self.size().height).any(|y| {
            self.read_row(y, &mut row);
            row.height.iter().any(|h| *h != 0.0)
        })
    }
}
