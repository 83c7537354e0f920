//! Edits: new textures in the places of old ones.
//!
//! A texture is changed where it stands only when all that uses it is known and changes with it; otherwise a
//! new one goes to the end of the list, as new images always do. Nothing is taken out, so no index changes.

use std::path::{Component, Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ndfmap_core::words;
use serde_json::{Map, Value, json};

use super::document::TEXTURE_TRANSFORM;
use super::reprint::reprint;
use super::{Asset, Pair};
use crate::MapError;
use crate::formats::read_file;
use crate::model::{PICTURES, resource_path};

/// Manner in which an engine finds a KTX2 texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// `KHR_texture_basisu`, with a PNG or JPEG for those that do not know it.
    #[default]
    Web,
    /// KTX2 where PNG and JPEG stand, as Bevy reads it.
    Bevy,
}

words!(Form { Web => "web", Bevy => "bevy" });

/// Place of a texture in a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// Roughness texture.
    Roughness,
    /// Normal texture.
    Normals,
}

/// Pair of a material.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPair {
    /// Index of the material.
    pub material: usize,
    /// Its pair.
    pub pair: Pair,
}

/// A new texture, and the layers that are to use it: all of the same old texture.
#[derive(Clone, Debug)]
pub struct Replacement {
    /// Place of the texture.
    pub slot: Slot,
    /// Layers that use it, at least one.
    pub layers: Vec<MaterialPair>,
    /// Name of it, for files and images.
    pub name: String,
    /// File in KTX2.
    pub ktx2: Vec<u8>,
    /// PNG file of the finest level, for engines without `KHR_texture_basisu`; none where the old picture
    /// says the same.
    pub fallback: Option<Vec<u8>>,
}

/// File to be written.
#[derive(Clone, Debug)]
pub struct AssetFile {
    /// Name of the file.
    pub path: PathBuf,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// Edited asset: files to be written, the document last.
#[derive(Clone, Debug)]
pub struct Edited {
    /// Files that the document names, and then the document.
    pub files: Vec<AssetFile>,
}

/// Extension that names a KTX2 picture.
const BASIS: &str = "KHR_texture_basisu";

/// Extensions that point at textures from materials alone, under keys that end in `Texture`, or not at all;
/// those of materials besides, which begin alike.
const KNOWN: [&str; 13] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];
const KNOWN_MATERIALS: &str = "KHR_materials_";

impl Asset {
    /// Puts new textures in the place of old ones; `out` is where the document will lie.
    ///
    /// # Errors
    /// [`MapError`] for an asset whose indices or lists are not what they should be, one that would be too
    /// large for its form, and files beside it that cannot be read or copied.
    pub fn edited(&self, replacements: &[Replacement], form: Form, out: &Path) -> Result<Edited, MapError> {
        let mut edit = Edit {
            asset: self,
            json: self.json.clone(),
            form,
            out,
            bin: self.container.bin().map_or(0, <[u8]>::len),
            appended: Vec::new(),
            files: Vec::new(),
        };
        for replacement in replacements {
            edit.replace(replacement)?;
        }
        edit.finish()
    }
}

/// Edit under way.
struct Edit<'a> {
    asset: &'a Asset,
    json: Value,
    form: Form,
    out: &'a Path,
    /// Length of the binary chunk as it was.
    bin: usize,
    /// Bytes that go behind it.
    appended: Vec<u8>,
    files: Vec<AssetFile>,
}

