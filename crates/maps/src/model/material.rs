//! Metallic-roughness materials of files, as what a surface is shaded with.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use ndfmap_core::brdf::SurfaceParams;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::surface::{NormalGrid, Surface, SurfaceRow};
use ndfmap_core::units::{Alpha, PerceptualRoughness, SlopeVariance};
use ndfmap_scene::{Material, SurfaceTextures};

use super::laying::Arranged;
use super::microfacets;
use super::relay::Laid;
use crate::attribute::{Transfer, attribute_of_image};
use crate::{Image, MapError};

/// Least roughness, below which surfaces count as mirrors: narrower highlights fall between the rays of any
/// truth.
const LEAST_ROUGHNESS: f64 = 0.05;

/// Constant factors of a metallic-roughness material.
#[derive(Clone, Copy)]
pub(super) struct Factors {
    /// Base colour, linear.
    pub(super) base: [f32; 3],
    /// Metalness, 0 to 1.
    pub(super) metallic: f32,
    /// Perceptual roughness, 0 to 1.
    pub(super) roughness: f32,
}

/// Metallic-roughness material of a file: factors and textures.
pub(super) struct MetalRough {
    pub(super) name: String,
    pub(super) factors: Factors,
    pub(super) textures: Arranged,
}

impl MetalRough {
    /// The material that it is shaded as; colours are averaged over the texels of the normal map.
    pub(super) fn into_material(self, warnings: &mut Vec<String>) -> Material {
        if !self.textures.faithful {
            warnings.push(format!(
                "textures of `{}` lie in ways that do not go on together (other coordinates or edges, or \
                 scales in no ratio of small whole numbers): all are laid on as its normal map, or without one as \
                 its colours",
                self.name
            ));
        }
        let surface = self.surface(warnings);
        let Self { name, factors, textures: Arranged { base, metal_rough, .. } } = self;
        if base.is_none() && metal_rough.is_none() {
            let (params, roughness) = factors.params([1.0; 4], [1.0; 4]);
            let params = SurfaceParams { roughness: SlopeVariance::ZERO, ..params };
            return Material {
                name,
                map: surface.into(),
                params,
                textures: None,
                displacement: None,
                brdf: microfacets(roughness * roughness),
            };
        }
        let size = surface.size();
        let sample =
            |map: &Option<Laid>, x: usize, y: usize| map.as_ref().map_or([1.0; 4], |map| map.at(size, x, y));
        let at = |x: usize, y: usize| factors.params(sample(&base, x, y), sample(&metal_rough, x, y)).0;
        let rgb = |c: DVec3, w: f64| [c.x as f32, c.y as f32, c.z as f32, w as f32];
        let diffuse_roughness = Grid::from_fn(size, |x, y| {
            let params = at(x, y);
            rgb(params.diffuse, params.roughness.get())
        });
        let specular = Grid::from_fn(size, |x, y| rgb(at(x, y).specular, 1.0));
        let params = mean_params(&diffuse_roughness, &specular);
        let textures = Some(SurfaceTextures {
            diffuse_roughness: diffuse_roughness.into(),
            specular: Some(specular.into()),
        });
        // The lobe itself is as sharp as can be; all its width is in the map.
        Material { name, map: surface.into(), params, textures, displacement: None, brdf: microfacets(0.0) }
    }

    /// Normals at a size that holds the colours: a placeholder, however small, is as flat at theirs.
    fn surface(&self, warnings: &mut Vec<String>) -> Arc<dyn Surface> {
        let Arranged { normals, base, metal_rough, laying, .. } = &self.textures;
        let colours = base.as_ref().or(metal_rough.as_ref()).map(Laid::size);
        let constant = |normal: Vec3, size: Size| -> Arc<dyn Surface> {
            Arc::new(NormalGrid { normals: Grid::from_fn(size, |_, _| normal), wraps: laying.wraps })
        };
        let Some(normals) = normals else {
            return constant(Vec3::Z, colours.unwrap_or(Size { width: 1, height: 1 }));
        };
        let Some(size) = colours.filter(|size| size.area() > normals.size().area()) else {
            return normals.clone();
        };
        if let Some(normal) = only_normal(&**normals) {
            return constant(normal, size);
        }
        warnings.push(format!("colours of `{}` are averaged over its smaller normal map", self.name));
        normals.clone()
    }
}

impl Factors {
    /// Surface parameters under texture values, and the roughness (glTF 2.0, appendix B).
    fn params(&self, base: [f32; 4], metal_rough: [f32; 4]) -> (SurfaceParams, f64) {
        // Factors of files may be no numbers; then textures stand alone.
        let product = |factor: f32, texture: f32| match f64::from(factor) * f64::from(texture) {
            v if v.is_finite() => v,
            _ => f64::from(texture),
        };
        let base = DVec3::from([0, 1, 2].map(|i| product(self.base[i], base[i])));
        let metal = product(self.metallic, metal_rough[2]).clamp(0.0, 1.0);
        let roughness = product(self.roughness, metal_rough[1]).clamp(LEAST_ROUGHNESS, 1.0);
        let alpha = PerceptualRoughness::new(roughness).map(Alpha::from);
        let variance = alpha.map_or(SlopeVariance::ZERO, SlopeVariance::from);
        let params = SurfaceParams {
            diffuse: base * (1.0 - metal),
            specular: DVec3::splat(0.04).lerp(base, metal),
            roughness: variance,
        };
        (params, roughness)
    }
}

/// Means over a map, for materials whose map is taken away.
fn mean_params(diffuse_roughness: &Grid<[f32; 4]>, specular: &Grid<[f32; 4]>) -> SurfaceParams {
    let mean = |map: &Grid<[f32; 4]>, c: usize| {
        map.texels().iter().map(|t| f64::from(t[c])).sum::<f64>() / map.texels().len() as f64
    };
    SurfaceParams {
        diffuse: DVec3::from([0, 1, 2].map(|c| mean(diffuse_roughness, c))),
        specular: DVec3::from([0, 1, 2].map(|c| mean(specular, c))),
        roughness: SlopeVariance::clamped(mean(diffuse_roughness, 3)),
    }
}

/// The normal of a surface that has no other.
pub(super) fn only_normal(surface: &dyn Surface) -> Option<Vec3> {
    let size = surface.size();
    let mut row = SurfaceRow::flat(size.width);
    surface.read_row(0, &mut row);
    let normal = row.normal(0);
    let same = (0..size.height).all(|y| {
        surface.read_row(y, &mut row);
        (0..size.width).all(|x| row.normal(x) == normal)
    });
    same.then_some(normal)
}

/// Values of a picture, decoded. A grey one is that grey in every colour (glTF 2.0, 3.8.2: as images are
/// decoded to RGB).
///
/// # Errors
/// [`MapError`] when it holds values that are not finite.
pub(crate) fn colours(path: &Path, image: &Image, transfer: Transfer) -> Result<Grid<[f32; 4]>, MapError> {
    let values = attribute_of_image(path, image, transfer)?.values;
    if image.channels == 1 {
        let grey = |x: usize, y: usize| values.row(y)[x][0];
        return Ok(Grid::from_fn(values.size(), |x, y| [grey(x, y), grey(x, y), grey(x, y), 1.0]));
    }
    Ok(values)
}
