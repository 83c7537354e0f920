//! KTX2, the native container: a 2-D array texture, one array layer per RGBA layer, full mip chain.
//!
//! Written over the `ktx2` crate's serialisers, level 0 in bands while it is being baked, so a map need
//! never be in memory whole. Read by hand from its header, level index and key/value data: the crate's
//! `Reader` panics on a hostile data format descriptor, which we do not need. `docs/formats.md` has the layout.

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use ::ktx2::dfd::{Basic, Block};
use ::ktx2::{Format as VkFormat, Header as KtxHeader, Index, KeyValueDataIterator, LevelIndex, MAGIC};
use ndfmap_core::bake::{LevelSink, Place};
use ndfmap_core::grid::Size;
use ndfmap_core::pyramid::{Layout, Precision, level_sizes};

use super::Format;
use crate::atomic::AtomicFile;
use crate::ndf_map::layout_of;
use crate::{Header, MapError, NdfMap};

pub(super) const FORMAT: Format = Format {
    name: "KTX2",
    extensions: &["ktx2"],
    magic: &[&MAGIC],
    read_image: None,
    read_ndf: Some(read_ndf),
};

/// The key that holds our [`Header`].
const KEY: &str = "ndfmap";

fn vk_format(precision: Precision) -> VkFormat {
    match precision {
        Precision::Half => VkFormat::R16G16B16A16_SFLOAT,
        Precision::Single => VkFormat::R32G32B32A32_SFLOAT,
    }
}

/// Key and value as KTX2 stores them: length, key, NUL, value, NUL, padding to 4.
fn key_value(key: &str, value: &str) -> Vec<u8> {
    let length = key.len() + value.len() + 2;
    let mut entry = u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes().to_vec();
    for text in [key, value] {
        entry.extend_from_slice(text.as_bytes());
        entry.push(0);
    }
    entry.resize(entry.len().next_multiple_of(4), 0);
    entry
}

/// Writes a KTX2 file while its levels are being baked.
#[derive(Debug)]
pub struct Ktx2Sink {
    file: AtomicFile,
    layout: Layout,
    /// Size and first byte of each level.
    levels: Vec<(Size, u64)>,
    length: u64,
}

impl Ktx2Sink {
    /// Opens the file and writes all but the levels.
    ///
    /// # Errors
    /// [`MapError`] when the file cannot be written.
    pub fn create(path: &Path, header: &Header, layout: Layout) -> Result<Self, MapError> {
        let sizes = level_sizes(layout.size);
        let format = vk_format(layout.precision);
        let (basic, type_size) =
            Basic::from_format(format).map_err(|e| MapError::unsupported(path, format!("{e:?}")))?;
        let block = Block::Basic(basic).to_vec();
        let mut dfd = (block.len() as u32 + 4).to_le_bytes().to_vec();
        dfd.extend_from_slice(&block);
        // Keys in the order of their bytes, as the specification asks.
        let mut kvd = key_value("KTXorientation", "rd");
        kvd.extend(key_value("KTXwriter", concat!("ndfmap ", env!("CARGO_PKG_VERSION"))));
        kvd.extend(key_value(KEY, &header.to_json()));
        let dfd_start = KtxHeader::LENGTH + sizes.len() * LevelIndex::LENGTH;
        let kvd_start = dfd_start + dfd.len();
        // Levels lie smallest first, each aligned to its texel.
        let mut end = (kvd_start + kvd.len()) as u64;
        let mut levels = Vec::with_capacity(sizes.len());
        for size in sizes.iter().rev() {
            let start = end.next_multiple_of(layout.precision.texel_bytes() as u64);
            levels.push((*size, start));
            end = start + (layout.layer_bytes(*size) * layout.layers) as u64;
        }
        levels.reverse();
        let ktx = KtxHeader {
            format: Some(format),
            type_size,
            pixel_width: layout.size.width as u32,
            pixel_height: layout.size.height as u32,
            pixel_depth: 0,
            layer_count: layout.layers as u32,
            face_count: 1,
            level_count: sizes.len() as u32,
            supercompression_scheme: None,
            index: Index {
                dfd_byte_offset: dfd_start as u32,
                dfd_byte_length: dfd.len() as u32,
                kvd_byte_offset: kvd_start as u32,
                kvd_byte_length: kvd.len() as u32,
                sgd_byte_offset: 0,
                sgd_byte_length: 0,
            },
        };
        let mut start = ktx.as_bytes().to_vec();
        for (size, byte_offset) in &levels {
            let byte_length = (layout.layer_bytes(*size) * layout.layers) as u64;
            let index =
                LevelIndex { byte_offset: *byte_offset, byte_length, uncompressed_byte_length: byte_length };
            start.extend_from_slice(&index.as_bytes());
        }
        start.extend(dfd);
        start.extend(kvd);
        let mut sink = Self { file: AtomicFile::create(path)?, layout, levels, length: end };
        sink.write_at(0, &start)?;
        Ok(sink)
    }

    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<(), MapError> {
        let file = self.file.file();
        let written = file.seek(SeekFrom::Start(offset)).and_then(|_| file.write_all(bytes));
        written.map_err(|e| MapError::io(self.file.target(), e))
    }

