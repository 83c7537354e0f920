//! A material's map, baked with one method: what renderers look up.

use crate::bake::Bake;
use crate::fit::{Four, LobeKind};
use crate::grid::Grid;
use crate::ndf::Method;
use crate::pyramid::{Precision, Pyramid};

use super::Material;

/// What a bake makes of one material. Lights, lobes and models come in when shading.
pub struct BakedMaterial {
    /// The method's layers, then those of the attributes that its lobes carry.
    pub pyramid: Pyramid,
    /// How many attributes lobes carry: albedo with gloss, and specular colour.
    pub attributes: usize,
    /// The same as maps of their own, finest level, for methods whose lobes carry none.
    pub finish: Vec<Grid<Four>>,
}

impl BakedMaterial {
    /// Bakes the map, with the finish in the lobes where the method has lobes that can carry it; `progress` is told the
    /// fraction done.
    #[must_use]
    pub fn new(
        material: &Material,
        method: &dyn Method,
        precision: Precision,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Self {
        let bake = Bake { surface: &*material.surface, method, precision, progress };
        let maps = material.finish_map.as_ref().map_or_else(Vec::new, |map| map.grids());
        if method.fit().is_some_and(|fit| fit.kind != LobeKind::Peaks) {
            let (pyramid, _) = bake.to_pyramid_with(&maps);
            return Self { pyramid, attributes: maps.len(), finish: Vec::new() };
        }
        Self { pyramid: bake.to_pyramid().0, attributes: 0, finish: maps }
    }
}
