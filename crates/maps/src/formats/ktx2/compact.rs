//! Maps in integers: each channel in the range that its values fill.
//!
//! Ranges are known when the last row is baked. Until then rows lie in a plain file without a name, in single
//! precision; then each level is rounded row by row, layer after stored layer, so that a map need never be in
//! memory whole.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use ::ktx2::Format as VkFormat;
use ::ktx2::dfd::{Basic, Block};
use ndfmap_core::bake::{LevelSink, Place};
use ndfmap_core::compact::{Bits, Compact, Extent, Spread};
use ndfmap_core::grid::Size;
use ndfmap_core::pyramid::{Layout, Precision, Pyramid, level_sizes};

use super::{CompressedFile, Content, Front, KEY, NdfSink, Rows, WriteOptions, key_value, write_at};
use crate::atomic::AtomicFile;
use crate::header::{COMPACT_VERSION, Integers};
use crate::ndf_map::method_of;
use crate::{Header, MapError};

/// Vulkan's format of a stored layer.
pub(super) fn vk_format(bits: Bits) -> VkFormat {
    match bits {
        Bits::Eight => VkFormat::R8G8B8A8_UNORM,
        Bits::Ten => VkFormat::A2B10G10R10_UNORM_PACK32,
        Bits::Sixteen => VkFormat::R16G16B16A16_UNORM,
    }
}

/// Bytes of all stored layers of a level, for RGBA layers of floats.
pub(super) fn level_bytes(bits: Bits, layers: usize, size: Size) -> u64 {
    (bits.layers(layers) * size.area() * bits.texel_bytes()) as u64
}

/// Rows of floats, wherever they lie.
pub(super) trait FloatRows {
    /// Reads a row of a layer of a level, four floats a texel.
    fn read(&self, place: Place, row: &mut Vec<f32>) -> io::Result<()>;
}

impl FloatRows for Pyramid {
    fn read(&self, Place { level, layer, row: y }: Place, row: &mut Vec<f32>) -> io::Result<()> {
        let (size, texel) = (self.sizes()[level], self.precision().texel_bytes());
        let start = (layer * size.height + y) * size.width * texel;
        self.precision().unpack(&self.level_bytes(level)[start..start + size.width * texel], row);
        Ok(())
    }
}

/// Rows of a plain file.
struct Spooled {
    file: File,
    rows: Rows,
}

impl Spooled {
    /// Spread of all rows over their extent.
    fn spread(&self, extent: Extent) -> io::Result<Spread> {
        let (mut spread, mut floats) = (Spread::new(extent), Vec::new());
        for (level, (size, _)) in self.rows.levels.iter().enumerate() {
            for layer in 0..self.rows.layout.layers {
                for row in 0..size.height {
                    floats.clear();
                    self.read(Place { level, layer, row }, &mut floats)?;
                    spread.add(layer, &floats);
                }
            }
        }
        Ok(spread)
    }
}

impl FloatRows for Spooled {
    fn read(&self, place: Place, row: &mut Vec<f32>) -> io::Result<()> {
        let (size, start) = self.rows.levels[place.level];
        let layout = &self.rows.layout;
        let width = layout.layer_bytes(Size { height: 1, ..size });
        let offset = place.layer * layout.layer_bytes(size) + place.row * width;
        let mut file = &self.file;
        file.seek(SeekFrom::Start(start + offset as u64))?;
        let mut bytes = vec![0; width];
        file.read_exact(&mut bytes)?;
        layout.precision.unpack(&bytes, row);
        Ok(())
    }
}

/// A level in integers, read as bytes: layer after stored layer, row after row.
struct CompactLevel<'a> {
    compact: &'a Compact,
    from: &'a dyn FloatRows,
    level: usize,
    size: Size,
    /// Next stored layer and row.
    next: (usize, usize),
    /// Bytes of the row before it, and how many of them are read.
    ready: Vec<u8>,
    read: usize,
}

impl CompactLevel<'_> {
    /// Makes the bytes of the next row; false after the last.
    fn advance(&mut self) -> io::Result<bool> {
        let (layer, row) = self.next;
        let (bits, all) = (self.compact.bits(), self.compact.ranges().len());
        let channels: Vec<usize> = (layer * bits.channels()..all).take(bits.channels()).collect();
        if channels.is_empty() {
            return Ok(false);
        }
        // A channel and the rest of its lobe may lie in several layers of floats.
        let lobes = channels.iter().flat_map(|channel| self.compact.lobe_of(*channel));
        let mut needed: Vec<usize> = channels.iter().copied().chain(lobes).map(|c| c / 4).collect();
        needed.sort_unstable();
        needed.dedup();
        let mut floats = vec![Vec::new(); all / 4];
        for layer in needed {
            self.from.read(Place { level: self.level, layer, row }, &mut floats[layer])?;
        }
        (self.ready, self.read) = (Vec::with_capacity(self.size.width * bits.texel_bytes()), 0);
        for x in 0..self.size.width {
            let value = |channel: usize| floats[channel / 4][4 * x + channel % 4];
            // Channels beyond the last are full.
            let mut stored = [bits.most(); 4];
            for (stored, channel) in stored.iter_mut().zip(&channels) {
                *stored = self.compact.round(*channel, value);
            }
            bits.pack(&stored[..bits.channels()], &mut self.ready);
        }
        self.next = if row + 1 < self.size.height { (layer, row + 1) } else { (layer + 1, 0) };
        Ok(true)
    }
}

