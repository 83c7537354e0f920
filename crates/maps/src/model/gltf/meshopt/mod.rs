//! Compressed views of buffers: `EXT_meshopt_compression` and `KHR_meshopt_compression`, written from the
//! specifications of both (github.com/KhronosGroup/glTF). They differ in a version and a filter of the
//! second, which streams name themselves: both are read under either name.
//!
//! A compressed view becomes a buffer of its own, so that memory goes by what is decoded, not by what a
//! document says about the buffer for readers without the extension. That one is not opened where only
//! compressed views lie in it.

mod attributes;
mod filters;
mod indices;
mod stream;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

use serde::Deserialize;
use serde_json::{Value, json};

use self::stream::Damage;
use super::MAX_ELEMENTS;
use crate::MapError;

/// Names of the extension, of which a view has one.
pub(super) const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// Most bytes of all decoded views: those of the largest model, with positions, normals, tangents,
/// coordinates and three indices for each vertex.
const MAX_BYTES: usize = 60 * MAX_ELEMENTS;

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Content of a compressed view.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Layout {
    mode: Mode,
    #[serde(default)]
    filter: Filter,
    /// Number of elements.
    count: usize,
    /// Bytes of an element.
    byte_stride: usize,
}

impl Layout {
    /// True for a stride and a count that the mode and the filter allow.
    fn is_sound(self) -> bool {
        let fits = match self.mode {
            Mode::Attributes => (4..=256).contains(&self.byte_stride) && self.byte_stride.is_multiple_of(4),
            Mode::Triangles => matches!(self.byte_stride, 2 | 4) && self.count.is_multiple_of(3),
            Mode::Indices => matches!(self.byte_stride, 2 | 4),
        };
        let filtered = match self.filter {
            Filter::None => return fits,
            Filter::Octahedral | Filter::Color => matches!(self.byte_stride, 4 | 8),
            Filter::Quaternion => self.byte_stride == 8,
            Filter::Exponential => true,
        };
        fits && filtered && matches!(self.mode, Mode::Attributes)
    }

    /// Decodes a stream. Memory is bounded by its length, whatever the count is.
    fn decode(self, bytes: &[u8]) -> Result<Vec<u8>, Damage> {
        if !self.is_sound() {
            return Err("has a stride or a count that its mode or filter does not allow");
        }
        let indices = match self.mode {
            Mode::Attributes => {
                let mut decoded = attributes::decode(bytes, self.count, self.byte_stride)?;
                if let Some(filter) = self.filter.function() {
                    decoded.chunks_exact_mut(self.byte_stride).for_each(filter);
                }
                return Ok(decoded);
            }
            Mode::Triangles => indices::triangles(bytes, self.count)?,
            Mode::Indices => indices::sequence(bytes, self.count)?,
        };
        Ok(match self.byte_stride {
            2 => indices.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|i| i.to_le_bytes()).collect(),
        })
    }
}

impl Filter {
    /// Filter of the bytes of an element.
    fn function(self) -> Option<fn(&mut [u8])> {
        match self {
            Self::None => None,
            Self::Octahedral => Some(filters::octahedral),
            Self::Quaternion => Some(filters::quaternion),
            Self::Exponential => Some(filters::exponential),
            Self::Color => Some(filters::color),
        }
    }
}

/// A view as the extension has it.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct PackedView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    #[serde(flatten)]
    layout: Layout,
}

/// Compressed views of a document.
pub(super) struct Packed {
    views: Vec<PackedView>,
    /// Number of the document's own buffers, behind which those of the views come.
    pub(super) own: usize,
    /// Buffers that a plain view or a compressed one takes its bytes from.
    read: HashSet<usize>,
}

impl Packed {
    /// Takes the compressed views out of a document: each then names a buffer of its own.
    ///
    /// # Errors
    /// [`MapError`] for views that contradict themselves.
    pub(super) fn of(path: &Path, document: &mut Value) -> Result<Self, MapError> {
        let own = document.get("buffers").and_then(Value::as_array).map_or(0, Vec::len);
        let mut packed = Self { views: Vec::new(), own, read: HashSet::new() };
        let mut added = Vec::new();
        for view in document.get_mut("bufferViews").and_then(Value::as_array_mut).into_iter().flatten() {
            let coded = NAMES.iter().find_map(|name| view.get("extensions")?.get(name));
            let Some(coded) = coded else {
                packed.read.extend(number(view, "buffer"));
                continue;
            };
            let coded = PackedView::deserialize(coded)
                .map_err(|e| MapError::invalid(path, format!("has a damaged compressed view: {e}")))?;
            let Layout { count, byte_stride, .. } = coded.layout;
            let length = count.checked_mul(byte_stride);
            let stride = number(view, "byteStride").unwrap_or(byte_stride);
            if number(view, "byteLength") != length || stride != byte_stride || coded.buffer >= own {
                return Err(MapError::invalid(path, "has a compressed view that contradicts itself"));
            }
            view["buffer"] = (own + packed.views.len()).into();
            view["byteOffset"] = 0.into();
            added.push(json!({ "byteLength": length }));
            packed.read.insert(coded.buffer);
            packed.views.push(coded);
        }
        if let Some(buffers) = document.get_mut("buffers").and_then(Value::as_array_mut) {
            buffers.extend(added);
        }
        Ok(packed)
    }

    /// True for a buffer whose bytes are needed.
    pub(super) fn reads(&self, buffer: usize) -> bool {
        self.read.contains(&buffer)
    }

    /// Decodes the views and puts their buffers behind the document's own.
    ///
    /// # Errors
    /// [`MapError`] for damaged views, and for more bytes than a model of this size has.
    pub(super) fn unpack(&self, path: &Path, buffers: &mut Vec<Cow<'_, [u8]>>) -> Result<(), MapError> {
        let held: usize = buffers.iter().map(|buffer| buffer.len()).sum();
        // Views that share their bytes would decode to any length.
        let most = MAX_BYTES.min(held.saturating_mul(attributes::MAX_RATIO));
        let lengths = self.views.iter().map(|view| view.layout.count.saturating_mul(view.layout.byte_stride));
        if lengths.fold(0, usize::saturating_add) > most {
            return Err(MapError::unsupported(path, format!("decompresses to more than {most} bytes")));
        }
        let mut decoded = Vec::new();
        for PackedView { buffer, byte_offset, byte_length, layout } in &self.views {
            let bytes = buffers.get(*buffer).and_then(|bytes| bytes.get(*byte_offset..)?.get(..*byte_length));
            let bytes =
                bytes.ok_or_else(|| MapError::invalid(path, "has a compressed view outside its buffer"))?;
            let bytes = layout
                .decode(bytes)
                .map_err(|damage| MapError::invalid(path, format!("has a compressed view that {damage}")))?;
            decoded.push(Cow::Owned(bytes));
        }
        buffers.extend(decoded);
        Ok(())
    }
}

fn number(object: &Value, name: &str) -> Option<usize> {
    usize::try_from(object.get(name)?.as_u64()?).ok()
}
