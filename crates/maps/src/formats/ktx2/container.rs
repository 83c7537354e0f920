//! The container of KTX2: header, keys and levels, taken by hand. The `ktx2` crate's own `Reader` panics on a
//! hostile data format descriptor.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use ::ktx2::{Header as KtxHeader, KeyValueDataIterator, LevelIndex, SupercompressionScheme};

use crate::MapError;

/// Most bytes that a byte of Zstandard can stand for: a block of 128 KiB of one value takes four.
const MOST_PER_BYTE: u64 = 32_768;

/// A whole file whose header is read. Offsets are checked when they are followed.
pub(in crate::formats) struct Container<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    pub(in crate::formats) header: KtxHeader,
}

impl<'a> Container<'a> {
    pub(in crate::formats) fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self, MapError> {
        let start: &[u8; KtxHeader::LENGTH] = bytes.first_chunk().ok_or_else(|| truncated(path))?;
        let header = KtxHeader::from_bytes(start)
            .map_err(|e| MapError::invalid(path, format!("has a bad KTX2 header: {e:?}")))?;
        Ok(Self { path, bytes, header })
    }

    fn slice(&self, offset: u64, length: u64) -> Result<&'a [u8], MapError> {
        let end = offset.checked_add(length);
        let place = || Some(usize::try_from(offset).ok()?..usize::try_from(end?).ok()?);
        place().and_then(|place| self.bytes.get(place)).ok_or_else(|| truncated(self.path))
    }

    /// Value of a key, without the NULs that end a text.
    pub(in crate::formats) fn value(&self, key: &str) -> Result<Option<&'a str>, MapError> {
        let index = &self.header.index;
        let pairs = self.slice(index.kvd_byte_offset.into(), index.kvd_byte_length.into())?;
        let Some((_, value)) = KeyValueDataIterator::new(pairs).find(|(found, _)| *found == key) else {
            return Ok(None);
        };
        let text = std::str::from_utf8(value)
            .map_err(|e| MapError::invalid(self.path, format!("has a key `{key}` that is no text: {e}")))?;
        Ok(Some(text.trim_end_matches('\0')))
    }

    /// The data format descriptor.
    #[cfg(feature = "basis")]
    pub(in crate::formats) fn descriptor(&self) -> Result<&'a [u8], MapError> {
        let index = &self.header.index;
        self.slice(index.dfd_byte_offset.into(), index.dfd_byte_length.into())
    }

    /// True where levels are compressed by Zstandard, false where they are plain.
    ///
    /// # Errors
    /// [`MapError`] for any other compression.
    pub(in crate::formats) fn is_compressed(&self) -> Result<bool, MapError> {
        match self.header.supercompression_scheme {
            None => Ok(false),
            Some(SupercompressionScheme::Zstandard) => Ok(true),
            Some(other) => {
                let reason = format!("is supercompressed ({other:?}); plain KTX2 and Zstandard are read");
                Err(MapError::unsupported(self.path, reason))
            }
        }
    }

    /// All bytes of a level, `expected` in number, decompressed.
    ///
    /// # Errors
    /// [`MapError`] for a level that is damaged or of another length.
    pub(in crate::formats) fn level(&self, level: usize, expected: u64) -> Result<Cow<'a, [u8]>, MapError> {
        let invalid = |reason: String| MapError::invalid(self.path, reason);
        let at = (KtxHeader::LENGTH + level * LevelIndex::LENGTH) as u64;
        let index = self.slice(at, LevelIndex::LENGTH as u64)?;
        let index: &[u8; LevelIndex::LENGTH] = index.first_chunk().ok_or_else(|| truncated(self.path))?;
        let index = LevelIndex::from_bytes(index);
        let compressed = self.is_compressed()?;
        let claimed = if compressed { index.uncompressed_byte_length } else { index.byte_length };
        if claimed != expected {
            return Err(invalid(format!("has {claimed} bytes in level {level}, where {expected} are due")));
        }
        let stored = self.slice(index.byte_offset, index.byte_length)?;
        if !compressed {
            return Ok(stored.into());
        }
        let bytes = inflate(stored, expected);
        Ok(bytes.map_err(|why| invalid(format!("has a damaged level {level}: {why}")))?.into())
    }
}

fn truncated(path: &Path) -> MapError {
    MapError::invalid(path, "is truncated: its KTX2 header points beyond its end")
}

/// Decompresses a level that must be `expected` bytes long; memory grows only as bytes come out.
fn inflate(stored: &[u8], expected: u64) -> Result<Vec<u8>, String> {
    if expected / MOST_PER_BYTE > stored.len() as u64 {
        return Err(format!("{} bytes cannot hold {expected}", stored.len()));
    }
    let decoder = zstd::Decoder::new(stored).map_err(|e| e.to_string())?;
    let mut bytes = Vec::new();
    decoder.take(expected + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    if bytes.len() as u64 == expected { Ok(bytes) } else { Err(format!("it does not hold {expected} bytes")) }
}
