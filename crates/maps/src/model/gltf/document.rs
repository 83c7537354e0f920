//! Documents: the JSON of a file, what it must not hold, and the bytes that it names.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::meshopt::{self, Packed};
use crate::MapError;
use crate::formats::read_file;

/// Extensions that a file may require, besides [`meshopt::NAMES`].
const READ_EXTENSIONS: [&str; 7] = [
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "EXT_texture_webp",
    "KHR_texture_basisu",
    "MSFT_texture_dds",
];

/// Extensions that name a texture's picture in another format, in the order in which one is chosen.
pub(crate) const PICTURES: [&str; 3] = ["KHR_texture_basisu", "EXT_texture_webp", "MSFT_texture_dds"];

/// Document and its buffers.
pub(super) struct Opened<'a> {
    pub(super) path: &'a Path,
    pub(super) document: gltf::Document,
    pub(super) buffers: Vec<Cow<'a, [u8]>>,
}

impl Opened<'_> {
    /// Bytes of all buffers.
    pub(super) fn held(&self) -> usize {
        self.buffers.iter().map(|b| b.len()).sum()
    }
}

/// Opens a file of JSON or of the binary form.
///
/// # Errors
/// [`MapError`] for a damaged file, one that needs what is not read, and files that it names and that cannot
/// be read.
pub(super) fn open<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<Opened<'a>, MapError> {
    let invalid = |e: &dyn std::fmt::Display| MapError::invalid(path, e);
    let (json, blob) = if bytes.starts_with(b"glTF") {
        if bytes.get(4..8) == Some(&1_u32.to_le_bytes()) {
            return Err(MapError::unsupported(path, OLD));
        }
        let glb = gltf::Glb::from_slice(bytes).map_err(|e| invalid(&e))?;
        (glb.json, glb.bin)
    } else {
        (Cow::Borrowed(bytes), None)
    };
    let mut json: Value = serde_json::from_slice(&json).map_err(|e| invalid(&e))?;
    refuse_unread(path, &json)?;
    rewrite(&mut json);
    let packed = Packed::of(path, &mut json)?;
    let json: gltf::json::Root = serde_json::from_value(json).map_err(|e| invalid(&e))?;
    let document = gltf::Document::from_json(json).map_err(|e| invalid(&e))?;
    let mut buffers = Vec::new();
    for buffer in document.buffers().take(packed.own) {
        buffers.push(match buffer.source() {
            _ if !packed.reads(buffer.index()) => Cow::Borrowed([].as_slice()),
            gltf::buffer::Source::Uri(uri) => Cow::Owned(resource(path, uri)?.bytes),
            gltf::buffer::Source::Bin => {
                blob.clone().ok_or_else(|| MapError::invalid(path, "lacks its binary chunk"))?
            }
        });
    }
    packed.unpack(path, &mut buffers)?;
    Ok(Opened { path, document, buffers })
}

/// Refusal of the version before the present one.
pub(crate) const OLD: &str = "is glTF 1.0, which is not read: export glTF 2.0";

/// Refuses what is not read, by its name, before a parser stumbles over what comes of it.
fn refuse_unread(path: &Path, json: &Value) -> Result<(), MapError> {
    let version = json.pointer("/asset/version").and_then(Value::as_str).unwrap_or_default();
    if version.starts_with("1.") {
        return Err(MapError::unsupported(path, OLD));
    }
    let required = json.get("extensionsRequired").and_then(Value::as_array);
    for name in required.into_iter().flatten().filter_map(Value::as_str) {
        if !READ_EXTENSIONS.contains(&name) && !meshopt::NAMES.contains(&name) {
            return Err(MapError::unsupported(
                path,
                format!("requires {name}, which is not read: export it without"),
            ));
        }
    }
    Ok(())
}

/// Writes what extensions say where the crate looks for it: it refuses those it does not know, and takes
/// pictures from the core format alone.
fn rewrite(json: &mut Value) {
    let Some(root) = json.as_object_mut() else { return };
    root.remove("extensionsRequired");
    // Attributes of applications, which begin with an underscore, are no semantics that the crate knows.
    for mesh in root.get_mut("meshes").and_then(Value::as_array_mut).into_iter().flatten() {
        for primitive in mesh.get_mut("primitives").and_then(Value::as_array_mut).into_iter().flatten() {
            if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
                attributes.retain(|name, _| !name.starts_with('_'));
            }
        }
    }
    for texture in root.get_mut("textures").and_then(Value::as_array_mut).into_iter().flatten() {
        if texture.get("source").is_none() {
            let named = |name: &&str| texture.pointer(&format!("/extensions/{name}/source")).cloned();
            if let Some(source) = PICTURES.iter().find_map(named) {
                texture["source"] = source;
            }
        }
    }
}

/// Bytes behind a URI, and a path to name them by.
pub(crate) struct Resource {
    pub(crate) path: PathBuf,
    pub(crate) bytes: Vec<u8>,
}

/// Bytes behind a URI.
///
/// # Errors
/// [`MapError`] for one that is no base64 data, or no file beside the document that can be read.
pub(crate) fn resource(path: &Path, uri: &str) -> Result<Resource, MapError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let coded = data.split_once(";base64,").map(|(_, coded)| coded);
        let coded = coded.ok_or_else(|| MapError::unsupported(path, "has a data URI that is not base64"))?;
        let bytes = STANDARD
            .decode(coded)
            .map_err(|e| MapError::invalid(path, format!("has a damaged data URI: {e}")))?;
        return Ok(Resource { path: path.to_owned(), bytes });
    }
    let file = resource_path(path, uri)?;
    let bytes = read_file(&file)?;
    Ok(Resource { path: file, bytes })
}

/// File behind a URI that is no data.
///
/// # Errors
/// [`MapError`] for one that is no file beside the document.
pub(crate) fn resource_path(path: &Path, uri: &str) -> Result<PathBuf, MapError> {
    let name = percent_decoded(uri);
    let relative = !name.contains(':') && !Path::new(&name).has_root();
    if !relative {
        return Err(MapError::unsupported(path, format!("names `{uri}`, which is not a file beside it")));
    }
    let file = path.with_file_name("").join(name);
    // Refuses a device or a pipe, which would never end.
    if file.exists() && !file.is_file() {
        return Err(MapError::invalid(&file, "is no file"));
    }
    Ok(file)
}

/// A URI's `%20` and its kind as the characters they stand for.
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((first, tail)) = rest.split_first() {
        let code = tail
            .get(..2)
            .filter(|hex| hex.iter().all(u8::is_ascii_hexdigit))
            .and_then(|hex| std::str::from_utf8(hex).ok());
        match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            _ => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
