//! KTX2: the native container of maps, and a container of textures.
//!
//! A map is a 2-D array texture, one array layer per RGBA layer, full mip chain. The writer uses the `ktx2`
//! crate's serialisers and takes rows while they are being baked, so a map need never be in memory whole.
//! Zstandard needs a level in its order, layer by layer, where a bake makes all layers of a band at once:
//! rows lie in a plain file without a name until they are compressed. `docs/formats.md` has the layout.

mod compact;
mod container;
mod picture;
mod texture;

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

use ::ktx2::dfd::{Basic, Block};
use ::ktx2::{Format as VkFormat, Header as KtxHeader, Index, LevelIndex, MAGIC, SupercompressionScheme};
use ndfmap_core::bake::{LevelSink, Place};
use ndfmap_core::compact::Compact;
use ndfmap_core::grid::Size;
use ndfmap_core::pyramid::{Layout, Precision, level_sizes};

use self::compact::{CompactMap, CompactSink};
pub(super) use self::container::Container;
pub use self::texture::{Texture, TextureEncoding};
#[cfg(feature = "basis")]
pub use self::texture::{Transcoded, transcode};
use super::{ChannelLayout, Format, NdfSink, WriteOptions};
use crate::atomic::AtomicFile;
use crate::ndf_map::{layout_of, method_of};
use crate::{Header, MapError, NdfMap};

