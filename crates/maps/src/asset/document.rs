//! The part of a glTF document that an edit of textures has to understand.

use serde::Deserialize;
use serde_json::{Map, Value};

/// Document, less what is left as it is.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) asset: AssetInfo,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) images: Vec<ImageRef>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
    pub(super) animations: Vec<Animation>,
    pub(super) extensions_used: Vec<String>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct AssetInfo {
    pub(super) version: String,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Material {
    pub(super) name: Option<String>,
    pub(super) pbr_metallic_roughness: MetallicRoughness,
    pub(super) normal_texture: Option<TextureInfo>,
    pub(super) occlusion_texture: Option<TextureInfo>,
    pub(super) extensions: Map<String, Value>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct MetallicRoughness {
    pub(super) base_color_factor: [f32; 4],
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for MetallicRoughness {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

/// `KHR_materials_clearcoat`: a layer with a roughness and, perhaps, normals of its own.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Clearcoat {
    pub(super) clearcoat_factor: f32,
    pub(super) clearcoat_roughness_factor: f32,
    pub(super) clearcoat_roughness_texture: Option<TextureInfo>,
    pub(super) clearcoat_normal_texture: Option<TextureInfo>,
}

/// Use of a texture by a material.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: u32,
    /// Scale of x and y of normals.
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    pub(super) extensions: Map<String, Value>,
}

fn one() -> f32 {
    1.0
}

/// Coordinates of a texture: their set, and what `KHR_texture_transform` does to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Coordinates {
    set: u32,
    transform: Transform,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Transform {
    offset: [f32; 2],
    rotation: f32,
    scale: [f32; 2],
    tex_coord: Option<u32>,
}

impl Default for Transform {
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2], tex_coord: None }
    }
}

/// Name of the extension that moves, turns and scales coordinates.
pub(super) const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";

impl TextureInfo {
    /// Coordinates that the texture is laid on by.
    pub(super) fn coordinates(&self) -> Result<Coordinates, serde_json::Error> {
        let transform: Transform = match self.extensions.get(TEXTURE_TRANSFORM) {
            Some(value) => serde_json::from_value(value.clone())?,
            None => Transform::default(),
        };
        let set = transform.tex_coord.unwrap_or(self.tex_coord);
        Ok(Coordinates { set, transform: Transform { tex_coord: None, ..transform } })
    }
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Texture {
    pub(super) sampler: Option<usize>,
    pub(super) source: Option<usize>,
    pub(super) extensions: Map<String, Value>,
}

/// Place of a picture: a file or data, or a part of a buffer.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct ImageRef {
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Sampler {
    pub(super) min_filter: Option<u32>,
    pub(super) wrap_s: u32,
    pub(super) wrap_t: u32,
}

/// Names that OpenGL has for wraps and for filters without mips.
pub(super) const REPEAT: u32 = 10_497;
const NEAREST: u32 = 9_728;
const LINEAR: u32 = 9_729;

impl Default for Sampler {
    fn default() -> Self {
        Self { min_filter: None, wrap_s: REPEAT, wrap_t: REPEAT }
    }
}

impl Sampler {
    /// True where an engine reads the mips of the texture.
    pub(super) fn has_mips(&self) -> bool {
        !matches!(self.min_filter, Some(NEAREST | LINEAR))
    }

    /// True for the edges of another.
    pub(super) fn wraps_as(&self, other: &Self) -> bool {
        (self.wrap_s, self.wrap_t) == (other.wrap_s, other.wrap_t)
    }
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub(super) channels: Vec<Channel>,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Channel {
    pub(super) target: Target,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Target {
    pub(super) extensions: Map<String, Value>,
}

impl Target {
    /// Place in the document that is animated, by `KHR_animation_pointer`.
    pub(super) fn pointer(&self) -> Option<&str> {
        self.extensions.get("KHR_animation_pointer")?.get("pointer")?.as_str()
    }
}
