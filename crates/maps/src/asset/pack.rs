//! Documents with files beside them, put into one binary file.

use std::collections::HashMap;
use std::ops::Range;

use serde_json::{Map, Value, json};

use super::Asset;
use super::container::{Binary, Container};
use super::document::Document;
use super::reprint::reprint;
use crate::MapError;
use crate::model::resource;

/// First bytes of pictures and where they stand, and the kinds that glTF and its extensions call them.
const KINDS: [(usize, &[u8], &str); 5] = [
    (0, b"\x89PNG", "image/png"),
    (0, b"\xff\xd8", "image/jpeg"),
    (8, b"WEBP", "image/webp"),
    (1, b"KTX 20", "image/ktx2"),
    (0, b"DDS ", "image/vnd-ms.dds"),
];

/// Compressed views: extensions that name a buffer of their own beside the view's.
const COMPRESSED: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Multiple at which each file begins in the binary chunk; every accessor and KTX2 lies straight in it.
const ALIGNMENT: usize = 16;

impl Asset {
    /// The asset as one file of the binary form: its buffers one after the other, and its pictures behind
    /// them. A binary asset stays as it is, and so do buffers that have no bytes, as compressed views have
    /// for readers without their extension.
    ///
    /// # Errors
    /// [`MapError`] for files that cannot be read, pictures of no known kind, and more bytes than the binary
    /// form can hold.
    pub fn packed(self) -> Result<Self, MapError> {
        if self.is_binary() {
            return Ok(self);
        }
        let mut pack =
            Pack { json: self.json.clone(), asset: &self, bin: Vec::new(), stored: HashMap::new() };
        pack.buffers()?;
        pack.images()?;
        let Pack { json, bin, .. } = pack;
        let text = reprint(&self.container.json, &json).map_err(|e| self.invalid(e))?;
        let container = Container { json: text, binary: Some(Binary::default()) };
        let bytes = container.write(&self.path, &container.json, &bin)?;
        Self::from_bytes(&self.path, &bytes)
    }
}

/// Packing under way.
struct Pack<'a> {
    asset: &'a Asset,
    json: Value,
    bin: Vec<u8>,
    /// Places of files that are in already.
    stored: HashMap<&'a str, Range<usize>>,
}

/// New place of a buffer: its index, and where it begins in that one.
#[derive(Clone, Copy)]
struct Moved {
    index: usize,
    start: usize,
    /// Bytes that its views may be of.
    length: u64,
}

impl<'a> Pack<'a> {
    /// Objects of a list of the document; none where there is no such list.
    fn list(&mut self, name: &str) -> Result<Vec<&mut Map<String, Value>>, MapError> {
        let asset = self.asset;
        let Some(list) = self.json.get_mut(name) else { return Ok(Vec::new()) };
        let objects =
            list.as_array_mut().and_then(|list| list.iter_mut().map(Value::as_object_mut).collect());
        objects.ok_or_else(|| asset.invalid(format!("has `{name}` that is no list of objects")))
    }

    /// Puts a file into the binary chunk, once; says where.
    fn store(&mut self, uri: &'a str, bytes: &[u8]) -> Result<Range<usize>, MapError> {
        if let Some(place) = self.stored.get(uri) {
            return Ok(place.clone());
        }
        let start = self.bin.len().next_multiple_of(ALIGNMENT);
        if start + bytes.len() > u32::MAX as usize {
            let reason = "would be larger than the 4 GiB of a binary glTF";
            return Err(MapError::unsupported(&self.asset.path, reason));
        }
        self.bin.resize(start, 0);
        self.bin.extend_from_slice(bytes);
        self.stored.insert(uri, start..self.bin.len());
        Ok(start..self.bin.len())
    }

