//! glTF assets whose textures are exchanged, and nothing else: unknown chunks and extensions, the order of
//! keys and the text of numbers stay as they are.
//!
//! [`Asset::layers`] finds where a normal map and a roughness belong together, and says why others are left
//! alone. [`Asset::normals`] and [`Asset::roughness`] read them; [`Asset::edited`] puts new textures in their
//! place. Meshes are not read, so an asset may hold them in any form.

mod container;
mod document;
mod edit;
mod layers;
mod pack;
mod reprint;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ndfmap_core::grid::Grid;
use ndfmap_core::surface::{Surface, Wrap, Wraps};
use serde_json::Value;

pub use edit::{AssetFile, Edited, Form, MaterialPair, Replacement, Slot};
pub use layers::{Layer, MaterialLayer, Pair, Reason};

use self::container::Container;
use self::document::{Document, ImageRef, REPEAT};
use crate::attribute::Transfer;
use crate::formats::{read_file, read_image};
use crate::model::{PICTURES, Resource, Scaled, colours, resource};
use crate::source::{Convention, SourceOptions, source_of_image};
use crate::{Image, MapError, SourceKind};

/// Key and value by which a KTX2 file names this program.
const WRITER: &[u8] = b"KTXwriter\0ndfmap";

/// A glTF 2.0 file, of JSON or of the binary form.
#[derive(Clone, Debug)]
pub struct Asset {
    path: PathBuf,
    bytes: Vec<u8>,
    container: Container,
    json: Value,
    document: Document,
}

/// Light that a material reflects, on the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Mean of the base colour, linear, over its texels and its channels.
    pub base: f32,
    /// Mean metalness, 0 to 1.
    pub metallic: f32,
}

impl Asset {
    /// Reads a file.
    ///
    /// # Errors
    /// [`MapError`] when it cannot be read, or is no sound glTF 2.0.
    pub fn read(path: &Path) -> Result<Self, MapError> {
        Self::from_bytes(path, &read_file(path)?)
    }