impl Edit<'_> {
    /// List of the document by its name, made where there is none.
    fn list(&mut self, name: &str) -> Result<&mut Vec<Value>, MapError> {
        let asset = self.asset;
        let root = self.json.as_object_mut().ok_or_else(|| asset.invalid("is no JSON object"))?;
        let list = root.entry(name).or_insert_with(|| Value::Array(Vec::new()));
        list.as_array_mut().ok_or_else(|| asset.invalid(format!("has `{name}` that is no list")))
    }

    fn push(&mut self, name: &str, value: Value) -> Result<usize, MapError> {
        let list = self.list(name)?;
        list.push(value);
        Ok(list.len() - 1)
    }

    /// Object in a material, by keys, made where there is none.
    fn object(&mut self, material: usize, keys: &[&str]) -> Result<&mut Map<String, Value>, MapError> {
        let asset = self.asset;
        let missing = || asset.invalid(format!("has no material {material}"));
        let mut at = self.list("materials")?.get_mut(material).ok_or_else(missing)?;
        for key in keys {
            let object = at.as_object_mut().ok_or_else(missing)?;
            at = object.entry(*key).or_insert_with(|| Value::Object(Map::new()));
        }
        at.as_object_mut().ok_or_else(missing)
    }

    fn replace(&mut self, replacement: &Replacement) -> Result<(), MapError> {
        let Some(first) = replacement.layers.first() else { return Ok(()) };
        let old = match replacement.slot {
            Slot::Normals => Some(first.pair.normal),
            Slot::Roughness => first.pair.roughness,
        };
        let uses: usize =
            replacement.layers.iter().map(|layer| 1 + usize::from(takes_occlusion(layer, replacement))).sum();
        let texture = self.texture(replacement, old.unwrap_or(first.pair.normal), old.is_some())?;
        let index = match old.filter(|old| self.is_free(*old, uses)) {
            Some(old) => {
                self.list("textures")?[old] = texture;
                old
            }
            None => self.push("textures", texture)?,
        };
        replacement.layers.iter().try_for_each(|layer| self.point(layer, replacement, index))
    }

    /// New texture, with the sampler of another, and its other members where it takes its place.
    fn texture(
        &mut self,
        replacement: &Replacement,
        other: usize,
        takes_place: bool,
    ) -> Result<Value, MapError> {
        let asset = self.asset;
        let old = self.list("textures")?.get(other).and_then(Value::as_object).cloned();
        let old = old.ok_or_else(|| asset.invalid(format!("has no texture {other}")))?;
        let mut texture = if takes_place { old.clone() } else { Map::new() };
        if let Some(sampler) = old.get("sampler") {
            texture.insert("sampler".to_owned(), sampler.clone());
        }
        let ktx2 = self.store(&format!("{}.ktx2", replacement.name), "image/ktx2", &replacement.ktx2)?;
        let source = match (self.form, &replacement.fallback) {
            (Form::Bevy, _) => Some(ktx2),
            (Form::Web, Some(png)) => {
                Some(self.store(&format!("{}.png", replacement.name), "image/png", png)?)
            }
            (Form::Web, None) => asset.document.textures.get(other).and_then(|texture| texture.source),
        };
        match source {
            Some(source) => texture.insert("source".to_owned(), source.into()),
            None => texture.remove("source"),
        };
        let mut extensions = texture.remove("extensions").unwrap_or_else(|| json!({}));
        if let Some(extensions) = extensions.as_object_mut() {
            PICTURES.iter().chain(&["EXT_texture_avif"]).for_each(|name| {
                extensions.remove(*name);
            });
            if self.form == Form::Web {
                extensions.insert(BASIS.to_owned(), json!({ "source": ktx2 }));
            }
        }
        if extensions.as_object().is_none_or(|extensions| !extensions.is_empty()) {
            texture.insert("extensions".to_owned(), extensions);
        }
        if self.form == Form::Web {
            let used = self.list("extensionsUsed")?;
            if !used.iter().any(|name| name == BASIS) {
                used.push(BASIS.into());
            }
        }
        Ok(Value::Object(texture))
    }

    /// Points a material at a texture.
    fn point(
        &mut self,
        layer: &MaterialPair,
        replacement: &Replacement,
        index: usize,
    ) -> Result<(), MapError> {
        let MaterialPair { material, pair } = layer;
        if replacement.slot == Slot::Normals {
            self.object(*material, pair.layer.normal_keys())?.insert("index".to_owned(), index.into());
            return Ok(());
        }
        let normal = self.object(*material, pair.layer.normal_keys())?.clone();
        let holder = self.object(*material, pair.layer.holder())?;
        let key = pair.layer.texture_key();
        match holder.get_mut(key).and_then(Value::as_object_mut) {
            Some(info) => {
                info.insert("index".to_owned(), index.into());
            }
            None => {
                // It lies where the normal map lies.
                let mut info = Map::from_iter([("index".to_owned(), index.into())]);
                let transform = normal.get("extensions").and_then(|all| all.get(TEXTURE_TRANSFORM));
                info.extend(normal.get("texCoord").map(|set| ("texCoord".to_owned(), set.clone())));
                info.extend(transform.map(|t| ("extensions".to_owned(), json!({ TEXTURE_TRANSFORM: t }))));
                holder.insert(key.to_owned(), info.into());
            }
        }
        // The factor is in the texture now.
        if pair.factor != 1.0 {
            holder.insert(pair.layer.factor_key().to_owned(), 1.into());
        }
        if takes_occlusion(layer, replacement) {
            self.object(*material, &["occlusionTexture"])?.insert("index".to_owned(), index.into());
        }
        Ok(())
    }

    /// True where a texture is used so many times in materials, and nowhere else.
    fn is_free(&self, texture: usize, uses: usize) -> bool {
        let known = |name: &String| KNOWN.contains(&&**name) || name.starts_with(KNOWN_MATERIALS);
        self.asset.document.extensions_used.iter().all(known)
            && self.json.get("materials").map_or(0, |materials| count(materials, texture)) == uses
    }

    /// Stores a picture; returns the index of its image.
    fn store(&mut self, name: &str, mime: &str, bytes: &[u8]) -> Result<usize, MapError> {
        let buffers = &self.asset.document.buffers;
        if self.asset.is_binary() && buffers.first().is_none_or(|buffer| buffer.uri.is_none()) {
            // KTX2 wants its own beginning at a multiple of 16, lest its levels lie askew.
            let start = (self.bin + self.appended.len()).next_multiple_of(16) - self.bin;
            self.appended.resize(start, 0);
            self.appended.extend_from_slice(bytes);
            let view = json!({ "buffer": 0, "byteOffset": self.bin + start, "byteLength": bytes.len() });
            let view = self.push("bufferViews", view)?;
            return self.push("images", json!({ "name": name, "mimeType": mime, "bufferView": view }));
        }
        if self.asset.is_binary() || self.is_one_file() {
            let uri = format!("data:{mime};base64,{}", STANDARD.encode(bytes));
            return self.push("images", json!({ "name": name, "uri": uri }));
        }
        let stem = self.out.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let file = self.free_name(&plain(&format!("{stem}-{name}")));
        self.files.push(AssetFile { path: self.out.with_file_name(&file), bytes: bytes.to_vec() });
        self.push("images", json!({ "mimeType": mime, "uri": file }))
    }

    /// Name that no other new file has, and none that the document names: numbered where it is taken.
    fn free_name(&self, name: &str) -> String {
        let taken = |name: &str| {
            let new = self.files.iter().filter_map(|file| file.path.file_name());
            let new = new.map(|file| file.to_string_lossy().to_lowercase());
            let mut old = uris(&self.json).map(str::to_lowercase);
            new.chain(old.by_ref()).any(|other| other == name.to_lowercase())
        };
        let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
        let numbered = (2..).map(|number| format!("{stem}-{number}.{extension}"));
        std::iter::once(name.to_owned()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
    }

    /// True for a document without files beside it.
    fn is_one_file(&self) -> bool {
        uris(&self.asset.json).all(|uri| uri.starts_with("data:"))
    }

    fn finish(mut self) -> Result<Edited, MapError> {
        let asset = self.asset;
        if !self.appended.is_empty() {
            let length = self.bin + self.appended.len();
            let buffers = self.list("buffers")?;
            match buffers.first_mut().and_then(Value::as_object_mut) {
                Some(buffer) => {
                    buffer.insert("byteLength".to_owned(), length.into());
                }
                None => buffers.push(json!({ "byteLength": length })),
            }
        }
        let document = if self.json == asset.json {
            // Even an edit of nothing might pad a chunk.
            asset.bytes.clone()
        } else {
            let text = reprint(&asset.container.json, &self.json).map_err(|e| asset.invalid(e))?;
            asset.container.write(self.out, &text, &self.appended)?
        };
        let mut files = self.copies()?;
        files.append(&mut self.files);
        files.push(AssetFile { path: self.out.to_owned(), bytes: document });
        Ok(Edited { files })
    }

    /// Files beside the input, where the output lies in another folder and lacks them.
    fn copies(&self) -> Result<Vec<AssetFile>, MapError> {
        let folder = |path: &Path| std::path::absolute(path.with_file_name("")).ok();
        if folder(&self.asset.path) == folder(self.out) {
            return Ok(Vec::new());
        }
        let new = |uri: &&str| !self.files.iter().any(|file| file.path == self.out.with_file_name(uri));
        let mut copies: Vec<AssetFile> = Vec::new();
        for uri in uris(&self.json).filter(|uri| !uri.starts_with("data:")).filter(new) {
            let from = resource_path(&self.asset.path, uri)?;
            let relative = from.strip_prefix(self.asset.path.with_file_name("")).unwrap_or(&from).to_owned();
            if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
                let reason = format!("names `{uri}`, outside its folder: write the output beside the input");
                return Err(MapError::unsupported(&self.asset.path, reason));
            }
            let path = self.out.with_file_name("").join(relative);
            if copies.iter().any(|copy| copy.path == path) {
                continue;
            }
            let bytes = read_file(&from)?;
            if !path.exists() {
                copies.push(AssetFile { path, bytes });
            } else if read_file(&path)? != bytes {
                let reason =
                    format!("is another file than the `{uri}` of the model: write into an empty folder");
                return Err(MapError::unsupported(&path, reason));
            }
        }
        Ok(copies)
    }
}

/// True where the occlusion of a layer's material moves with its roughness.
fn takes_occlusion(layer: &MaterialPair, replacement: &Replacement) -> bool {
    replacement.slot == Slot::Roughness && layer.pair.holds_occlusion
}

/// Uses of a texture below a value: objects under a key that ends in `Texture`, with its index.
fn count(value: &Value, texture: usize) -> usize {
    match value {
        Value::Object(members) => members
            .iter()
            .map(|(key, value)| {
                let index = value.get("index").and_then(Value::as_u64);
                let is_use = key.ends_with("Texture") && index == Some(texture as u64);
                usize::from(is_use) + count(value, texture)
            })
            .sum(),
        Value::Array(elements) => elements.iter().map(|value| count(value, texture)).sum(),
        _ => 0,
    }
}

/// URIs of buffers and images.
fn uris(json: &Value) -> impl Iterator<Item = &str> {
    ["buffers", "images"]
        .into_iter()
        .filter_map(|list| json.get(list)?.as_array())
        .flatten()
        .filter_map(|entry| entry.get("uri")?.as_str())
}

/// Name of letters that a URI and every file system take as they are.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}