pub(super) const FORMAT: Format = Format {
    name: "KTX2",
    extensions: &["ktx2"],
    magic: &[&MAGIC],
    read_ndf: Some(read_ndf),
    write_ndf: Some(write_ndf),
    open_sink: Some(open_sink),
    integers: true,
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

/// Content of a file, as its header tells it.
#[derive(Debug)]
struct Content {
    /// Vulkan's format; `None` for Basis Universal.
    format: Option<VkFormat>,
    type_size: u32,
    /// The one block of the data format descriptor.
    descriptor: Vec<u8>,
    size: Size,
    /// Layers of an array, 0 for a texture that is none.
    layers: usize,
    /// Bytes that plain levels are aligned to.
    alignment: u64,
    /// Bytes of each level, finest first.
    levels: Vec<u64>,
    /// Keys of our own, after the usual ones.
    keys: Vec<u8>,
}

impl Content {
    /// Content of a map.
    fn of_map(path: &Path, header: &Header, layout: Layout) -> Result<Self, MapError> {
        let format = vk_format(layout.precision);
        let (basic, type_size) =
            Basic::from_format(format).map_err(|e| MapError::unsupported(path, format!("{e:?}")))?;
        Ok(Self {
            format: Some(format),
            type_size,
            descriptor: Block::Basic(basic).to_vec(),
            size: layout.size,
            layers: layout.layers,
            alignment: layout.precision.texel_bytes() as u64,
            levels: level_sizes(layout.size).iter().map(|size| level_bytes(&layout, *size)).collect(),
            keys: key_value(KEY, &header.to_json()),
        })
    }
}

impl Front {
    /// Front for levels of these stored lengths, finest first.
    fn new(content: &Content, scheme: Option<SupercompressionScheme>, stored: &[u64]) -> Self {
        let mut dfd = (content.descriptor.len() as u32 + 4).to_le_bytes().to_vec();
        dfd.extend_from_slice(&content.descriptor);
        // Keys in the order of their bytes, as the specification asks. There is always one: PlayCanvas waits
        // for ever for a file without.
        let mut kvd = key_value("KTXorientation", "rd");
        kvd.extend(key_value("KTXwriter", concat!("ndfmap ", env!("CARGO_PKG_VERSION"))));
        kvd.extend_from_slice(&content.keys);
        let count = content.levels.len();
        let dfd_start = KtxHeader::LENGTH + count * LevelIndex::LENGTH;
        let kvd_start = dfd_start + dfd.len();
        // Levels lie smallest first, each aligned to its texel where it is not compressed.
        let alignment = if scheme.is_none() { content.alignment } else { 1 };
        let mut end = (kvd_start + kvd.len()) as u64;
        let mut levels = vec![0; count];
        for (start, length) in levels.iter_mut().zip(stored).rev() {
            *start = end.next_multiple_of(alignment);
            end = *start + length;
        }
        let ktx = KtxHeader {
            format: content.format,
            type_size: content.type_size,
            pixel_width: content.size.width as u32,
            pixel_height: content.size.height as u32,
            pixel_depth: 0,
            layer_count: content.layers as u32,
            face_count: 1,
            level_count: count as u32,
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
        for ((byte_offset, byte_length), whole) in levels.iter().zip(stored).zip(&content.levels) {
            let index = LevelIndex {
                byte_offset: *byte_offset,
                byte_length: *byte_length,
                uncompressed_byte_length: *whole,
            };
            bytes.extend_from_slice(&index.as_bytes());
        }
        bytes.extend(dfd);
        bytes.extend(kvd);
        Self { bytes, levels, length: end }
    }

    /// Front of a file that is not compressed.
    fn plain(path: &Path, header: &Header, layout: Layout) -> Result<Self, MapError> {
        let content = Content::of_map(path, header, layout)?;
        Ok(Self::new(&content, None, &content.levels))
    }
}

/// Bytes of all layers of a level.
fn level_bytes(layout: &Layout, size: Size) -> u64 {
    (layout.layer_bytes(size) * layout.layers) as u64
}

/// Refuses channels that are not our own.
fn check_channels(path: &Path, options: &WriteOptions) -> Result<(), MapError> {
    if options.channels == ChannelLayout::Native {
        return Ok(());
    }
    Err(MapError::unsupported(path, "the bumpslopes layout needs an output ending in .exr"))
}

/// Opens a file to bake into, compressed or plain.
fn open_sink(
    path: &Path,
    header: &Header,
    layout: Layout,
    options: &WriteOptions,
) -> Result<Box<dyn NdfSink>, MapError> {
    check_channels(path, options)?;
    if let Some(bits) = options.compact {
        return Ok(Box::new(CompactSink::create(path, header, layout, (bits, options))?));
    }
    Ok(match options.zstd {
        None => Box::new(PlainSink::create(path, header, layout)?),
        Some(zstd) => {
            let content = Content::of_map(path, header, layout)?;
            Box::new(ZstdSink::create(CompressedFile::create(path, content, zstd)?, layout)?)
        }
    })
}

/// Writes a map, compressed or plain.
fn write_ndf(path: &Path, map: &NdfMap, options: &WriteOptions) -> Result<u64, MapError> {
    check_channels(path, options)?;
    let (p, layout) = (&map.pyramid, map.pyramid.layout());
    if let Some(bits) = options.compact {
        // Integers that were read go back as they were.
        let own = map.compact(path)?.filter(|own| own.bits() == bits);
        let compact = match own {
            Some(own) => own,
            None => Compact::of(bits, p, map.method(path)?.encoding()),
        };
        let written = CompactMap { header: &map.header, layout, compact: &compact, rows: p };
        return written.write(AtomicFile::create(path)?, options.zstd);
    }
    if let Some(zstd) = options.zstd {
        let file = CompressedFile::create(path, Content::of_map(path, &map.header, layout)?, zstd)?;
        return file.write(|level| Ok(p.level_bytes(level)));
    }
    let mut sink = PlainSink::create(path, &map.header, layout)?;
    for level in 0..p.sizes().len() {
        let bytes = p.level_bytes(level);
        for (layer, bytes) in bytes.chunks_exact(bytes.len() / layout.layers).enumerate() {
            sink.write_rows(Place { level, layer, row: 0 }, bytes)?;
        }
    }
    sink.complete()
}

fn write_at(mut file: &File, offset: u64, bytes: &[u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(offset))?;
    file.write_all(bytes)
}

/// Places of rows in a plain file.
#[derive(Debug)]
struct Rows {
    layout: Layout,
    /// Size and first byte of each level.
    levels: Vec<(Size, u64)>,
}

impl Rows {
    fn new(layout: Layout, front: Front) -> Self {
        Self { layout, levels: level_sizes(layout.size).into_iter().zip(front.levels).collect() }
    }

    fn write(&self, file: &File, place: Place, bytes: &[u8]) -> io::Result<()> {
        let (size, start) = self.levels[place.level];
        let row = self.layout.layer_bytes(Size { height: 1, ..size });
        let offset = place.layer * self.layout.layer_bytes(size) + place.row * row;
        write_at(file, start + offset as u64, bytes)
    }

    /// Reader of a level, from its first byte to its last.
    fn read<'a>(&self, mut file: &'a File, level: usize) -> io::Result<impl Read + use<'a>> {
        let (size, start) = self.levels[level];
        file.seek(SeekFrom::Start(start))?;
        let capacity = zstd::Encoder::<File>::recommended_input_size();
        Ok(BufReader::with_capacity(capacity, file.take(level_bytes(&self.layout, size))))
    }
}

