//! Layings of a material's textures on its meshes, and the one among them that the meshes are drawn with.

use std::sync::Arc;

use glam::{DAffine2, DVec2, Vec2};
use ndfmap_core::grid::Grid;
use ndfmap_core::surface::{Surface, Wrap, Wraps};

use super::material::only_normal;
use super::relay::{Laid, Placing, Repeated, is_near};

/// Most repetitions of a texture along a side of the map in which it lies: scales of 2.5 and 1 go into one
/// map as 5 and 2.
const MOST_TOGETHER: u32 = 8;

/// Laying of a texture on a mesh: its set of coordinates, their transform, and its continuation beyond the
/// edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Laying {
    /// Set of the mesh's coordinates.
    pub(super) set: u32,
    /// Transform from coordinates of the mesh to those of the texture, v down in both.
    pub(super) transform: DAffine2,
    /// Continuation beyond the edges.
    pub(super) wraps: Wraps,
}

impl Laying {
    /// Laying of a texture on the first coordinates, as they are.
    pub(super) const PLAIN: Self =
        Self { set: 0, transform: DAffine2::IDENTITY, wraps: Wraps { x: Wrap::Repeat, y: Wrap::Repeat } };

    /// Coordinates of the mesh as coordinates of the texture.
    pub(super) fn apply(&self, uv: Vec2) -> Vec2 {
        self.transform.transform_point2(DVec2::from(uv)).as_vec2()
    }

    /// Laying of this many repetitions along each side, seen as one texture.
    fn together(self, times: u32) -> Self {
        let scale = DVec2::splat(1.0 / f64::from(times));
        Self { transform: DAffine2::from_scale(scale) * self.transform, ..self }
    }

    /// Placing of the texture as seen from a map; `None` where the two do not go on together.
    fn placing(&self, map: &Self) -> Option<Placing> {
        if self.set != map.set {
            return None;
        }
        if is_near(self.transform, map.transform) {
            return (self.wraps == map.wraps).then_some(Placing::ALIKE);
        }
        let repeat = |laying: &Self| laying.wraps == Self::PLAIN.wraps;
        let placing = Placing::between(map.transform, self.transform);
        placing.filter(|_| repeat(self) && repeat(map))
    }
}

/// Content of a texture, decoded, and its laying.
pub(super) struct Texture<T> {
    pub(super) content: T,
    pub(super) laying: Laying,
}

/// Texture of values: colours, linear, or numbers in their channels.
pub(super) type ValueTexture = Texture<Grid<[f32; 4]>>;

/// Texture of normals.
pub(super) type NormalTexture = Texture<Arc<dyn Surface>>;

/// Textures of a material.
#[derive(Default)]
pub(super) struct Textures {
    /// Normals of a normal map.
    pub(super) normals: Option<NormalTexture>,
    /// Base colour, linear.
    pub(super) base: Option<ValueTexture>,
    /// Roughness in the second channel, metalness in the third.
    pub(super) metal_rough: Option<ValueTexture>,
}

/// Textures of a material, laid as one of them is.
pub(super) struct Arranged {
    /// Normals as the map that the meshes are drawn with.
    pub(super) normals: Option<Arc<dyn Surface>>,
    pub(super) base: Option<Laid>,
    pub(super) metal_rough: Option<Laid>,
    /// Laying of the map.
    pub(super) laying: Laying,
    /// Each texture lies where the file lays it; else all lie as the first.
    pub(super) faithful: bool,
}

impl Textures {
    /// The textures as the first of them lies by which all others can be laid: the normal map, the colours,
    /// the roughness, or the plain coordinates; else as several of its repetitions lie together.
    pub(super) fn arranged(self) -> Arranged {
        let layings = self.layings();
        let found = (1..=MOST_TOGETHER).find_map(|times| {
            let mut maps = layings.iter().chain([&Laying::PLAIN]).map(|laying| laying.together(times));
            maps.find_map(|map| self.placings(&map))
        });
        let first = layings.first().copied().unwrap_or(Laying::PLAIN);
        let faithful = found.is_some();
        let Placings { map, normals, base, metal_rough } = found.unwrap_or(Placings::alike(first));
        let laid = |texture: Option<ValueTexture>, placing: Placing| {
            texture.map(|texture| Laid { values: texture.content, placing })
        };
        Arranged {
            normals: self.normals.map(|map| Repeated::surface(&map.content, normals).unwrap_or(map.content)),
            base: laid(self.base, base),
            metal_rough: laid(self.metal_rough, metal_rough),
            laying: map,
            faithful,
        }
    }

    /// Layings that matter: one texel, or one normal, lies everywhere.
    fn layings(&self) -> Vec<Laying> {
        let varied = |texture: &Option<ValueTexture>| {
            texture.as_ref().filter(|map| map.content.texels().len() > 1).map(|map| map.laying)
        };
        let normals = self.normals.as_ref().filter(|map| only_normal(&*map.content).is_none());
        let normals = normals.map(|map| map.laying);
        [normals, varied(&self.base), varied(&self.metal_rough)].into_iter().flatten().collect()
    }

    /// Placings of all textures as seen from a map; `None` where one cannot be laid so.
    fn placings(&self, map: &Laying) -> Option<Placings> {
        let mut out = Placings::alike(*map);
        if let Some(normals) = self.normals.as_ref()
            && only_normal(&*normals.content).is_none()
        {
            out.normals = normals.laying.placing(map)?;
            Repeated::surface(&normals.content, out.normals)?;
        }
        for (texture, placing) in [(&self.base, &mut out.base), (&self.metal_rough, &mut out.metal_rough)] {
            if let Some(texture) = texture
                && texture.content.texels().len() > 1
            {
                *placing = texture.laying.placing(map)?;
            }
        }
        Some(out)
    }
}

/// Placings of a material's textures as seen from its map.
#[derive(Clone, Copy)]
struct Placings {
    map: Laying,
    normals: Placing,
    base: Placing,
    metal_rough: Placing,
}

impl Placings {
    fn alike(map: Laying) -> Self {
        Self { map, normals: Placing::ALIKE, base: Placing::ALIKE, metal_rough: Placing::ALIKE }
    }
}
