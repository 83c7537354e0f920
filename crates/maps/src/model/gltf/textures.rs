//! Textures of glTF materials: their pictures, and how they lie on the mesh.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine2, DMat2, DVec2, Vec3};
use gltf::texture::WrappingMode;
use ndfmap_core::grid::Size;
use ndfmap_core::surface::{Surface, SurfaceRow, Wrap, Wraps, unit_or_up};
use ndfmap_scene::Material;

use super::super::laying::{Laying, NormalTexture, Texture, Textures, ValueTexture};
use super::super::material::{Factors, MetalRough, colours};
use super::super::mirror::Mirrors;
use super::document::{Opened, resource};
use crate::attribute::Transfer;
use crate::formats::read_image;
use crate::source::{Convention, SourceOptions, source_of_image};
use crate::{Image, MapError, SourceKind};

/// A normal map with its x and y scaled, as `normalTexture.scale` asks.
pub(crate) struct Scaled {
    inner: Arc<dyn Surface>,
    scale: f32,
}

impl Scaled {
    /// A normal map with x and y times a scale.
    pub(crate) fn of(inner: Arc<dyn Surface>, scale: f32) -> Arc<dyn Surface> {
        if scale == 1.0 { inner } else { Arc::new(Self { inner, scale }) }
    }
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

    /// A texture's values, decoded, with their images where they are mirrored, and its laying.
    fn values(
        &self,
        info: Option<&gltf::texture::Info<'_>>,
        transfer: Transfer,
    ) -> Result<Option<ValueTexture>, MapError> {
        let Some(info) = info else { return Ok(None) };
        let (file, image) = self.image(&info.texture())?;
        let content = mirrors(&info.texture()).values(colours(&file, &image, transfer)?);
        Ok(Some(Texture { content, laying: laying_of_info(info) }))
    }

    /// Normals of a material's normal texture, and its laying.
    fn normals(
        &self,
        material: &gltf::Material<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Option<NormalTexture>, MapError> {
        let Some(normal) = material.normal_texture() else { return Ok(None) };
        let (file, image) = self.image(&normal.texture())?;
        let laying = laying_of_normal(&normal);
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
        let surface = mirrors(&normal.texture()).surface(map.surface);
        Ok(Some(Texture { content: Scaled::of(surface, normal.scale()), laying }))
    }

    /// A material whose base colour is multiplied by `tint`, linear, and the laying of its map.
    ///
    /// # Errors
    /// [`MapError`] for textures that cannot be read.
    pub(super) fn material(
        &self,
        material: &gltf::Material<'_>,
        tint: Vec3,
        warnings: &mut Vec<String>,
    ) -> Result<(Material, Laying), MapError> {
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        let textures = Textures {
            normals: self.normals(material, warnings)?,
            base: self.values(pbr.base_color_texture().as_ref(), Transfer::Srgb)?,
            metal_rough: self.values(pbr.metallic_roughness_texture().as_ref(), Transfer::Linear)?,
        };
        let textures = textures.arranged();
        let laying = textures.laying;
        let made = MetalRough {
            name: material.name().unwrap_or("unnamed").to_owned(),
            factors: Factors {
                base: (Vec3::new(r, g, b) * tint).to_array(),
                metallic: pbr.metallic_factor(),
                roughness: pbr.roughness_factor(),
            },
            textures,
        };
        Ok((made.into_material(warnings), laying))
    }
}

/// Transform of `KHR_texture_transform`: coordinates are scaled, turned counter-clockwise as seen with v down
/// (by radians), and moved.
fn transform(offset: [f32; 2], rotation: f32, scale: [f32; 2]) -> DAffine2 {
    let [offset, scale] = [offset, scale].map(|[x, y]| DVec2::new(x.into(), y.into()));
    let (sin, cos) = f64::from(rotation).sin_cos();
    let turn = DMat2::from_cols(DVec2::new(cos, -sin), DVec2::new(sin, cos));
    DAffine2::from_mat2_translation(turn * DMat2::from_diagonal(scale), offset)
}

fn mirrors(texture: &gltf::Texture<'_>) -> Mirrors {
    let mirrored = |mode| mode == WrappingMode::MirroredRepeat;
    let sampler = texture.sampler();
    Mirrors { x: mirrored(sampler.wrap_s()), y: mirrored(sampler.wrap_t()) }
}

/// Laying of a texture, its images included where it is mirrored.
fn laying(set: u32, transform: DAffine2, texture: &gltf::Texture<'_>) -> Laying {
    let wrap = |mode| if mode == WrappingMode::ClampToEdge { Wrap::Clamp } else { Wrap::Repeat };
    let (sampler, doubled) = (texture.sampler(), DAffine2::from_scale(mirrors(texture).scale()));
    let wraps = Wraps { x: wrap(sampler.wrap_s()), y: wrap(sampler.wrap_t()) };
    Laying { set, transform: doubled * transform, wraps }
}

fn laying_of_info(info: &gltf::texture::Info<'_>) -> Laying {
    let own = info.texture_transform();
    let set = own.as_ref().and_then(|own| own.tex_coord()).unwrap_or(info.tex_coord());
    let transform =
        own.map_or(DAffine2::IDENTITY, |own| transform(own.offset(), own.rotation(), own.scale()));
    laying(set, transform, &info.texture())
}

/// Laying of a normal texture, whose extension the crate keeps as plain JSON.
fn laying_of_normal(normal: &gltf::material::NormalTexture<'_>) -> Laying {
    let Some(value) = normal.extension_value("KHR_texture_transform") else {
        return laying(normal.tex_coord(), DAffine2::IDENTITY, &normal.texture());
    };
    let number = |value: Option<&serde_json::Value>, or: f32| {
        value.and_then(serde_json::Value::as_f64).map_or(or, |v| v as f32)
    };
    let pair = |key: &str, or: f32| [0, 1].map(|i: usize| number(value.get(key).and_then(|v| v.get(i)), or));
    let own = value.get("texCoord").and_then(serde_json::Value::as_u64);
    let set = own.and_then(|own| u32::try_from(own).ok()).unwrap_or(normal.tex_coord());
    let transform = transform(pair("offset", 0.0), number(value.get("rotation"), 0.0), pair("scale", 1.0));
    laying(set, transform, &normal.texture())
}