/// Writes a plain file while its levels are being baked.
#[derive(Debug)]
struct PlainSink {
    file: AtomicFile,
    rows: Rows,
    length: u64,
}

impl PlainSink {
    /// Opens the file and writes all but the levels.
    fn create(path: &Path, header: &Header, layout: Layout) -> Result<Self, MapError> {
        let front = Front::plain(path, header, layout)?;
        let mut file = AtomicFile::create(path)?;
        write_at(file.file(), 0, &front.bytes).map_err(|e| MapError::io(path, e))?;
        Ok(Self { file, length: front.length, rows: Rows::new(layout, front) })
    }

    /// Gives the file its name; returns its length in bytes.
    fn complete(self) -> Result<u64, MapError> {
        self.file.finish()?;
        Ok(self.length)
    }
}

impl NdfSink for PlainSink {
    fn finish(self: Box<Self>) -> Result<u64, MapError> {
        self.complete()
    }
}

impl LevelSink for PlainSink {
    type Error = MapError;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), MapError> {
        let written = self.rows.write(self.file.file(), place, bytes);
        written.map_err(|e| MapError::io(self.file.target(), e))
    }
}

/// Keeps rows in a plain file without a name while they are being baked, and then compresses them.
#[derive(Debug)]
struct ZstdSink {
    plain: File,
    rows: Rows,
    file: CompressedFile,
}

impl ZstdSink {
    fn create(file: CompressedFile, layout: Layout) -> Result<Self, MapError> {
        let front = Front::new(&file.content, None, &file.content.levels);
        Ok(Self { plain: file.file.scratch()?, rows: Rows::new(layout, front), file })
    }
}

impl NdfSink for ZstdSink {
    fn finish(self: Box<Self>) -> Result<u64, MapError> {
        let Self { plain, rows, file } = *self;
        file.write(|level| rows.read(&plain, level))
    }
}

impl LevelSink for ZstdSink {
    type Error = MapError;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), MapError> {
        let written = self.rows.write(&self.plain, place, bytes);
        written.map_err(|e| MapError::io(self.file.file.target(), e))
    }
}

/// A file with Zstandard supercompression that is to be written.
#[derive(Debug)]
struct CompressedFile {
    file: AtomicFile,
    content: Content,
    /// Level of compression, from 1 (fast) to 22.
    zstd: i32,
}

impl CompressedFile {
    fn create(path: &Path, content: Content, zstd: i32) -> Result<Self, MapError> {
        Ok(Self { file: AtomicFile::create(path)?, content, zstd })
    }

