//! Files of maps: KTX2 whose layers are sums of lobes, and a header in JSON under the key `ndfmap`.

use std::io::Read as _;

use ktx2::{Format, Reader, SupercompressionScheme};
use serde::Deserialize;

/// Lobes at most, as many as shaders have room for.
pub(crate) const MOST_LOBES: usize = 8;

/// Side at most, in texels: what devices take.
const MOST_TEXELS: u32 = 1 << 14;

/// Layers at most: lobes, and fifteen attributes of each.
const MOST_LAYERS: u32 = 16 * MOST_LOBES as u32;

/// Levels at most that a file may leave out.
const MOST_LEFT_OUT: u32 = 14;

/// Reason why a file is no map that can be shown.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The container is damaged, or no KTX2.
    #[error("is no sound KTX2 ({0:?})")]
    Container(ktx2::ParseError),
    /// A sound KTX2 of something else.
    #[error("is a KTX2 of another kind: it lacks the key `ndfmap` of a baked map")]
    Foreign,
    /// The header in JSON is damaged.
    #[error("has a key `ndfmap` that cannot be read ({0})")]
    Header(serde_json::Error),
    /// The file is newer than this loader.
    #[error("has header version {0}; this loader reads up to 2")]
    Version(u32),
    /// Another method baked the map.
    #[error("was baked by `{0}`; lobes of `vmf:1` to `vmf:8` are read")]
    Method(String),
    /// Texels of a kind that not every device filters.
    #[error("has texels of a kind that is not read: bake it with --precision unorm8 or half")]
    Texels,
    /// Ranges are missing, not finite, or the wrong way round.
    #[error("has no sound range for each channel")]
    Ranges,
    /// Layers or levels are too few or too many.
    #[error("has {found} {what}, where {due} are due")]
    Count {
        /// Layers or levels.
        what: &'static str,
        /// Number that the file has.
        found: u32,
        /// Number that it should have: of layers, at least so many.
        due: u32,
    },
    /// The file leaves out more levels than a map has.
    #[error("leaves out {0} levels")]
    LeftOut(u32),
    /// A side is 0, or longer than any texture.
    #[error("is {width} by {height} texels")]
    Size {
        /// Width that the file tells.
        width: u32,
        /// Height that the file tells.
        height: u32,
    },
    /// A level is damaged.
    #[error("has a damaged level {level}: {reason}")]
    Level {
        /// Level of the file.
        level: usize,
        /// Reason in words.
        reason: String,
    },
}

/// A way of going on beyond the map's edge.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Wrap {
    Repeat,
    Clamp,
}

/// Range of one channel's integers.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Range(pub f32, pub f32);

#[derive(Deserialize)]
struct Integers {
    bits: u32,
    ranges: Vec<Range>,
}

#[derive(Deserialize)]
struct Header {
    version: u32,
    method: String,
    encoding: String,
    wrap: [Wrap; 2],
    compact: Option<Integers>,
    #[serde(default)]
    from_level: u32,
}

/// Map as its file holds it.
pub(crate) struct File {
    /// Texels of the finest level that the file holds.
    pub size: [u32; 2],
    /// Lobes, each a layer.
    pub lobes: usize,
    /// Bytes of each level, layer after layer.
    pub levels: Vec<Vec<u8>>,
    /// Range of each channel, four a lobe; `None` for half floats.
    pub ranges: Option<Vec<Range>>,
    /// Ways of going on along u and v.
    pub wrap: [Wrap; 2],
    /// Levels that the file leaves out.
    pub from_level: u32,
}

