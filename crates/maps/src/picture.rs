//! Rendered pictures as files: linear light in OpenEXR, display values in PNG.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{Encoding, Image as ExrImage, LineOrder, SpecificChannels, WritableImage};
use glam::Vec3;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_scene::metrics::{Picture, display};

use crate::{MapError, atomic};

/// Formats that pictures are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Display values in 8-bit sRGB.
    Png,
    /// 32-bit floats of linear RGB.
    Exr,
}

impl PictureFormat {
    /// Format that a file's name asks for; `None` for one that is not written.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_string_lossy().to_lowercase().as_str() {
            "png" => Some(Self::Png),
            "exr" => Some(Self::Exr),
            _ => None,
        }
    }
}

/// Display values in 8 bits.
#[must_use]
pub fn to_bytes(picture: &Picture, exposure: f32) -> Grid<[u8; 3]> {
    let size = picture.size();
    let byte = |v: f32| (v * 255.0).round() as u8;
    Grid::from_fn(size, |x, y| display(picture.row(y)[x], exposure).to_array().map(byte))
}

/// An 8-bit RGB picture as a PNG file in memory.
///
/// # Errors
/// Failure of the encoder, as text.
pub fn png_bytes(pixels: &[[u8; 3]], size: Size) -> Result<Vec<u8>, String> {
    let encode = || {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size.width as u32, size.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    };
    encode().map_err(|e: png::EncodingError| e.to_string())
}

/// Writes a picture in the format that the file's name asks for; the exposure is PNG's.
///
/// # Errors
/// [`MapError`] when the name asks for another format, or the file cannot be written.
pub fn write_picture(path: &Path, picture: &Picture, exposure: f32) -> Result<(), MapError> {
    let size = picture.size();
    let bytes = match PictureFormat::of(path) {
        Some(PictureFormat::Png) => {
            png_bytes(to_bytes(picture, exposure).texels(), size).map_err(|e| MapError::invalid(path, e))?
        }
        Some(PictureFormat::Exr) => {
            let channels = SpecificChannels::rgb(|p: exr::math::Vec2<usize>| {
                let Vec3 { x, y, z } = picture.row(p.y())[p.x()];
                (x, y, z)
            });
            let layer = exr::image::Layer::new(
                (size.width, size.height),
                exr::meta::header::LayerAttributes::default(),
                // In any other order, blocks lie in the file as threads finish them.
                Encoding { line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS },
                channels,
            );
            let mut bytes = Cursor::new(Vec::new());
            ExrImage::from_layer(layer)
                .write()
                .to_buffered(&mut bytes)
                .map_err(|e| MapError::invalid(path, e))?;
            bytes.into_inner()
        }
        None => return Err(MapError::unsupported(path, "pictures are written as .png or .exr")),
    };
    atomic::write(path, &bytes)
}
