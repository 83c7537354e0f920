//! KTX2: the native container of maps, and a container of textures.
//!
//! A map is a 2-D array texture, one array layer per RGBA layer, full mip chain. The writer uses the `ktx2`
//! crate's serialisers and writes level 0 in bands while it is being baked, so a map need never be in memory
//! whole. `docs/formats.md` has the layout.

mod container;
mod picture;

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use ::ktx2::dfd::{Basic, Block};
use ::ktx2::{Format as VkFormat, Header as KtxHeader, Index, LevelIndex, MAGIC, SupercompressionScheme};
use ndfmap_core::bake::{LevelSink, Place};
use ndfmap_core::grid::Size;
use ndfmap_core::pyramid::{Layout, Precision, level_sizes};

pub(super) use self::container::Container;
use super::{ChannelLayout, Format, NdfSink, WriteOptions};
use crate::atomic::AtomicFile;
use crate::ndf_map::layout_of;
use crate::{Header, MapError, NdfMap};

pub(super) const FORMAT: Format = Format {
    name: "KTX2",
    extensions: &["ktx2"],
    magic: &[&MAGIC],
    read_ndf: Some(read_ndf),
    write_ndf: Some(write_ndf),
    open_sink: Some(|path, header, layout| Ok(Box::new(Ktx2Sink::create(path, header, layout)?))),
    ..Format::read_by(picture::read)
};

/// The key that holds our [`Header`].
const KEY: &str = "ndfmap";

fn vk_format(precision: Precision) -> VkFormat {
    match precision {
        Precision::Half => VkFormat::R16G16B16A16_SFLOAT,
        Precision::Single => VkFormat::R32G32B32A32_SFLOAT,
    }
}

/// Key and value in KTX2's form: length, key, NUL, value, NUL, padding to 4.
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

/// Front of a file: all but its levels, and the places of those.
struct Front {
    bytes: Vec<u8>,
    /// First byte of each level.
    levels: Vec<u64>,
    /// Length of the whole file.
    length: u64,
}

impl Front {
    /// Front for levels of these stored lengths, finest first.
    fn new(
        path: &Path,
        header: &Header,
        layout: Layout,
        scheme: Option<SupercompressionScheme>,
        stored: &[u64],
    ) -> Result<Self, MapError> {
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
        // Levels lie smallest first, each aligned to its texel where it is not compressed.
        let alignment = if scheme.is_none() { layout.precision.texel_bytes() as u64 } else { 1 };
        let mut end = (kvd_start + kvd.len()) as u64;
        let mut levels = vec![0; sizes.len()];
        for (start, length) in levels.iter_mut().zip(stored).rev() {
            *start = end.next_multiple_of(alignment);
            end = *start + length;
        }
        let ktx = KtxHeader {
            format: Some(format),
            type_size,
            pixel_width: layout.size.width as u32,
            pixel_height: layout.size.height as u32,
            pixel_depth: 0,
            layer_count: layout.layers as u32,
            face_count: 1,
            level_count: sizes.len() as u32,
            supercompression_scheme: scheme,
            index: Index {
                dfd_byte_offset: dfd_start as u32,
                dfd_byte_length: dfd.len() as u32,
                kvd_byte_offset: kvd_start as u32,
                kvd_byte_length: kvd.len() as u32,
                sgd_byte_offset: 0,
                sgd_byte_length: 0,
            },
        };
        let mut bytes = ktx.as_bytes().to_vec();
        for ((byte_offset, byte_length), size) in levels.iter().zip(stored).zip(&sizes) {
            let index = LevelIndex {
                byte_offset: *byte_offset,
                byte_length: *byte_length,
                uncompressed_byte_length: level_bytes(&layout, *size),
            };
            bytes.extend_from_slice(&index.as_bytes());
        }
        bytes.extend(dfd);
        bytes.extend(kvd);
        Ok(Self { bytes, levels, length: end })
    }
}

/// Bytes of all layers of a level.
fn level_bytes(layout: &Layout, size: Size) -> u64 {
    (layout.layer_bytes(size) * layout.layers) as u64
}

/// Writes a map, compressed or plain.
fn write_ndf(path: &Path, map: &NdfMap, options: &WriteOptions) -> Result<u64, MapError> {
    if options.channels != ChannelLayout::Native {
        return Err(MapError::unsupported(path, "the bumpslopes layout needs an output ending in .exr"));
    }
    if let Some(level) = options.zstd {
        return write_compressed(path, map, level);
    }
    let mut sink = Ktx2Sink::create(path, &map.header, map.pyramid.layout())?;
    let (sizes, layers) = (map.pyramid.sizes(), map.pyramid.layers());
    for level in 0..sizes.len() {
        let bytes = map.pyramid.level_bytes(level);
        for (layer, bytes) in bytes.chunks_exact(bytes.len() / layers).enumerate() {
            sink.write_rows(Place { level, layer, row: 0 }, bytes)?;
        }
    }
    sink.complete()
}