impl File {
    /// Reads a file.
    ///
    /// # Errors
    /// [`FileError`] when the bytes are no map of lobes in 8 bits or half floats.
    pub fn read(bytes: &[u8]) -> Result<Self, FileError> {
        let file = Reader::new(bytes).map_err(FileError::Container)?;
        let (_, text) = file.key_value_data().find(|(key, _)| *key == "ndfmap").ok_or(FileError::Foreign)?;
        let text = text.strip_suffix(&[0]).unwrap_or(text);
        let header: Header = serde_json::from_slice(text).map_err(FileError::Header)?;
        if header.version > 2 {
            return Err(FileError::Version(header.version));
        }
        let lobes = lobes_of(&header).ok_or_else(|| FileError::Method(header.method.clone()))?;
        let told = file.header();
        let due = if header.compact.is_some() { Format::R8G8B8A8_UNORM } else { Format::R16G16B16A16_SFLOAT };
        if told.format != Some(due) || header.compact.as_ref().is_some_and(|compact| compact.bits != 8) {
            return Err(FileError::Texels);
        }
        let ranges = header.compact.map(|compact| compact.ranges);
        if ranges.as_ref().is_some_and(|ranges| !are_sound(ranges, lobes)) {
            return Err(FileError::Ranges);
        }
        let (width, height) = (told.pixel_width, told.pixel_height);
        if ![width, height].iter().all(|side| (1..=MOST_TEXELS).contains(side)) {
            return Err(FileError::Size { width, height });
        }
        if !(lobes as u32..=MOST_LAYERS).contains(&told.layer_count) {
            let (found, due) = (told.layer_count, lobes as u32);
            return Err(FileError::Count { what: "layers", found, due });
        }
        let compressed = match told.supercompression_scheme {
            None => false,
            Some(SupercompressionScheme::Zstandard) => true,
            Some(_) => return Err(FileError::Texels),
        };
        let (wrap, from_level) = (header.wrap, header.from_level);
        if from_level > MOST_LEFT_OUT {
            return Err(FileError::LeftOut(from_level));
        }
        let (found, due) = (file.levels().len() as u32, u32::BITS - width.max(height).leading_zeros());
        if found != due {
            return Err(FileError::Count { what: "levels", found, due });
        }
        let texel = if ranges.is_some() { 4 } else { 8 };
        let layers = told.layer_count as usize;
        let levels = file.levels().enumerate().map(|(level, stored)| {
            let side = |side: u32| (side >> level).max(1) as usize;
            let layer = side(width) * side(height) * texel;
            let damaged = |reason: String| FileError::Level { level, reason };
            let due = |found: usize| damaged(format!("{found} bytes, where {} are due", layer * layers));
            // Before anything is unpacked: what the file says of itself.
            let told = if compressed { stored.uncompressed_byte_length } else { stored.data.len() as u64 };
            if told != (layer * layers) as u64 {
                return Err(due(told as usize));
            }
            let mut bytes = Vec::new();
            // Lobes come first, attributes behind them, which are not wanted.
            let wanted = layer * lobes;
            if compressed {
                let decoder = ruzstd::decoding::StreamingDecoder::new(stored.data);
                let decoder = decoder.map_err(|e| damaged(e.to_string()))?;
                decoder.take(wanted as u64).read_to_end(&mut bytes).map_err(|e| damaged(e.to_string()))?;
            } else {
                bytes.extend_from_slice(&stored.data[..wanted]);
            }
            if bytes.len() != wanted {
                return Err(due(bytes.len()));
            }
            Ok(bytes)
        });
        let levels = levels.collect::<Result<Vec<_>, _>>()?;
        Ok(Self { size: [width, height], lobes, levels, ranges, wrap, from_level })
    }
}

/// Number of lobes of a header's method, `None` for methods that are not read.
fn lobes_of(header: &Header) -> Option<usize> {
    let rest = header.method.strip_prefix("vmf:")?;
    let lobes = rest.split(':').next()?.parse().ok()?;
    ((1..=MOST_LOBES).contains(&lobes) && header.encoding == "sums-about-pole").then_some(lobes)
}

