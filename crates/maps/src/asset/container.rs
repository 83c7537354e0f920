//! Containers of glTF: JSON alone, or the chunks of the binary form, every one kept as it is.

use std::path::Path;

use crate::MapError;

/// First bytes of the binary form, and the kinds of its chunks (glTF 2.0, 4.4).
const MAGIC: &[u8] = b"glTF";
const JSON: [u8; 4] = *b"JSON";
const BIN: [u8; 4] = *b"BIN\0";

/// Lengths of the header of a file and of a chunk.
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// File of glTF 2.0 in its parts.
#[derive(Clone, Debug)]
pub(super) struct Container {
    /// The document's text.
    pub(super) json: String,
    /// Parts of the binary form besides its JSON; `None` for a file of JSON alone.
    pub(super) binary: Option<Binary>,
}

/// Parts of the binary form.
#[derive(Clone, Debug, Default)]
pub(super) struct Binary {
    chunks: Vec<Chunk>,
    /// Bytes after the length that the file gives itself: exporters leave some.
    trailing: Vec<u8>,
}

#[derive(Clone, Debug)]
struct Chunk {
    kind: [u8; 4],
    bytes: Vec<u8>,
}

impl Container {
    /// Takes a file apart.
    ///
    /// # Errors
    /// [`MapError`] for a damaged file, and for glTF 1.0.
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self, MapError> {
        let invalid = |reason: &str| MapError::invalid(path, reason);
        let text = |bytes: &[u8]| {
            String::from_utf8(bytes.to_vec()).map_err(|_| invalid("has JSON that is no UTF-8 text"))
        };
        if !bytes.starts_with(MAGIC) {
            return Ok(Self { json: text(bytes)?, binary: None });
        }
        let word = |at: usize| -> Option<u32> {
            bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
        };
        let truncated = || invalid("is truncated within its glTF header");
        match word(4).ok_or_else(truncated)? {
            2 => {}
            1 => return Err(MapError::unsupported(path, crate::model::OLD_GLTF)),
            other => return Err(MapError::unsupported(path, format!("is glTF {other}; glTF 2.0 is read"))),
        }
        let length = word(8).ok_or_else(truncated)? as usize;
        if length > bytes.len() || length < HEADER {
            let reason = format!("is truncated: it has {} of the {length} bytes of its header", bytes.len());
            return Err(MapError::invalid(path, reason));
        }
        let mut chunks = Vec::new();
        let mut at = HEADER;
        while at < length {
            let end = |size: u32| (at + CHUNK_HEADER).checked_add(size as usize).filter(|end| *end <= length);
            let end = word(at).filter(|_| at + CHUNK_HEADER <= length).and_then(end);
            let end = end.ok_or_else(|| invalid("has a chunk that goes on beyond its end"))?;
            let kind = bytes[at + 4..at + CHUNK_HEADER].first_chunk().copied().unwrap_or_default();
            chunks.push(Chunk { kind, bytes: bytes[at + CHUNK_HEADER..end].to_vec() });
            at = end;
        }
        if chunks.first().is_none_or(|chunk| chunk.kind != JSON) {
            return Err(invalid("does not begin with a chunk of JSON"));
        }
        let json = text(&chunks.remove(0).bytes)?;
        Ok(Self { json, binary: Some(Binary { chunks, trailing: bytes[length..].to_vec() }) })
    }

    /// Bytes of the binary chunk, where there is one.
    pub(super) fn bin(&self) -> Option<&[u8]> {
        self.binary.as_ref()?.chunks.iter().find(|chunk| chunk.kind == BIN).map(|chunk| &chunk.bytes[..])
    }

    /// Puts the file together, perhaps with bytes after those of its binary chunk.
    ///
    /// # Errors
    /// [`MapError`] for more bytes than the binary form can hold.
    pub(super) fn write(&self, path: &Path, json: &str, appended: &[u8]) -> Result<Vec<u8>, MapError> {
        let Some(Binary { chunks, trailing }) = &self.binary else { return Ok(json.as_bytes().to_vec()) };
        let mut bytes = [MAGIC, &2_u32.to_le_bytes(), &[0; 4]].concat();
        let too_large = || MapError::unsupported(path, "would be larger than the 4 GiB of a binary glTF");
        let mut push = |kind: [u8; 4], parts: [&[u8]; 2], filler: u8| {
            let length: usize = parts.iter().map(|part| part.len()).sum();
            let padded = u32::try_from(length.next_multiple_of(4)).map_err(|_| too_large())?;
            bytes.extend(padded.to_le_bytes());
            bytes.extend(kind);
            parts.iter().for_each(|part| bytes.extend_from_slice(part));
            bytes.resize(bytes.len() + padded as usize - length, filler);
            Ok(())
        };
        push(JSON, [json.as_bytes(), &[]], b' ')?;
        if self.bin().is_none() && !appended.is_empty() {
            push(BIN, [appended, &[]], 0)?;
        }
        for chunk in chunks {
            push(chunk.kind, [&chunk.bytes, if chunk.kind == BIN { appended } else { &[] }], 0)?;
        }
        let length = u32::try_from(bytes.len()).map_err(|_| too_large())?;
        bytes[8..HEADER].copy_from_slice(&length.to_le_bytes());
        bytes.extend_from_slice(trailing);
        Ok(bytes)
    }
}