impl Read for CompactLevel<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.read == self.ready.len() && !self.advance()? {
            return Ok(0);
        }
        let count = buffer.len().min(self.ready.len() - self.read);
        buffer[..count].copy_from_slice(&self.ready[self.read..self.read + count]);
        self.read += count;
        Ok(count)
    }
}

/// Map to be written in integers.
pub(super) struct CompactMap<'a> {
    pub(super) header: &'a Header,
    pub(super) layout: Layout,
    pub(super) compact: &'a Compact,
    pub(super) rows: &'a dyn FloatRows,
}

impl CompactMap<'_> {
    /// Writes it, compressed by Zstandard or plain; returns the length of the file in bytes.
    pub(super) fn write(&self, mut file: AtomicFile, zstd: Option<i32>) -> Result<u64, MapError> {
        let path = file.target().to_owned();
        let (bits, sizes) = (self.compact.bits(), level_sizes(self.layout.size));
        let (basic, type_size) = Basic::from_format(vk_format(bits))
            .map_err(|e| MapError::unsupported(&path, format!("{e:?}")))?;
        let compact = Some(Integers::of(self.compact));
        let header = Header { version: COMPACT_VERSION, compact, ..self.header.clone() };
        let content = Content {
            format: Some(vk_format(bits)),
            type_size,
            descriptor: Block::Basic(basic).to_vec(),
            size: self.layout.size,
            layers: bits.layers(self.layout.layers),
            alignment: bits.texel_bytes() as u64,
            levels: sizes.iter().map(|size| level_bytes(bits, self.layout.layers, *size)).collect(),
            keys: key_value(KEY, &header.to_json()),
        };
        let level = |level: usize| CompactLevel {
            compact: self.compact,
            from: self.rows,
            level,
            size: sizes[level],
            next: (0, 0),
            ready: Vec::new(),
            read: 0,
        };
        if let Some(zstd) = zstd {
            return CompressedFile { file, content, zstd }.write(|at| Ok(level(at)));
        }
        let front = Front::new(&content, None, &content.levels);
        let io = |e| MapError::io(&path, e);
        write_at(file.file(), 0, &front.bytes).map_err(io)?;
        for (at, start) in front.levels.iter().enumerate() {
            file.file().seek(SeekFrom::Start(*start)).map_err(io)?;
            io::copy(&mut level(at), file.file()).map_err(io)?;
        }
        file.finish()?;
        Ok(front.length)
    }
}

/// Keeps rows of floats while they are being baked, and then writes them as integers.
pub(super) struct CompactSink {
    file: AtomicFile,
    spooled: Spooled,
    header: Header,
    bits: Bits,
    extent: Extent,
    zstd: Option<i32>,
}

impl CompactSink {
    /// Opens both files.
    pub(super) fn create(
        path: &Path,
        header: &Header,
        layout: Layout,
        (bits, options): (Bits, &WriteOptions),
    ) -> Result<Self, MapError> {
        let file = AtomicFile::create(path)?;
        let rows = Rows::new(layout, Front::plain(path, header, layout)?);
        let spooled = Spooled { file: file.scratch()?, rows };
        let (header, extent) = (header.clone(), Extent::new(layout.layers));
        Ok(Self { file, spooled, header, bits, extent, zstd: options.zstd })
    }
}

impl NdfSink for CompactSink {
    fn finish(self: Box<Self>) -> Result<u64, MapError> {
        let Self { file, spooled, header, bits, extent, zstd } = *self;
        let encoding = method_of(file.target(), &header)?.encoding();
        let layout = spooled.rows.layout;
        let mut compact = Compact::of_extent(bits, &extent, encoding);
        if compact.trims() {
            compact = compact.trimmed(&spooled.spread(extent).map_err(|e| MapError::io(file.target(), e))?);
        }
        CompactMap { header: &header, layout, compact: &compact, rows: &spooled }.write(file, zstd)
    }
}

impl LevelSink for CompactSink {
    type Error = MapError;

    fn write_rows(&mut self, place: Place, bytes: &[u8]) -> Result<(), MapError> {
        let mut values = Vec::new();
        self.spooled.rows.layout.precision.unpack(bytes, &mut values);
        self.extent.add(place.layer, &values);
        let written = self.spooled.rows.write(&self.spooled.file, place, bytes);
        written.map_err(|e| MapError::io(self.file.target(), e))
    }
}

/// Floats of a level, as its integers tell them: layer after layer.
pub(super) fn floats(compact: &Compact, size: Size, stored: &[u8]) -> Vec<u8> {
    let (bits, all, area) = (compact.bits(), compact.ranges().len(), size.area());
    let mut values = vec![0.0; all * area];
    for (layer, bytes) in stored.chunks_exact(area * bits.texel_bytes()).enumerate() {
        let channels = (layer * bits.channels()..all).take(bits.channels());
        let channels: Vec<usize> = channels.collect();
        for (i, texel) in bytes.chunks_exact(bits.texel_bytes()).enumerate() {
            for (channel, stored) in channels.iter().zip(bits.unpack(texel)) {
                values[(channel / 4 * area + i) * 4 + channel % 4] = compact.value(*channel, stored);
            }
        }
    }
    let mut bytes = Vec::new();
    Precision::Single.pack(&values, &mut bytes);
    bytes
}
