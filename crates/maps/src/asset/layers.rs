//! Layers of materials: where a normal map and a roughness belong together, and what forbids a change.

use std::fmt;

use ndfmap_core::grid::Size;
use serde::Serialize;

use super::Asset;
use super::document::{Clearcoat, Material, Sampler, TextureInfo};

/// Layer of a material that has a roughness, and normals of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Layer {
    /// The material itself.
    Base,
    /// Its clearcoat (`KHR_materials_clearcoat`).
    Clearcoat,
}

/// Name of the clearcoat's extension.
const CLEARCOAT: &str = "KHR_materials_clearcoat";

impl Layer {
    /// Keys of the object that holds the roughness.
    pub(super) fn holder(self) -> &'static [&'static str] {
        match self {
            Self::Base => &["pbrMetallicRoughness"],
            Self::Clearcoat => &["extensions", CLEARCOAT],
        }
    }

    /// Key of the roughness texture in it.
    pub(super) fn texture_key(self) -> &'static str {
        match self {
            Self::Base => "metallicRoughnessTexture",
            Self::Clearcoat => "clearcoatRoughnessTexture",
        }
    }

    /// Key of the roughness factor in it.
    pub(super) fn factor_key(self) -> &'static str {
        match self {
            Self::Base => "roughnessFactor",
            Self::Clearcoat => "clearcoatRoughnessFactor",
        }
    }

    /// Keys of the normal texture.
    pub(super) fn normal_keys(self) -> &'static [&'static str] {
        match self {
            Self::Base => &["normalTexture"],
            Self::Clearcoat => &["extensions", CLEARCOAT, "clearcoatNormalTexture"],
        }
    }
}

impl fmt::Display for Layer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Base => "base",
            Self::Clearcoat => "clearcoat",
        })
    }
}

/// Normal map and roughness of a layer, laid on alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Layer that they belong to.
    pub layer: Layer,
    /// Index of the normal texture.
    pub normal: usize,
    /// Scale of x and y of its normals.
    pub scale: f32,
    /// Index of the roughness texture, whose green channel is roughness; none where the factor is all.
    pub roughness: Option<usize>,
    /// Factor of roughness, 0 to 1.
    pub factor: f32,
    /// True where the occlusion of the material is the red channel of the same texture.
    pub holds_occlusion: bool,
}

/// Layer of a material, and its pair or the reason why it is left alone.
#[derive(Clone, Debug)]
pub struct MaterialLayer {
    /// Index of the material.
    pub material: usize,
    /// Name of the material, or its index where it has none.
    pub name: String,
    /// Layer of it.
    pub layer: Layer,
    /// Maps to be changed.
    pub pair: Result<Pair, Reason>,
}

/// Reason why a layer is left alone.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// It has no normal map.
    NoNormalMap,
    /// It is not lit.
    Unlit,
    /// Its clearcoat has no weight.
    NoCoat,
    /// Its gloss is in another workflow's texture.
    SpecularGlossiness,
    /// Its highlights have a direction.
    Anisotropic,
    /// This program wrote its roughness texture.
    AlreadyFixed,
    /// Its two textures lie in different places.
    LaidApart,
    /// Its two textures go on differently beyond their edges.
    WrappedApart,
    /// The sampler of a texture reads no mips.
    NoMips,
    /// A number that the textures depend on is animated.
    Animated(String),
    /// A factor is outside its range.
    OutOfRange(&'static str),
    /// A texture has no picture of a known format.
    NoPicture(usize),
    /// Its maps do not fill blocks of 4 × 4 texels, which `KHR_texture_basisu` asks for.
    OddSize(Size),
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoNormalMap => "it has no normal map",
            Self::Unlit => "it is not lit",
            Self::NoCoat => "its clearcoat has no weight",
            Self::SpecularGlossiness => "its gloss is that of KHR_materials_pbrSpecularGlossiness",
            Self::Anisotropic => "it is anisotropic, which one roughness cannot say",
            Self::AlreadyFixed => "its roughness texture is of ndfmap's making",
            Self::LaidApart => "its normal map and its roughness have different coordinates",
            Self::WrappedApart => "its normal map and its roughness have different wraps",
            Self::NoMips => "its sampler reads no mips",
            Self::Animated(pointer) => return write!(f, "`{pointer}` is animated"),
            Self::OutOfRange(name) => return write!(f, "its {name} is out of range"),
            Self::OddSize(Size { width, height }) => {
                return write!(f, "its maps of {width} × {height} do not fill blocks of 4 × 4 texels");
            }
            Self::NoPicture(texture) => return write!(f, "texture {texture} has no picture that is read"),
        })
    }
}

impl Asset {
    /// Every layer of every material; a clearcoat counts where it has a normal map of its own.
    #[must_use]
    pub fn layers(&self) -> Vec<MaterialLayer> {
        let mut layers = Vec::new();
        for (i, material) in self.document.materials.iter().enumerate() {
            let name = material.name.clone().unwrap_or_else(|| i.to_string());
            let mut push = |layer, pair| {
                layers.push(MaterialLayer { material: i, name: name.clone(), layer, pair });
            };
            push(Layer::Base, self.base(i, material));
            if let Some(coat) = coat(material) {
                push(Layer::Clearcoat, self.coat(i, material, &coat));
            }
        }
        layers
    }

