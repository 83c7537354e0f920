//! Textures of glTF materials: their pictures, and how they lie on the mesh.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use gltf::texture::WrappingMode;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::surface::{Surface, SurfaceRow, Wrap, Wraps, unit_or_up};
use ndfmap_scene::Material;

use super::super::material::{Factors, MetalRough, colours};
use super::super::mirror::Mirrors;
use super::document::{Opened, resource};
use crate::attribute::Transfer;
use crate::formats::read_image;
use crate::source::{Convention, SourceOptions, source_of_image};
use crate::{Image, MapError, SourceKind};

/// A normal map with its x and y scaled, as `normalTexture.scale` asks.
struct Scaled {
    inner: Arc<dyn Surface>,
    scale: f32,
}

impl Surface for Scaled {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn wraps(&self) -> Wraps {
        self.inner.wraps()
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        self.inner.read_row(y, row);
        for i in 0..row.width() {
            let n = row.normal(i);
            row.set_normal(i, unit_or_up(Vec3::new(n.x * self.scale, n.y * self.scale, n.z)));
        }
    }
}

impl Opened<'_> {
    /// The picture of a texture, and a path to name it by.
    fn image(&self, texture: &gltf::Texture<'_>) -> Result<(PathBuf, Image), MapError> {
        let (file, bytes) = match texture.source().source() {
            gltf::image::Source::Uri { uri, .. } => {
                let resource = resource(self.path, uri)?;
                (resource.path, resource.bytes)
            }
            gltf::image::Source::View { view, .. } => {
                let buffer = &self.buffers[view.buffer().index()];
                let bytes =
                    view.offset().checked_add(view.length()).and_then(|end| buffer.get(view.offset()..end));
                let bytes =
                    bytes.ok_or_else(|| MapError::invalid(self.path, "has a picture outside its buffer"))?;
                (self.path.to_owned(), bytes.to_vec())
            }
        };
        // A picture inside the file has no name; its first bytes tell its format.
        let image = read_image(&file, &bytes)?;
        Ok((file, image))
    }

    /// A texture's values, decoded, with their images where they are mirrored.
    fn values(
        &self,
        info: Option<&gltf::texture::Info<'_>>,
        transfer: Transfer,
    ) -> Result<Option<Grid<[f32; 4]>>, MapError> {
        let Some(info) = info else { return Ok(None) };
        let (file, image) = self.image(&info.texture())?;
        let values = colours(&file, &image, transfer)?;
        Ok(Some(Laying::of_info(info).mirrors.values(values)))
    }

    /// Normals of a material's normal texture.
    fn normals(
        &self,
        material: &gltf::Material<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Arc<dyn Surface>>, MapError> {
        let Some(normal) = material.normal_texture() else { return Ok(None) };
        let (file, image) = self.image(&normal.texture())?;
        let laying = Laying::of_normal(&normal);
        let options = SourceOptions {
            kind: Some(SourceKind::Normal),
            // Green is up in glTF (2.0, 3.9.3).
            convention: Some(Convention::OpenGl),
            wraps: laying.wraps,
            ..SourceOptions::default()
        };
        let map = source_of_image(&file, image, String::new(), &options)?;
        let name = material.name().unwrap_or("unnamed");
        warnings.extend(map.warnings.iter().map(|w| format!("normal map of `{name}` {w}")));
        let surface = laying.mirrors.surface(map.surface);
        Ok(Some(match normal.scale() {
            1.0 => surface,
            scale => Arc::new(Scaled { inner: surface, scale }),
        }))
    }

    /// A material whose base colour is multiplied by `tint`, linear.
    ///
    /// # Errors
    /// [`MapError`] for textures that cannot be read.
    pub(super) fn material(
        &self,
        material: &gltf::Material<'_>,
        tint: Vec3,
        warnings: &mut Vec<String>,
    ) -> Result<Material, MapError> {
        let name = material.name().unwrap_or("unnamed").to_owned();
        let pbr = material.pbr_metallic_roughness();
        let infos = [pbr.base_color_texture(), pbr.metallic_roughness_texture()];
        let laying = Laying::of(material);
        if infos.iter().flatten().any(|info| Laying::of_info(info) != laying) {
            warnings.push(format!(
                "textures of `{name}` do not lie alike (coordinates, transform or edges): all are laid on as its \
                 normal map, or without one as its colours"
            ));
        }
        let [r, g, b, _] = pbr.base_color_factor();
        let made = MetalRough {
            name,
            factors: Factors {
                base: (Vec3::new(r, g, b) * tint).to_array(),
                metallic: pbr.metallic_factor(),
                roughness: pbr.roughness_factor(),
            },
            normals: self.normals(material, warnings)?,
            base: self.values(infos[0].as_ref(), Transfer::Srgb)?,
            metal_rough: self.values(infos[1].as_ref(), Transfer::Linear)?,
            wraps: laying.wraps,
        };
        Ok(made.into_material(warnings))
    }
}