fn are_sound(ranges: &[Range], lobes: usize) -> bool {
    ranges.len() >= 4 * lobes
        && ranges.iter().all(|Range(low, high)| low.is_finite() && high.is_finite() && low <= high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// KTX2 of four by two texels, one level after the other, without compression.
    fn ktx2(format: u32, layers: u32, header: &str, levels: &[usize]) -> Vec<u8> {
        let key: Vec<u8> = [b"ndfmap\0", header.as_bytes(), b"\0"].concat();
        let entry = [&(key.len() as u32).to_le_bytes()[..], &key].concat();
        let padded = entry.len().next_multiple_of(4);
        let descriptor = 4 + 24 + 16;
        let keys_at = 80 + 24 * levels.len() + descriptor;
        let mut at = (keys_at + padded).next_multiple_of(16);
        let word = |v: usize| (v as u32).to_le_bytes();
        let mut bytes = ktx2::MAGIC.to_vec();
        for value in [format, 1, 4, 2, 0, layers, 1, levels.len() as u32, 0] {
            bytes.extend(value.to_le_bytes());
        }
        let descriptor_at = 80 + 24 * levels.len();
        [descriptor_at, descriptor, keys_at, padded, 0, 0, 0, 0]
            .map(word)
            .iter()
            .for_each(|w| bytes.extend(w));
        for length in levels {
            for value in [at, *length, *length] {
                bytes.extend((value as u64).to_le_bytes());
            }
            at += length.next_multiple_of(16);
        }
        // A descriptor of one sample, as far as readers look.
        bytes.extend(word(descriptor));
        bytes.extend([0; 4]);
        bytes.extend(2_u16.to_le_bytes());
        bytes.extend(40_u16.to_le_bytes());
        bytes.extend([1, 1, 1, 0, 0, 0, 0, 0, 4, 0, 0, 0, 0, 0, 0, 0]);
        bytes.extend([0; 16]);
        bytes.extend(entry);
        bytes.resize(at.max(bytes.len()), 7);
        bytes
    }

    const HEADER: &str = r#"{"version":2,"method":"vmf:1","encoding":"sums-about-pole","wrap":["repeat","clamp"],
        "from_level":1,"compact":{"bits":8,"ranges":[[0,1],[-1,1],[-1,1],[0,0.5]]}}"#;

    /// Vulkan's number of RGBA8.
    const BYTES: u32 = 37;

    fn reason(bytes: &[u8]) -> String {
        File::read(bytes).err().map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn a_map_is_read_without_its_attributes() {
        let file = File::read(&ktx2(BYTES, 2, HEADER, &[64, 16, 8])).expect("a map");
        assert_eq!((file.size, file.lobes, file.from_level), ([4, 2], 1, 1));
        assert_eq!(file.wrap, [Wrap::Repeat, Wrap::Clamp]);
        assert_eq!(file.levels.iter().map(Vec::len).collect::<Vec<_>>(), [32, 8, 4]);
        assert_eq!(file.ranges.expect("ranges")[3].1, 0.5);
    }

    #[test]
    fn what_is_no_map_is_told() {
        let changed = |from: &str, to: &str| reason(&ktx2(BYTES, 2, &HEADER.replace(from, to), &[64, 16, 8]));
        let mut foreign = ktx2(BYTES, 2, HEADER, &[64, 16, 8]);
        let key = foreign.windows(7).position(|bytes| bytes == b"ndfmap\0").expect("the key");
        foreign[key] = b'x';
        assert!(reason(b"nothing").contains("no sound KTX2"));
        assert!(reason(&foreign).contains("another kind"));
        assert!(changed("{", "[").contains("cannot be read"));
        assert!(changed(":2,", ":3,").contains("version 3"));
        assert!(changed("vmf:1", "vmf:9").contains("baked by `vmf:9`"));
        assert!(changed("vmf:1", "gmm:4").contains("baked by `gmm:4`"));
        assert!(changed("vmf:1", "vmf:4").contains("no sound range"));
        assert!(changed("[0,1]", "[2,1]").contains("no sound range"));
        assert!(changed("\"from_level\":1", "\"from_level\":15").contains("leaves out 15 levels"));
        assert!(changed("\"bits\":8", "\"bits\":10").contains("kind that is not read"));
        assert!(reason(&ktx2(97, 2, HEADER, &[64, 16, 8])).contains("kind that is not read"));
        assert!(reason(&ktx2(BYTES, 2, HEADER, &[64, 16])).contains("2 levels, where 3 are due"));
        assert!(reason(&ktx2(BYTES, 2, HEADER, &[4; 40])).contains("40 levels, where 3 are due"));
        assert!(reason(&ktx2(BYTES, 0, HEADER, &[64, 16, 8])).contains("0 layers"));
        assert!(reason(&ktx2(BYTES, u32::MAX, HEADER, &[64, 16, 8])).contains("4294967295 layers"));
        assert!(reason(&ktx2(BYTES, 2, HEADER, &[60, 16, 8])).contains("damaged level 0"));
    }

    #[test]
    fn damaged_files_do_not_panic() {
        let whole = ktx2(BYTES, 2, HEADER, &[64, 16, 8]);
        for end in 0..whole.len() {
            let _ = File::read(&whole[..end]);
        }
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut bytes = whole.clone();
                bytes[at] ^= 1 << bit;
                let _ = File::read(&bytes);
            }
        }
    }
}
