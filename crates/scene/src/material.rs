//! Materials: a normal or height map, its surface parameters, and its BRDF.

use std::ops::Deref;
use std::sync::Arc;

use glam::DVec3;

use super::Displacement;
use ndfmap_core::brdf::{Brdf, SurfaceParams};
use ndfmap_core::grid::Grid;
use ndfmap_core::ndf::Method;
use ndfmap_core::pyramid::Pyramid;
use ndfmap_core::surface::Surface;

use crate::BakedSurface;
use ndfmap_core::units::SlopeVariance;

/// A [`SurfaceParams`] for each texel.
#[derive(Clone, Debug)]
pub struct SurfaceTextures {
    /// Diffuse albedo, and the roughness as a slope variance.
    pub diffuse_roughness: Arc<Grid<[f32; 4]>>,
    /// Specular colour, where it changes from place to place; the fourth is 1.
    pub specular: Option<Arc<Grid<[f32; 4]>>>,
}

impl SurfaceTextures {
    /// Surface parameters of a texel; `specular` is the specular colour where the map has none.
    #[must_use]
    pub fn at(&self, x: usize, y: usize, specular: DVec3) -> SurfaceParams {
        let of = |map: &Grid<[f32; 4]>| map.row(y)[x];
        Self::from_channels(of(&self.diffuse_roughness), self.specular.as_deref().map(of), specular)
    }

    /// The least and the most roughness of any texel.
    #[must_use]
    pub fn roughness_range(&self) -> (SlopeVariance, SlopeVariance) {
        let all = || self.diffuse_roughness.texels().iter().map(|texel| texel[3].max(0.0));
        let (least, most) = (all().fold(f32::INFINITY, f32::min), all().fold(0.0, f32::max));
        (SlopeVariance::clamped(least.into()), SlopeVariance::clamped(most.into()))
    }

    /// The maps one by one: albedo and roughness, and specular colour where it changes.
    #[must_use]
    pub fn grids(&self) -> Vec<Grid<[f32; 4]>> {
        std::iter::once(&self.diffuse_roughness).chain(&self.specular).map(|map| (**map).clone()).collect()
    }

    /// Surface parameters from their channels, filtered or not.
    #[must_use]
    pub fn from_channels(
        diffuse_roughness: [f32; 4],
        mapped: Option<[f32; 4]>,
        specular: DVec3,
    ) -> SurfaceParams {
        let colour = |[r, g, b, _]: [f32; 4]| DVec3::new(r.into(), g.into(), b.into());
        SurfaceParams {
            diffuse: colour(diffuse_roughness),
            specular: mapped.map_or(specular, colour),
            roughness: SlopeVariance::clamped(diffuse_roughness[3].into()),
        }
    }

    /// Textures without a highlight: specular colour becomes albedo, where it is the brighter.
    #[must_use]
    pub(super) fn without_highlight(self) -> Self {
        let Some(specular) = &self.specular else { return self };
        let brighter = |x: usize, y: usize| {
            let ([r, g, b, roughness], s) = (self.diffuse_roughness.row(y)[x], specular.row(y)[x]);
            [r.max(s[0]), g.max(s[1]), b.max(s[2]), roughness]
        };
        Self { diffuse_roughness: Grid::from_fn(specular.size(), brighter).into(), specular: None }
    }
}

/// Map of a material, which derefs to its surface.
#[derive(Clone)]
pub enum MaterialMap {
    /// A surface, baked by every method that draws it.
    Surface(Arc<dyn Surface>),
    /// A map that was baked before, drawn as it is by methods that read it.
    Baked(Arc<BakedSurface>),
}

impl MaterialMap {
    /// Stored map as the method reads it; `None` where it was not baked before or the method cannot read it.
    #[must_use]
    pub fn baked(&self, method: &dyn Method) -> Option<Pyramid> {
        match self {
            Self::Surface(_) => None,
            Self::Baked(map) => map.read_by(method),
        }
    }
}

impl Deref for MaterialMap {
    type Target = dyn Surface;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Surface(surface) => &**surface,
            Self::Baked(map) => &**map,
        }
    }
}

impl From<Arc<dyn Surface>> for MaterialMap {
    fn from(surface: Arc<dyn Surface>) -> Self {
        Self::Surface(surface)
    }
}

impl From<BakedSurface> for MaterialMap {
    fn from(map: BakedSurface) -> Self {
        Self::Baked(Arc::new(map))
    }
}

/// Material of objects: map, surface parameters and BRDF.
pub struct Material {
    /// Name of the material.
    pub name: String,
    /// Map of its normals and heights.
    pub map: MaterialMap,
    /// Surface parameters that are the same everywhere; `textures`, if any, are in their place.
    pub params: SurfaceParams,
    /// Colours and roughness of each texel, of the surface's size.
    pub textures: Option<SurfaceTextures>,
    /// Displacement of its meshes; `None` for a map of normals alone.
    pub displacement: Option<Displacement>,
    /// Lobe and shading model.
    pub brdf: Brdf,
}