    /// Compresses what `read` gives for each level, and names the file; returns its length in bytes.
    fn write<R: Read>(mut self, read: impl Fn(usize) -> io::Result<R>) -> Result<u64, MapError> {
        let path = self.file.target().to_owned();
        let io = |e| MapError::io(&path, e);
        let scheme = Some(SupercompressionScheme::Zstandard);
        let front = |stored: &[u64]| Front::new(&self.content, scheme, stored);
        let mut stored = vec![0; self.content.levels.len()];
        // A front is as long whatever it says; what the levels take is known after them.
        let start = front(&stored).bytes.len() as u64;
        let mut file: &File = self.file.file();
        file.seek(SeekFrom::Start(start)).map_err(io)?;
        for (level, length) in self.content.levels.iter().enumerate().rev() {
            let bytes = read(level).map_err(io)?;
            stored[level] = deflate(bytes, *length, self.zstd, file).map_err(io)?;
        }
        let front = front(&stored);
        write_at(file, 0, &front.bytes).map_err(io)?;
        self.file.finish()?;
        Ok(front.length)
    }
}

/// Writes a level of so many bytes where `file` stands, as one Zstandard frame; returns the frame's length.
///
/// The specification allows several frames ("Scheme Notes"), but some readers ask the first for the length of
/// all. At every level of compression the bytes are the same for any number of threads, and however they are
/// read: the library cuts its jobs and blocks by size. What is in memory is jobs, a few more than threads, of
/// 8 MiB each at level 3.
fn deflate(mut level: impl Read, length: u64, zstd: i32, mut file: &File) -> io::Result<u64> {
    let start = file.stream_position()?;
    let mut encoder = zstd::Encoder::new(file, zstd)?;
    encoder.multithread(rayon::current_num_threads().max(1) as u32)?;
    encoder.set_pledged_src_size(Some(length))?;
    io::copy(&mut level, &mut encoder)?;
    encoder.finish()?;
    Ok(file.stream_position()? - start)
}

/// Reads a baked map; `None` where the file lacks our key.
fn read_ndf(path: &Path, bytes: &[u8]) -> Result<Option<NdfMap>, MapError> {
    let invalid = |reason: String| MapError::invalid(path, reason);
    let file = Container::new(path, bytes)?;
    let Some(text) = file.value(KEY)? else { return Ok(None) };
    let header = Header::from_json(path, text)?;
    file.is_compressed()?;
    let ktx = &file.header;
    let precision =
        if ktx.format == Some(VkFormat::R16G16B16A16_SFLOAT) { Precision::Half } else { Precision::Single };
    let layout = layout_of(path, &header, precision)?;
    let encoding = method_of(path, &header)?.encoding();
    let compact =
        header.compact.as_ref().map(|own| own.compact(path, encoding, layout.layers)).transpose()?;
    let due = match &compact {
        Some(compact) => compact::vk_format(compact.bits()),
        None => vk_format(precision),
    };
    if ktx.format != Some(due) {
        let reason = match &compact {
            Some(_) => format!("has texels of {:?}, where its key `{KEY}` says {due:?}", ktx.format),
            None => format!("has texels of {:?}; a baked map is of RGBA16F or RGBA32F", ktx.format),
        };
        return Err(MapError::unsupported(path, reason));
    }
    let sizes = level_sizes(layout.size);
    let claims = [
        ("width", ktx.pixel_width as usize, layout.size.width),
        ("height", ktx.pixel_height as usize, layout.size.height),
        ("depth", ktx.pixel_depth as usize, 0),
        (
            "layer count",
            ktx.layer_count as usize,
            compact.as_ref().map_or(layout.layers, |compact| compact.bits().layers(layout.layers)),
        ),
        ("face count", ktx.face_count as usize, 1),
        ("level count", ktx.level_count as usize, sizes.len()),
    ];
    for (what, found, expected) in claims {
        if found != expected {
            return Err(invalid(format!("has a {what} of {found}; its key `{KEY}` says {expected}")));
        }
    }
    let levels = sizes.iter().enumerate();
    let levels = levels.map(|(level, size)| match &compact {
        None => Ok(file.level(level, level_bytes(&layout, *size))?.into_owned()),
        Some(form) => {
            let stored = file.level(level, compact::level_bytes(form.bits(), layout.layers, *size))?;
            Ok(compact::floats(form, *size, &stored))
        }
    });
    NdfMap::assemble(path, header, precision, levels.collect::<Result<_, MapError>>()?).map(Some)
}
