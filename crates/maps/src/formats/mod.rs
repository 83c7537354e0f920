//! File formats: one file each, and the table of them.
//!
//! The first bytes of a file tell its format, not its name; only TGA has no such bytes and goes by name.
//! Every reader gets the whole file in memory (so nothing is larger than the file itself allows) and
//! checks sizes before it allocates for them.

#[cfg(feature = "basis")]
mod basis;
mod blocks;
mod dds;
mod decoded;
mod etc;
pub mod exr;
mod hdr;
mod jpeg;
pub mod ktx2;
pub mod png;
mod texels;
mod tga;
#[cfg(feature = "tiff")]
mod tiff;
mod uastc;
#[cfg(feature = "webp")]
mod webp;

use std::path::Path;

use ndfmap_core::bake::LevelSink;
use ndfmap_core::compact::Bits;
use ndfmap_core::grid::Size;
use ndfmap_core::pyramid::{Layout, Precision};
use ndfmap_core::words;
use ndfmap_scene::metrics::Picture;

use crate::model::is_model;
use crate::{Header, Image, MapError, NdfMap};

/// Reads a picture from a whole file.
pub type ReadImage = fn(&Path, &[u8]) -> Result<Image, MapError>;

/// Reads a normal distribution map from a whole file; `None` when the file is a plain picture.
pub type ReadNdf = fn(&Path, &[u8]) -> Result<Option<NdfMap>, MapError>;

/// Writes a normal distribution map to a file, whole or not at all; returns the file's length in bytes.
pub type WriteNdf = fn(&Path, &NdfMap, &WriteOptions) -> Result<u64, MapError>;

/// Opens a file that a map is baked into, row by row.
pub type OpenSink = fn(&Path, &Header, Layout, &WriteOptions) -> Result<Box<dyn NdfSink>, MapError>;

/// Bytes of a picture's file, or the failure of the encoder.
pub type EncodedPicture = Result<Vec<u8>, String>;

/// Writer of rendered pictures: what it takes is what a file of the format holds.
#[derive(Clone, Copy)]
pub enum WritePicture {
    /// Display values, 8 bits of sRGB, in rows.
    Display(fn(&[[u8; 3]], Size) -> EncodedPicture),
    /// Linear light.
    Linear(fn(&Picture) -> EncodedPicture),
}

/// File that a map is being baked into. Nothing of it is left when it is dropped unfinished.
pub trait NdfSink: LevelSink<Error = MapError> {
    /// Completes the file, which may mean to compress it, and gives it its name; returns its length in bytes.
    ///
    /// # Errors
    /// [`MapError`] when it cannot be completed.
    fn finish(self: Box<Self>) -> Result<u64, MapError>;
}

/// Channels that a map is written with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChannelLayout {
    /// Our RGBA layers.
    #[default]
    Native,
    /// OpenImageIO's six `bumpslopes` channels, of the method `slopes` in an OpenEXR file.
    Bumpslopes,
}

words!(ChannelLayout { Native => "native", Bumpslopes => "bumpslopes" });

/// Choices in writing a map; the default is the plain form of every format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// Level of Zstandard, from 1 (fast) to 22, for KTX2; an OpenEXR has compression of its own.
    pub zstd: Option<i32>,
    /// Channels of an OpenEXR.
    pub channels: ChannelLayout,
    /// Bits of channels as integers, each in the range that its values fill, for KTX2; `None` for floats.
    /// Maps are then baked in single precision.
    pub compact: Option<Bits>,
    /// Precision of bumpslopes, whose units differ from the map's; `None` for the map's own.
    pub precision: Option<Precision>,
}

/// A row of [`TABLE`].
pub struct Format {
    /// Name for messages.
    pub name: &'static str,
    /// Extensions, lower case; the first is the usual one.
    pub extensions: &'static [&'static str],
    /// Signatures, the first bytes of such files; empty for a format without any.
    pub magic: &'static [&'static [u8]],
    /// Reads a picture.
    pub read_image: ReadImage,
    /// Reads a normal distribution map; `None` inside when the file is a plain picture.
    pub read_ndf: Option<ReadNdf>,
    /// Writes a normal distribution map.
    pub write_ndf: Option<WriteNdf>,
    /// Opens a file to bake into.
    pub open_sink: Option<OpenSink>,
    /// True where a map's channels may be integers.
    pub integers: bool,
    /// Writes a rendered picture.
    pub write_picture: Option<WritePicture>,
}

impl Format {
    /// Row of a format whose pictures this function reads, and that nothing is written in.
    const fn read_by(read_image: ReadImage) -> Self {
        Self {
            name: "",
            extensions: &[],
            magic: &[],
            read_image,
            read_ndf: None,
            write_ndf: None,
            open_sink: None,
            integers: false,
            write_picture: None,
        }
    }
}

/// Every format that the crate was built with.
pub static TABLE: &[Format] = &[
    png::FORMAT,
    jpeg::FORMAT,
    #[cfg(feature = "tiff")]
    tiff::FORMAT,
    exr::FORMAT,
    hdr::FORMAT,
    ktx2::FORMAT,
    dds::FORMAT,
    #[cfg(feature = "basis")]
    basis::FORMAT,
    #[cfg(feature = "webp")]
    webp::FORMAT,
    tga::FORMAT,
];