    fn base(&self, index: usize, material: &Material) -> Result<Pair, Reason> {
        let pbr = &material.pbr_metallic_roughness;
        let extended = |name: &str| material.extensions.contains_key(name);
        if extended("KHR_materials_unlit") {
            return Err(Reason::Unlit);
        }
        if extended("KHR_materials_pbrSpecularGlossiness") {
            return Err(Reason::SpecularGlossiness);
        }
        let roughness = pbr.metallic_roughness_texture.as_ref();
        let pair = self.pair(index, Layer::Base, [material.normal_texture.as_ref(), roughness])?;
        if extended("KHR_materials_anisotropy") {
            return Err(Reason::Anisotropic);
        }
        let shares = |occlusion: &TextureInfo| {
            let same =
                |r: &TextureInfo| r.index == occlusion.index && coordinates(r) == coordinates(occlusion);
            roughness.is_some_and(same)
        };
        let holds_occlusion = material.occlusion_texture.as_ref().is_some_and(shares);
        ranged(Pair { factor: pbr.roughness_factor, holds_occlusion, ..pair })
    }

    fn coat(&self, index: usize, material: &Material, coat: &Clearcoat) -> Result<Pair, Reason> {
        if material.extensions.contains_key("KHR_materials_unlit") {
            return Err(Reason::Unlit);
        }
        if coat.clearcoat_factor == 0.0 {
            return Err(Reason::NoCoat);
        }
        let textures = [coat.clearcoat_normal_texture.as_ref(), coat.clearcoat_roughness_texture.as_ref()];
        let pair = self.pair(index, Layer::Clearcoat, textures)?;
        ranged(Pair { factor: coat.clearcoat_roughness_factor, ..pair })
    }

    /// Pair of a normal and a roughness texture; its factor is still to be filled in.
    fn pair(&self, index: usize, layer: Layer, textures: [Option<&TextureInfo>; 2]) -> Result<Pair, Reason> {
        let [Some(normal), roughness] = textures else { return Err(Reason::NoNormalMap) };
        let sampler = |info: &TextureInfo| self.sampler(info.index);
        let used = || std::iter::once(normal).chain(roughness);
        for info in used() {
            if self.picture_of(info.index).is_none() {
                return Err(Reason::NoPicture(info.index));
            }
            if !sampler(info).has_mips() {
                return Err(Reason::NoMips);
            }
        }
        if let Some(roughness) = roughness {
            if coordinates(normal).is_none() || coordinates(normal) != coordinates(roughness) {
                return Err(Reason::LaidApart);
            }
            if !sampler(normal).wraps_as(&sampler(roughness)) {
                return Err(Reason::WrappedApart);
            }
        }
        if roughness.is_some_and(|roughness| self.is_ours(roughness.index)) {
            return Err(Reason::AlreadyFixed);
        }
        if let Some(pointer) = self.animated(index, layer) {
            return Err(Reason::Animated(pointer.to_owned()));
        }
        Ok(Pair {
            layer,
            normal: normal.index,
            scale: normal.scale,
            roughness: roughness.map(|info| info.index),
            factor: 1.0,
            holds_occlusion: false,
        })
    }

    /// Sampler of a texture; glTF's default where it names none.
    pub(super) fn sampler(&self, texture: usize) -> Sampler {
        let sampler = self.document.textures.get(texture).and_then(|texture| texture.sampler);
        sampler.and_then(|i| self.document.samplers.get(i)).copied().unwrap_or_default()
    }

    /// Place in the document that an animation moves, and that a layer's maps depend on.
    fn animated(&self, material: usize, layer: Layer) -> Option<&str> {
        let place = |keys: &[&str]| format!("/materials/{material}/{}", keys.join("/"));
        let holder = place(layer.holder());
        let places = [
            place(layer.normal_keys()),
            format!("{holder}/{}", layer.texture_key()),
            format!("{holder}/{}", layer.factor_key()),
        ];
        let channels = self.document.animations.iter().flat_map(|animation| &animation.channels);
        channels
            .filter_map(|channel| channel.target.pointer())
            .find(|pointer| places.iter().any(|place| pointer.starts_with(place.as_str())))
    }
}

/// Clearcoat with normals of its own.
fn coat(material: &Material) -> Option<Clearcoat> {
    let coat: Clearcoat = serde_json::from_value(material.extensions.get(CLEARCOAT)?.clone()).ok()?;
    coat.clearcoat_normal_texture.is_some().then_some(coat)
}

fn coordinates(info: &TextureInfo) -> Option<super::document::Coordinates> {
    info.coordinates().ok()
}

/// A pair whose numbers are in their ranges.
fn ranged(pair: Pair) -> Result<Pair, Reason> {
    if !(0.0..=1.0).contains(&pair.factor) {
        return Err(Reason::OutOfRange("roughness factor"));
    }
    if !pair.scale.is_finite() {
        return Err(Reason::OutOfRange("scale of normals"));
    }
    Ok(pair)
}
