//! Small files of every format, made in memory.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::io::Cursor;

use ndfmap_core::bake::Bake;
use ndfmap_core::grid::Size;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::procedural;
use ndfmap_core::pyramid::Precision;
use ndfmap_maps::source::{SourceOptions, read_source};
use ndfmap_maps::{Header, NdfMap, VERSION};

pub(crate) const WIDTH: usize = 12;
pub(crate) const HEIGHT: usize = 7;

/// Bytes of a smooth 8-bit RGB normal map.
pub(crate) fn rgb8() -> Vec<u8> {
    let texel = |i: usize| {
        let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
        let n = glam::Vec3::new(0.3 * (0.5 * x).sin(), 0.2 * (0.9 * y).cos(), 1.0).normalize();
        n.to_array().map(|c| ((c + 1.0) * 127.5).round() as u8)
    };
    (0..WIDTH * HEIGHT).flat_map(texel).collect()
}

pub(crate) fn png(color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, WIDTH as u32, HEIGHT as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    bytes
}

pub(crate) fn with_image_crate(format: image::ImageFormat) -> Vec<u8> {
    let picture = image::RgbImage::from_vec(WIDTH as u32, HEIGHT as u32, rgb8()).unwrap();
    let mut bytes = Cursor::new(Vec::new());
    let picture = image::DynamicImage::from(picture);
    let picture = if format == image::ImageFormat::Hdr { picture.to_rgb32f().into() } else { picture };
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

pub(crate) fn tiff<C: tiff::encoder::colortype::ColorType>(data: &[C::Inner]) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
    encoder.write_image::<C>(WIDTH as u32, HEIGHT as u32, data).unwrap();
    bytes.into_inner()
}

pub(crate) fn exr() -> Vec<u8> {
    use exr::prelude::*;
    let data = rgb8();
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let i = (at.1 * WIDTH + at.0) * 3;
        let c = |k: usize| f32::from(data[i + k]) / 127.5 - 1.0;
        (c(0), c(1), c(2))
    });
    let mut bytes = Cursor::new(Vec::new());
    Image::from_channels((WIDTH, HEIGHT), channels).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Every picture format: file name and bytes of a normal map.
pub(crate) fn pictures() -> Vec<(&'static str, Vec<u8>)> {
    use tiff::encoder::colortype::{RGB8, RGB16, RGB32Float};
    let eight = rgb8();
    let sixteen: Vec<u16> = eight.iter().map(|c| u16::from(*c) * 257).collect();
    let sixteen_bytes: Vec<u8> = sixteen.iter().flat_map(|c| c.to_be_bytes()).collect();
    let floats: Vec<f32> = eight.iter().map(|c| f32::from(*c) / 127.5 - 1.0).collect();
    let rgba: Vec<u8> = eight.chunks(3).flat_map(|c| [c[0], c[1], c[2], 77]).collect();
    vec![
        ("rgb8.png", png(png::ColorType::Rgb, png::BitDepth::Eight, &eight)),
        ("rgba8.png", png(png::ColorType::Rgba, png::BitDepth::Eight, &rgba)),
        ("rgb16.png", png(png::ColorType::Rgb, png::BitDepth::Sixteen, &sixteen_bytes)),
        ("map.jpg", with_image_crate(image::ImageFormat::Jpeg)),
        ("map.tga", with_image_crate(image::ImageFormat::Tga)),
        ("map.hdr", with_image_crate(image::ImageFormat::Hdr)),
        ("rgb8.tif", tiff::<RGB8>(&eight)),
        ("rgb16.tif", tiff::<RGB16>(&sixteen)),
        ("float.tif", tiff::<RGB32Float>(&floats)),
        ("map.exr", exr()),
    ]
}

/// A baked map of the built-in foil or, for heights, armour.
pub(crate) fn baked(method: &str, builtin: &str, precision: Precision) -> NdfMap {
    baked_at(Size { width: 21, height: 13 }, method, builtin, precision)
}

/// The same at any size.
pub(crate) fn baked_at(size: Size, method: &str, builtin: &str, precision: Precision) -> NdfMap {
    let options = SourceOptions { builtin_size: size, ..Default::default() };
    let map = read_source(format!("builtin:{builtin}").as_ref(), &options).unwrap();
    assert!(procedural::find(builtin).is_some());
    let method = method.parse::<AnyMethod>().unwrap();
    let bake = Bake::new(&*map.surface, &*method).precision(precision);
    let header = Header {
        version: VERSION,
        method: method.to_string(),
        width: size.width,
        height: size.height,
        wrap: Header::spell_wraps(map.surface.wraps()),
        encoding: method.encoding().name().to_owned(),
        attributes: Vec::new(),
        source: map.source,
    };
    NdfMap { header, pyramid: bake.to_pyramid().unwrap().0 }
}
