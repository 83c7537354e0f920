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

/// DDS file without compression, blue first.
pub(crate) fn dds() -> Vec<u8> {
    let mut header = [0_u32; 32];
    header[0] = u32::from_le_bytes(*b"DDS ");
    (header[1], header[3], header[4]) = (124, HEIGHT as u32, WIDTH as u32);
    // Pixel format: its size, RGB, bits, masks.
    (header[19], header[20], header[22]) = (32, 0x40, 24);
    header[23..26].copy_from_slice(&[0xFF_0000, 0xFF00, 0xFF]);
    let mut bytes: Vec<u8> = header.iter().flat_map(|word| word.to_le_bytes()).collect();
    bytes.extend(rgb8().chunks(3).flat_map(|c| [c[2], c[1], c[0]]));
    bytes
}

/// KTX2 file of plain RGB, without a data format descriptor.
pub(crate) fn ktx2() -> Vec<u8> {
    let header = ktx2::Header {
        format: Some(ktx2::Format::R8G8B8_UNORM),
        type_size: 1,
        pixel_width: WIDTH as u32,
        pixel_height: HEIGHT as u32,
        pixel_depth: 0,
        layer_count: 0,
        face_count: 1,
        level_count: 1,
        supercompression_scheme: None,
        index: ktx2::Index {
            dfd_byte_offset: 0,
            dfd_byte_length: 0,
            kvd_byte_offset: 0,
            kvd_byte_length: 0,
            sgd_byte_offset: 0,
            sgd_byte_length: 0,
        },
    };
    let texels = rgb8();
    let (byte_offset, byte_length) = (104, texels.len() as u64);
    let level = ktx2::LevelIndex { byte_offset, byte_length, uncompressed_byte_length: byte_length };
    [&header.as_bytes(), &level.as_bytes() as &[u8], &texels].concat()
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
        ("map.dds", dds()),
        ("rgb8.ktx2", ktx2()),
        ("map.webp", with_image_crate(image::ImageFormat::WebP)),
        ("map.basis", include_bytes!("../cases/map.basis").to_vec()),
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
        compact: None,
        from_level: 0,
    };
    NdfMap { header, pyramid: bake.to_pyramid().unwrap().0 }
}