/// Format of a file, by its first bytes, else by its name.
///
/// # Errors
/// [`MapError`] for a file of no known format.
pub fn detect(path: &Path, bytes: &[u8]) -> Result<&'static Format, MapError> {
    let by_magic = TABLE.iter().find(|f| f.magic.iter().any(|m| bytes.starts_with(m)));
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let by_name = || TABLE.iter().find(|f| f.magic.is_empty() && f.extensions.contains(&extension.as_str()));
    if let Some(format) = by_magic.or_else(by_name) {
        return Ok(format);
    }
    if bytes.is_empty() {
        return Err(MapError::invalid(path, "is empty"));
    }
    let names: Vec<&str> = TABLE.iter().map(|f| f.name).collect();
    let reason = match TABLE.iter().find(|f| f.extensions.contains(&extension.as_str())) {
        Some(format) => format!("does not begin like a {} file", format.name),
        None if is_model(path) => {
            "is a model: `render --scene` draws it, and `inspect` describes it".to_owned()
        }
        None => format!("is of no known format; known are {}", names.join(", ")),
    };
    Err(MapError::invalid(path, reason))
}

/// True for a name that pictures have.
#[must_use]
pub fn is_picture(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    TABLE.iter().any(|format| format.extensions.contains(&extension.as_str()))
}

/// Format to write a map in, by the file's name.
///
/// # Errors
/// [`MapError`] for a name of no format that maps are written in.
pub fn to_write(path: &Path) -> Result<&'static Format, MapError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let written = || TABLE.iter().filter(|f| f.write_ndf.is_some());
    written().find(|f| f.extensions.contains(&extension.as_str())).ok_or_else(|| {
        let names: Vec<String> = written().map(|f| format!(".{}", f.extensions[0])).collect();
        MapError::unsupported(path, format!("maps are written as {}", names.join(" or ")))
    })
}

/// Refuses integers in a format that has none.
///
/// # Errors
/// [`MapError`] that names the file.
pub fn check_integers(path: &Path, format: &Format, options: &WriteOptions) -> Result<(), MapError> {
    match options.compact {
        Some(bits) if !format.integers => {
            let reason = format!("channels of {bits} are for KTX2; {} holds floats", format.name);
            Err(MapError::unsupported(path, reason))
        }
        _ => Ok(()),
    }
}

/// Writer of the format that a picture's name asks for by its usual extension.
///
/// # Errors
/// [`MapError`] for a name of no format that pictures are written in.
pub fn picture_writer(path: &Path) -> Result<WritePicture, MapError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let writers = || TABLE.iter().filter_map(|f| Some((f.extensions[0], f.write_picture?)));
    writers().find(|(usual, _)| *usual == extension).map(|(_, writer)| writer).ok_or_else(|| {
        let names: Vec<String> = writers().map(|(usual, _)| format!(".{usual}")).collect();
        MapError::unsupported(path, format!("pictures are written as {}", names.join(" or ")))
    })
}

/// Bytes of a file; a folder or a missing file is an error that says so.
///
/// # Errors
/// [`MapError`] from the operating system.
pub fn read_file(path: &Path) -> Result<Vec<u8>, MapError> {
    if path.is_dir() {
        return Err(MapError::invalid(path, "is a folder, not a file"));
    }
    std::fs::read(path).map_err(|e| MapError::io(path, e))
}

/// Reads a baked map; `None` when the file is sound but holds a plain picture.
///
/// # Errors
/// [`MapError`] when the file is damaged.
pub fn read_ndf(path: &Path, bytes: &[u8]) -> Result<Option<NdfMap>, MapError> {
    match detect(path, bytes)?.read_ndf {
        Some(read) => read(path, bytes),
        None => Ok(None),
    }
}

/// Reads the picture of a layer, of a part, or of one channel, by its name; only OpenEXR has such.
///
/// # Errors
/// [`MapError`], as of a picture, and where there is no such layer.
pub fn read_image_layer(path: &Path, bytes: &[u8], layer: &str) -> Result<Image, MapError> {
    if detect(path, bytes)?.name != exr::FORMAT.name {
        return Err(MapError::unsupported(path, "has no layers: they are OpenEXR's"));
    }
    exr::read_layer(path, bytes, Some(layer))
}

/// Reads a picture.
///
/// # Errors
/// [`MapError`] when the file is damaged or holds no picture.
pub fn read_image(path: &Path, bytes: &[u8]) -> Result<Image, MapError> {
    let format = detect(path, bytes)?;
    // Failed assertions of a decoder are caught: the fault is the file's, which may be hostile, or its own.
    let read = std::panic::AssertUnwindSafe(|| (format.read_image)(path, bytes));
    std::panic::catch_unwind(read).unwrap_or_else(|_| {
        let reason = format!("is damaged in a way that the {} reader cannot handle", format.name);
        Err(MapError::invalid(path, reason))
    })
}