    /// Gives the file its name; returns its length in bytes.
    ///
    /// # Errors
    /// [`MapError`] when it cannot be completed.
    pub fn finish(mut self) -> Result<u64, MapError> {
        let completed = self.file.file().flush();
        completed.map_err(|e| MapError::io(self.file.target(), e))?;
        self.file.finish()?;
        Ok(self.length)
    }
}

impl LevelSink for Ktx2Sink {
    type Error = MapError;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), MapError> {
        let (size, start) = self.levels[place.level];
        let row = self.layout.layer_bytes(Size { height: 1, ..size });
        let offset = place.layer * self.layout.layer_bytes(size) + place.row * row;
        self.write_at(start + offset as u64, bytes)
    }
}

/// Reads a baked map; a sound KTX2 file without our key is an error that says so.
fn read_ndf(path: &Path, bytes: &[u8]) -> Result<Option<NdfMap>, MapError> {
    let invalid = |reason: String| MapError::invalid(path, reason);
    let truncated = || MapError::invalid(path, "is truncated: its KTX2 header points beyond its end");
    let start: &[u8; KtxHeader::LENGTH] = bytes.first_chunk().ok_or_else(truncated)?;
    let ktx = KtxHeader::from_bytes(start).map_err(|e| invalid(format!("has a bad KTX2 header: {e:?}")))?;
    let slice = |offset: u64, length: u64| {
        let end = offset.checked_add(length)?;
        bytes.get(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)
    };
    let kvd =
        slice(ktx.index.kvd_byte_offset.into(), ktx.index.kvd_byte_length.into()).ok_or_else(truncated)?;
    let text = KeyValueDataIterator::new(kvd).find(|(key, _)| *key == KEY).map(|(_, value)| value);
    let Some(text) = text else {
        return Err(MapError::unsupported(
            path,
            format!("is a KTX2 file without the key `{KEY}`: not a normal distribution map"),
        ));
    };
    let text =
        std::str::from_utf8(text).map_err(|e| invalid(format!("has a key `{KEY}` that is no text: {e}")))?;
    let header = Header::from_json(path, text.trim_end_matches('\0'))?;
    if let Some(scheme) = ktx.supercompression_scheme {
        return Err(MapError::unsupported(
            path,
            format!("is supercompressed ({scheme:?}); plain KTX2 is read"),
        ));
    }
    let precision = match ktx.format {
        Some(VkFormat::R16G16B16A16_SFLOAT) => Precision::Half,
        Some(VkFormat::R32G32B32A32_SFLOAT) => Precision::Single,
        other => {
            return Err(MapError::unsupported(
                path,
                format!("has texels of {other:?}; RGBA16F and RGBA32F are read"),
            ));
        }
    };
    let layout = layout_of(path, &header, precision)?;
    let sizes = level_sizes(layout.size);
    let claims = [
        ("width", ktx.pixel_width as usize, layout.size.width),
        ("height", ktx.pixel_height as usize, layout.size.height),
        ("depth", ktx.pixel_depth as usize, 0),
        ("layer count", ktx.layer_count as usize, layout.layers),
        ("face count", ktx.face_count as usize, 1),
        ("level count", ktx.level_count as usize, sizes.len()),
    ];
    for (what, found, expected) in claims {
        if found != expected {
            return Err(invalid(format!("has a {what} of {found}; its key `{KEY}` says {expected}")));
        }
    }
    let mut levels = Vec::with_capacity(sizes.len());
    for (level, size) in sizes.iter().enumerate() {
        let at = (KtxHeader::LENGTH + level * LevelIndex::LENGTH) as u64;
        let index: &[u8; LevelIndex::LENGTH] =
            slice(at, LevelIndex::LENGTH as u64).and_then(|s| s.first_chunk()).ok_or_else(truncated)?;
        let index = LevelIndex::from_bytes(index);
        let expected = (layout.layer_bytes(*size) * layout.layers) as u64;
        if index.byte_length != expected {
            return Err(invalid(format!(
                "has {} bytes in level {level}, where {expected} are due",
                index.byte_length
            )));
        }
        levels.push(slice(index.byte_offset, expected).ok_or_else(truncated)?.to_vec());
    }
    NdfMap::assemble(path, header, precision, levels).map(Some)
}