/// Transform of a texture's coordinates, `KHR_texture_transform`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TextureTransform {
    offset: Vec2,
    /// Radians, counter-clockwise as seen with v down.
    rotation: f32,
    scale: Vec2,
}

impl TextureTransform {
    const IDENTITY: Self = Self { offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE };

    /// Coordinates scaled, then rotated, then moved.
    fn apply(&self, uv: Vec2) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let uv = uv * self.scale;
        Vec2::new(cos * uv.x + sin * uv.y, cos * uv.y - sin * uv.x) + self.offset
    }
}

/// Laying of a texture on a mesh: its set of coordinates, their transform, and its continuation beyond the
/// edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Laying {
    pub(super) set: u32,
    transform: TextureTransform,
    wraps: Wraps,
    mirrors: Mirrors,
}

impl Laying {
    /// Laying of a material's map: of its normals, else of its colours, else of its roughness.
    pub(super) fn of(material: &gltf::Material<'_>) -> Self {
        let pbr = material.pbr_metallic_roughness();
        let others = || pbr.base_color_texture().or_else(|| pbr.metallic_roughness_texture());
        let plain = Self {
            set: 0,
            transform: TextureTransform::IDENTITY,
            wraps: Wraps::default(),
            mirrors: Mirrors::default(),
        };
        let normal = material.normal_texture().map(|normal| Self::of_normal(&normal));
        normal.or_else(|| others().map(|info| Self::of_info(&info))).unwrap_or(plain)
    }

    /// Coordinates of the mesh as coordinates of the map, its images included where it is mirrored.
    pub(super) fn apply(&self, uv: Vec2) -> Vec2 {
        self.transform.apply(uv) * self.mirrors.scale()
    }

    fn new(set: u32, transform: TextureTransform, sampler: &gltf::texture::Sampler<'_>) -> Self {
        let (x, y) = (sampler.wrap_s(), sampler.wrap_t());
        let wrap = |mode| if mode == WrappingMode::ClampToEdge { Wrap::Clamp } else { Wrap::Repeat };
        let mirrored = |mode| mode == WrappingMode::MirroredRepeat;
        Self {
            set,
            transform,
            wraps: Wraps { x: wrap(x), y: wrap(y) },
            mirrors: Mirrors { x: mirrored(x), y: mirrored(y) },
        }
    }

    fn of_info(info: &gltf::texture::Info<'_>) -> Self {
        let own = info.texture_transform();
        let set = own.as_ref().and_then(|own| own.tex_coord()).unwrap_or(info.tex_coord());
        let transform = own.map_or(TextureTransform::IDENTITY, |own| TextureTransform {
            offset: own.offset().into(),
            rotation: own.rotation(),
            scale: own.scale().into(),
        });
        Self::new(set, transform, &info.texture().sampler())
    }

    /// Laying of a normal texture, whose extension the crate keeps as plain JSON.
    fn of_normal(normal: &gltf::material::NormalTexture<'_>) -> Self {
        let sampler = normal.texture().sampler();
        let Some(value) = normal.extension_value("KHR_texture_transform") else {
            return Self::new(normal.tex_coord(), TextureTransform::IDENTITY, &sampler);
        };
        let number = |value: Option<&serde_json::Value>, or: f32| {
            value.and_then(serde_json::Value::as_f64).map_or(or, |v| v as f32)
        };
        let pair = |key: &str, or: f32| {
            let part = |i: usize| number(value.get(key).and_then(|v| v.get(i)), or);
            Vec2::new(part(0), part(1))
        };
        let own = value.get("texCoord").and_then(serde_json::Value::as_u64);
        let set = own.and_then(|own| u32::try_from(own).ok()).unwrap_or(normal.tex_coord());
        let (offset, rotation, scale) =
            (pair("offset", 0.0), number(value.get("rotation"), 0.0), pair("scale", 1.0));
        Self::new(set, TextureTransform { offset, rotation, scale }, &sampler)
    }
}