    /// Joins buffers that have bytes into the first, and leads their views there.
    fn buffers(&mut self) -> Result<(), MapError> {
        let asset = self.asset;
        let Document { buffers, images, .. } = &asset.document;
        if buffers.iter().all(|b| b.uri.is_none()) && images.iter().all(|i| i.uri.is_none()) {
            // There is nothing to join.
            return Ok(());
        }
        let lengths: Vec<u64> = self
            .list("buffers")?
            .iter()
            .map(|buffer| buffer.get("byteLength").and_then(Value::as_u64).unwrap_or(0))
            .collect();
        // Views of a buffer without bytes go on to it, behind the one that has them all.
        let (mut moved, mut kept) = (Vec::new(), Vec::new());
        for (i, length) in lengths.into_iter().enumerate() {
            let Some(uri) = asset.document.buffers.get(i).and_then(|buffer| buffer.uri.as_ref()) else {
                kept.push(i);
                moved.push(Moved { index: kept.len(), start: 0, length: u64::MAX });
                continue;
            };
            let file = resource(&asset.path, uri)?;
            if file.bytes.len() as u64 >= length {
                let start = self.store(uri, &file.bytes)?.start;
                moved.push(Moved { index: 0, start, length });
            } else {
                let reason = format!("has {} of the {length} bytes of buffer {i}", file.bytes.len());
                return Err(MapError::invalid(&file.path, reason));
            }
        }
        let lead = |view: &mut Map<String, Value>| {
            let old = view.get("buffer").and_then(Value::as_u64).and_then(|i| usize::try_from(i).ok());
            let old = old.and_then(|i| moved.get(i));
            let Moved { index, start, length } =
                *old.ok_or_else(|| asset.invalid("has a view of a buffer that is not there"))?;
            let number = |key: &str| view.get(key).and_then(Value::as_u64).unwrap_or(0);
            let (offset, own) = (number("byteOffset"), number("byteLength"));
            // Beyond its own buffer it would see another's bytes.
            if offset.checked_add(own).is_none_or(|end| end > length) {
                return Err(asset.invalid("has a view beyond the end of its buffer"));
            }
            view.insert("buffer".to_owned(), index.into());
            if start > 0 {
                view.insert("byteOffset".to_owned(), (offset + start as u64).into());
            }
            Ok(())
        };
        for view in self.list("bufferViews")? {
            lead(view)?;
            let extensions = view.get_mut("extensions").and_then(Value::as_object_mut);
            for (_, own) in
                extensions.into_iter().flatten().filter(|(name, _)| COMPRESSED.contains(&&***name))
            {
                lead(own.as_object_mut().ok_or_else(|| asset.invalid("has a view that is no object"))?)?;
            }
        }
        if let Some(buffers) = self.json.get_mut("buffers").and_then(Value::as_array_mut) {
            let old = std::mem::take(buffers);
            let (behind, joined): (Vec<_>, Vec<_>) =
                old.into_iter().enumerate().partition(|(i, _)| kept.contains(i));
            // The one that holds all keeps the members of the first, such as its name.
            let mut first = joined.into_iter().next().map_or_else(|| json!({}), |(_, buffer)| buffer);
            first.as_object_mut().map(|first| first.remove("uri"));
            *buffers = vec![first];
            buffers.extend(behind.into_iter().map(|(_, buffer)| buffer));
        }
        Ok(())
    }

    /// Puts pictures behind the buffers.
    fn images(&mut self) -> Result<(), MapError> {
        let asset = self.asset;
        for (i, image) in asset.document.images.iter().enumerate() {
            let Some(uri) = &image.uri else { continue };
            let file = resource(&asset.path, uri)?;
            let known = |(at, first, _): &&(usize, &[u8], &str)| {
                file.bytes.get(*at..).is_some_and(|bytes| bytes.starts_with(first))
            };
            let kind = KINDS.iter().find(known).map(|(_, _, kind)| *kind);
            let place = self.store(uri, &file.bytes)?;
            let views = self.json.as_object_mut().map(|root| root.entry("bufferViews").or_insert(json!([])));
            let views = views.and_then(Value::as_array_mut);
            let views = views.ok_or_else(|| asset.invalid("has `bufferViews` that is no list"))?;
            views.push(json!({ "buffer": 0, "byteOffset": place.start, "byteLength": place.len() }));
            let view = views.len() - 1;
            let mut images = self.list("images")?;
            let image = &mut images[i];
            image.remove("uri");
            image.insert("bufferView".to_owned(), view.into());
            if !image.contains_key("mimeType") {
                let reason = "is a picture of no kind that glTF knows";
                let kind = kind.ok_or_else(|| MapError::unsupported(&file.path, reason))?;
                image.insert("mimeType".to_owned(), kind.into());
            }
        }
        if self.bin.is_empty() {
            return Ok(());
        }
        let length = self.bin.len();
        let buffers = self.json.as_object_mut().map(|root| root.entry("buffers").or_insert(json!([{}])));
        let first = buffers.and_then(|buffers| buffers.get_mut(0)).and_then(Value::as_object_mut);
        let first = first.ok_or_else(|| asset.invalid("has `buffers` that is no list"))?;
        first.insert("byteLength".to_owned(), length.into());
        Ok(())
    }
}