/// Writes a map with Zstandard supercompression, at a level from 1 (fast) to 22; returns the file's length.
///
/// At every compression level the bytes are the same for any number of threads: the library cuts its jobs by
/// size.
fn write_compressed(path: &Path, map: &NdfMap, level: i32) -> Result<u64, MapError> {
    let io = |e| MapError::io(path, e);
    let p = &map.pyramid;
    let layout = p.layout();
    let mut compressor = zstd::bulk::Compressor::new(level).map_err(io)?;
    compressor.multithread(rayon::current_num_threads().max(1) as u32).map_err(io)?;
    let compressed: Result<Vec<Vec<u8>>, _> =
        (0..p.sizes().len()).map(|level| compressor.compress(p.level_bytes(level))).collect();
    let compressed = compressed.map_err(io)?;
    let stored: Vec<u64> = compressed.iter().map(|c| c.len() as u64).collect();
    let scheme = Some(SupercompressionScheme::Zstandard);
    let front = Front::new(path, &map.header, layout, scheme, &stored)?;
    let mut file = AtomicFile::create(path)?;
    let mut write = |bytes: &[u8]| file.file().write_all(bytes).map_err(io);
    write(&front.bytes)?;
    compressed.iter().rev().try_for_each(|level| write(level))?;
    file.file().flush().map_err(io)?;
    file.finish()?;
    Ok(front.length)
}

/// Writes a KTX2 file while its levels are being baked.
#[derive(Debug)]
struct Ktx2Sink {
    file: AtomicFile,
    layout: Layout,
    /// Size and first byte of each level.
    levels: Vec<(Size, u64)>,
    length: u64,
}

impl Ktx2Sink {
    /// Opens the file and writes all but the levels.
    fn create(path: &Path, header: &Header, layout: Layout) -> Result<Self, MapError> {
        let sizes = level_sizes(layout.size);
        let stored: Vec<u64> = sizes.iter().map(|size| level_bytes(&layout, *size)).collect();
        let front = Front::new(path, header, layout, None, &stored)?;
        let levels = sizes.into_iter().zip(front.levels).collect();
        let mut sink = Self { file: AtomicFile::create(path)?, layout, levels, length: front.length };
        sink.write_at(0, &front.bytes)?;
        Ok(sink)
    }

    fn write_at(&mut self, offset: u64, bytes: &[u8]) -> Result<(), MapError> {
        let file = self.file.file();
        let written = file.seek(SeekFrom::Start(offset)).and_then(|_| file.write_all(bytes));
        written.map_err(|e| MapError::io(self.file.target(), e))
    }

    /// Gives the file its name; returns its length in bytes.
    fn complete(mut self) -> Result<u64, MapError> {
        let completed = self.file.file().flush();
        completed.map_err(|e| MapError::io(self.file.target(), e))?;
        self.file.finish()?;
        Ok(self.length)
    }
}

impl NdfSink for Ktx2Sink {
    fn finish(self: Box<Self>) -> Result<u64, MapError> {
        self.complete()
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

/// Reads a baked map; `None` where the file lacks our key.
fn read_ndf(path: &Path, bytes: &[u8]) -> Result<Option<NdfMap>, MapError> {
    let invalid = |reason: String| MapError::invalid(path, reason);
    let file = Container::new(path, bytes)?;
    let Some(text) = file.value(KEY)? else { return Ok(None) };
    let header = Header::from_json(path, text)?;
    file.is_compressed()?;
    let ktx = &file.header;
    let precision = match ktx.format {
        Some(VkFormat::R16G16B16A16_SFLOAT) => Precision::Half,
        Some(VkFormat::R32G32B32A32_SFLOAT) => Precision::Single,
        other => {
            return Err(MapError::unsupported(
                path,
                format!("has texels of {other:?}; a baked map is of RGBA16F or RGBA32F"),
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
    let levels = sizes.iter().enumerate();
    let levels = levels.map(|(level, size)| Ok(file.level(level, level_bytes(&layout, *size))?.into_owned()));
    NdfMap::assemble(path, header, precision, levels.collect::<Result<_, MapError>>()?).map(Some)
}