    /// Takes the bytes of a file; the path names it, and is where its resources lie.
    ///
    /// # Errors
    /// [`MapError`] when it is no sound glTF 2.0.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self, MapError> {
        let container = Container::read(path, bytes)?;
        let invalid = |e: serde_json::Error| MapError::invalid(path, format!("is no sound glTF: {e}"));
        let json: Value = serde_json::from_str(&container.json).map_err(invalid)?;
        let document: Document = serde_json::from_value(json.clone()).map_err(invalid)?;
        let version = &document.asset.version;
        if version.starts_with("1.") {
            return Err(MapError::unsupported(path, crate::model::OLD_GLTF));
        }
        if !version.starts_with("2.") {
            return Err(MapError::invalid(path, "is no glTF 2.0: its `asset.version` does not say so"));
        }
        Ok(Self { path: path.to_owned(), bytes: bytes.to_vec(), container, json, document })
    }

    /// Name of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True for the binary form.
    #[must_use]
    pub fn is_binary(&self) -> bool {
        self.container.binary.is_some()
    }

    /// Index of the image that a texture shows: an extension's, which engines prefer and whose fallback may
    /// be small, or else the core format's.
    fn picture_of(&self, texture: usize) -> Option<usize> {
        let texture = self.document.textures.get(texture)?;
        let extended = |name: &&str| {
            let source = texture.extensions.get(*name)?.get("source")?.as_u64()?;
            usize::try_from(source).ok()
        };
        PICTURES.iter().find_map(extended).or(texture.source)
    }

    /// True where a pair's roughness texture has a picture of the core format, PNG or JPEG.
    #[must_use]
    pub fn has_core_picture(&self, pair: &Pair) -> bool {
        let texture = pair.roughness.and_then(|texture| self.document.textures.get(texture));
        texture.is_some_and(|texture| texture.source.is_some())
    }

    /// True for a texture that this program wrote: its mips are its own.
    fn is_ours(&self, texture: usize) -> bool {
        /// Bytes of a KTX2 file that hold its keys, for any number of levels.
        const FRONT: usize = 2048;
        let written = |bytes: &[u8]| {
            let front = &bytes[..bytes.len().min(FRONT)];
            front.windows(WRITER.len()).any(|window| window == WRITER)
        };
        let image = self.picture_of(texture).and_then(|image| self.image_bytes(image).ok());
        image.is_some_and(|image| written(&image.bytes))
    }

    fn invalid(&self, reason: impl ToString) -> MapError {
        MapError::invalid(&self.path, reason)
    }

    /// Bytes of a buffer.
    fn buffer(&self, index: usize) -> Result<std::borrow::Cow<'_, [u8]>, MapError> {
        let buffer = self.document.buffers.get(index);
        let buffer = buffer.ok_or_else(|| self.invalid(format!("has no buffer {index}")))?;
        match (&buffer.uri, self.container.bin()) {
            (Some(uri), _) => Ok(resource(&self.path, uri)?.bytes.into()),
            (None, Some(bin)) if index == 0 => Ok(bin.into()),
            (None, _) => Err(self.invalid(format!("has a buffer, {index}, without bytes"))),
        }
    }

    /// Bytes of an image, and a path to name it by.
    fn image_bytes(&self, index: usize) -> Result<Resource, MapError> {
        let image = self.document.images.get(index);
        let ImageRef { uri, buffer_view } =
            image.ok_or_else(|| self.invalid(format!("has no image {index}")))?;
        if let Some(uri) = uri {
            return resource(&self.path, uri);
        }
        let view = buffer_view.and_then(|view| self.document.buffer_views.get(view));
        let view = view.ok_or_else(|| self.invalid(format!("has an image, {index}, without bytes")))?;
        let buffer = self.buffer(view.buffer)?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| buffer.get(view.byte_offset..end));
        let bytes =
            bytes.ok_or_else(|| self.invalid(format!("has an image, {index}, outside its buffer")))?;
        Ok(Resource { path: self.path.clone(), bytes: bytes.to_vec() })
    }

    /// Picture of a texture, and a path to name it by.
    fn picture(&self, texture: usize) -> Result<(PathBuf, Image), MapError> {
        let image = self.picture_of(texture);
        let image =
            image.ok_or_else(|| self.invalid(format!("has a texture, {texture}, without a picture")))?;
        let Resource { path, bytes } = self.image_bytes(image)?;
        let image = read_image(&path, &bytes)?;
        Ok((path, image))
    }

    /// Normals of a pair, scaled as it asks, and warnings about them.
    ///
    /// # Errors
    /// [`MapError`] when the picture cannot be read.
    pub fn normals(&self, pair: &Pair) -> Result<(Arc<dyn Surface>, Vec<String>), MapError> {
        let (path, image) = self.picture(pair.normal)?;
        let sampler = self.sampler(pair.normal);
        // An image of itself beyond an edge goes on with the same texel there, as a clamped one does.
        let wrap = |mode| if mode == REPEAT { Wrap::Repeat } else { Wrap::Clamp };
        let options = SourceOptions {
            kind: Some(SourceKind::Normal),
            // Green is up in glTF (2.0, 3.9.3).
            convention: Some(Convention::OpenGl),
            wraps: Wraps { x: wrap(sampler.wrap_s), y: wrap(sampler.wrap_t) },
            ..SourceOptions::default()
        };
        let map = source_of_image(&path, image, String::new(), &options)?;
        Ok((Scaled::of(map.surface, pair.scale), map.warnings))
    }

    /// Values of a pair's roughness texture, green its roughness before the factor; none where it has none.
    ///
    /// # Errors
    /// [`MapError`] when the picture cannot be read.
    pub fn roughness(&self, pair: &Pair) -> Result<Option<Grid<[f32; 4]>>, MapError> {
        let Some(texture) = pair.roughness else { return Ok(None) };
        let (path, image) = self.picture(texture)?;
        colours(&path, &image, Transfer::Linear).map(Some)
    }

    /// Light that a material reflects, on the whole.
    ///
    /// # Errors
    /// [`MapError`] when a picture cannot be read, or there is no such material.
    pub fn appearance(&self, material: usize) -> Result<Appearance, MapError> {
        let material = self.document.materials.get(material);
        let material = material.ok_or_else(|| self.invalid("has no such material"))?;
        let pbr = &material.pbr_metallic_roughness;
        let mean = |texture: Option<usize>, transfer: Transfer, channels: &[usize]| {
            let Some(texture) = texture.filter(|t| self.picture_of(*t).is_some()) else {
                return Ok(vec![1.0; channels.len()]);
            };
            let (path, image) = self.picture(texture)?;
            let values = colours(&path, &image, transfer)?;
            let of_channel = |c: &usize| {
                let sum: f64 = values.texels().iter().map(|texel| f64::from(texel[*c])).sum();
                (sum / values.texels().len() as f64) as f32
            };
            Ok::<_, MapError>(channels.iter().map(of_channel).collect())
        };
        let base = mean(pbr.base_color_texture.as_ref().map(|t| t.index), Transfer::Srgb, &[0, 1, 2])?;
        let metal = mean(pbr.metallic_roughness_texture.as_ref().map(|t| t.index), Transfer::Linear, &[2])?;
        let tinted = base.iter().zip(pbr.base_color_factor).map(|(texture, factor)| texture * factor);
        let unit = |v: f32| if v.is_finite() { v.clamp(0.0, 1.0) } else { 1.0 };
        Ok(Appearance {
            base: unit(tinted.sum::<f32>() / 3.0),
            metallic: unit(metal[0] * pbr.metallic_factor),
        })
    }
}
