//! Pictures as people have them, each of which stands for a kind that went wrong once. The right value of
//! each is known: it is that of the numbers which the picture was made of.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::{Path, PathBuf};

use glam::Vec3;
use ndfmap_core::surface::{Surface, SurfaceRow};
use ndfmap_maps::SourceKind;
use ndfmap_maps::formats::read_image;
use ndfmap_maps::source::{Convention, SourceMap, SourceOptions, read_source, source_of_image};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn read_with(name: &str, options: &SourceOptions) -> SourceMap {
    read_source(&case(name), options).unwrap_or_else(|e| panic!("{e}"))
}

fn read(name: &str) -> SourceMap {
    read_with(name, &SourceOptions::default())
}

fn row(surface: &dyn Surface, y: usize) -> SurfaceRow {
    let mut row = SurfaceRow::flat(surface.size().width);
    surface.read_row(y, &mut row);
    row
}

fn warns(map: &SourceMap, of: &str) -> bool {
    map.warnings.iter().any(|warning| warning.contains(of))
}

#[test]
fn normals_are_those_that_the_picture_was_made_of() {
    // Codes of 8 bits move a vector by 2/255 at most; floats by nothing.
    let byte = Vec3::new(218.0, 128.0, 218.0) / 127.5 - 1.0;
    let cases = [
        // Channels in a layer, and in no other.
        ("b02_layer_normal.exr", Vec3::new(-0.6, 0.0, 0.8), 1e-3),
        // Components of which none is negative.
        ("b05_signed_flat.exr", Vec3::Z, 1e-6),
        // Values from 0 to 1, and one that is a little below.
        ("b06_one_negative.exr", Vec3::new(0.6, 0.0, 0.8), 1e-3),
        ("b17_planar.tif", byte.normalize(), 1e-6),
        ("b19_palette.tif", byte.normalize(), 1e-6),
        ("b28_trailing.jpg", byte.normalize(), 4.0 / 255.0),
    ];
    for (name, right, tolerance) in cases {
        let map = read(name);
        assert_eq!(map.source.kind, SourceKind::Normal, "{name}");
        let normal = row(&*map.surface, 1).normal(1);
        assert!(normal.distance(right) < tolerance, "{name}: {normal} for {right}");
    }
    assert!(warns(&read("b02_layer_normal.exr"), "Main.Normal.X, Main.Normal.Y, Main.Normal.Z"));
}

#[test]
fn heights_are_those_that_the_picture_was_made_of() {
    // Height of the first and of the last texel of the first column.
    let cases = [
        // Z beside an alpha that is 1.
        ("b04_depth_alpha.exr", 0.0, 0.5),
        // The first stored row is the lowest.
        ("b15_orientation4.tif", 1.0, 0.0),
        ("b16_grey_alpha.tif", 0.0, 1.0),
        ("b18_bilevel.tif", 0.0, 0.0),
        ("b20_zstd.tif", 0.0, 1.0),
    ];
    let options = SourceOptions { height_scale: Some(1.0), ..SourceOptions::default() };
    for (name, first, last) in cases {
        let map = read_with(name, &options);
        assert_eq!(map.source.kind, SourceKind::Height, "{name}");
        let heights = [0, 7].map(|y| row(&*map.surface, y).height[0]);
        assert_eq!(heights.map(f64::from), [first, last], "{name}");
    }
    let stripes = read_with("b18_bilevel.tif", &options);
    assert_eq!(row(&*stripes.surface, 3).height, [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    assert_eq!(read("b46_grey_alpha.tga").source.kind, SourceKind::Height);
}

#[test]
fn radiance_files_of_any_program_and_order_are_read() {
    let read = |name: &str| {
        let path = case(name);
        read_image(&path, &std::fs::read(&path).unwrap()).unwrap()
    };
    let (plain, below) = (read("b27_rgbe.hdr"), read("b45_bottom_up.hdr"));
    assert_eq!([0, 1, 2].map(|c| plain.samples.get(c)), [1.0, 0.5, 0.25]);
    assert_eq!((below.size, below.channels), (plain.size, 3));
}

#[test]
fn all_eight_orders_of_texels_come_out_upright() {
    // Two by three texels, stored in every order that TIFF knows; Radiance's are the same eight.
    let upright = [[10, 20], [30, 40], [50, 60]];
    for (axes, stored) in [
        ("-Y 3 +X 2", vec![10, 20, 30, 40, 50, 60]),
        ("-Y 3 -X 2", vec![20, 10, 40, 30, 60, 50]),
        ("+Y 3 -X 2", vec![60, 50, 40, 30, 20, 10]),
        ("+Y 3 +X 2", vec![50, 60, 30, 40, 10, 20]),
        ("+X 2 -Y 3", vec![10, 30, 50, 20, 40, 60]),
        ("-X 2 -Y 3", vec![20, 40, 60, 10, 30, 50]),
        ("-X 2 +Y 3", vec![60, 40, 20, 50, 30, 10]),
        ("+X 2 +Y 3", vec![50, 30, 10, 60, 40, 20]),
    ] {
        // Plain texels: mantissas, and an exponent of 128, which is 1/256.
        let texels = stored.iter().flat_map(|v: &u8| [*v, *v, *v, 128]);
        let bytes: Vec<u8> =
            format!("#?MYPROGRAM\nFORMAT=32-bit_rle_rgbe\n\n{axes}\n").bytes().chain(texels).collect();
        let image = read_image(Path::new("a.hdr"), &bytes).unwrap();
        let got: Vec<f32> = (0..6).map(|i| image.samples.get(3 * i) * 256.0).collect();
        assert_eq!(got, upright.concat().iter().map(|v: &u8| f32::from(*v)).collect::<Vec<_>>(), "{axes}");
    }
}

#[test]
fn a_crop_lies_where_its_display_window_says() {
    let path = case("b21_crop.exr");
    let image = read_image(&path, &std::fs::read(&path).unwrap()).unwrap();
    assert_eq!((image.size.width, image.size.height), (16, 16));
    let there = |x: usize, y: usize| {
        (0..image.channels).any(|c| image.samples.get((16 * y + x) * image.channels + c) != 0.0)
    };
    let all = (0..256).filter(|i| there(i % 16, i / 16)).count();
    let inside = (0..256).filter(|i| (8..12).contains(&(i % 16)) && (4..8).contains(&(i / 16)));
    assert_eq!((all, inside.filter(|i| there(i % 16, i / 16)).count()), (16, 16));
    assert!(image.warnings.iter().any(|w| w.contains("4 × 4 of 16 × 16")), "{:?}", image.warnings);
}

/// Reads a picture whose waves run along the axes, so that its slopes do not tell where green points.
fn read_waves(name: &str) -> SourceMap {
    let options = SourceOptions { convention: Some(Convention::OpenGl), ..SourceOptions::default() };
    read_with(name, &options)
}

#[test]
fn x_and_y_are_found_whatever_blue_is() {
    let standard = read_waves("b24_standard.png");
    assert!(standard.warnings.is_empty(), "{:?}", standard.warnings);
    for (name, said) in [
        ("b24_blue128.png", "blue is not z"),
        ("b24_blue_is_ao.png", "blue is not z"),
        ("b25_z_from_0_to_1.png", "blue is z from 0 to 1"),
        ("b26_dxt5nm.png", "DXT5nm"),
    ] {
        let map = read_waves(name);
        assert!(warns(&map, said), "{name}: {:?}", map.warnings);
        for y in 0..16 {
            let (a, b) = (row(&*standard.surface, y), row(&*map.surface, y));
            for x in 0..16 {
                // The standard one has its z by 8 bits, the others by its length or in half the range.
                assert!(a.normal(x).distance(b.normal(x)) < 2.0 / 255.0, "{name} {x} {y}");
            }
        }
    }
}

#[test]
fn a_convention_that_nothing_tells_is_asked_for() {
    let ask = |name: &str| read_source(&case(name), &SourceOptions::default()).err().unwrap().to_string();
    assert!(ask("b24_standard.png").contains("`--convention opengl` (up)"), "{}", ask("b24_standard.png"));
}

#[test]
fn a_texture_of_bumpslopes_is_refused_with_what_to_do() {
    let error = read_source(&case("b22_bumpslopes.tx"), &SourceOptions::default()).err().unwrap();
    assert!(error.to_string().contains("--format openexr"), "{error}");
}

#[test]
fn a_picture_that_ends_before_its_marker_is_still_refused() {
    let path = case("b28_trailing.jpg");
    let whole = std::fs::read(&path).unwrap();
    let marker = whole.windows(2).rposition(|pair| pair == [0xFF, 0xD9]).unwrap();
    assert!(read_image(&path, &whole[..marker + 2]).is_ok());
    for cut in [marker, marker - 10, marker / 2, 4] {
        let error = read_image(&path, &whole[..cut]).err().unwrap().to_string();
        assert!(error.contains("truncated"), "{cut}: {error}");
    }
}

/// OpenEXR file of two by two texels with these channels.
fn exr_of(names: &[String]) -> Vec<u8> {
    use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, Layer, WritableImage};
    let channel = |name: &String| AnyChannel::new(name.as_str(), FlatSamples::F32(vec![0.5; 4]));
    let channels = AnyChannels::sort(names.iter().map(channel).collect());
    let layer = Layer::new((2, 2), Default::default(), exr::prelude::Encoding::UNCOMPRESSED, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn layers_to_choose_from_are_listed() {
    let names = ["Combined.R", "Combined.G", "Combined.B", "Normal.X", "Normal.Y", "Normal.Z"];
    let error = read_image(Path::new("a.exr"), &exr_of(&names.map(str::to_owned))).err().unwrap().to_string();
    assert!(error.contains("several layers") && error.contains("Normal.Z"), "{error}");
    // Each can be named: a layer, and a channel alone, as heights.
    let bytes = exr_of(&names.map(str::to_owned));
    let layer = |layer: &str| ndfmap_maps::formats::read_image_layer(Path::new("a.exr"), &bytes, layer);
    assert_eq!(layer("Normal").unwrap().channels, 3);
    assert_eq!(layer("Normal.Z").unwrap().channels, 1);
    let error = layer("Depth").err().unwrap().to_string();
    assert!(error.contains("no layer, part or channel `Depth`. Channels: Combined."), "{error}");
    let many: Vec<String> = (0..2000).map(|i| format!("layer{i}.X")).collect();
    let error = read_image(Path::new("a.exr"), &exr_of(&many)).err().unwrap().to_string();
    assert!(error.contains("2000 channels"), "{error}");
}

#[test]
fn damaged_cases_are_errors_or_pictures() {
    let mut random = Pcg64Mcg::seed_from_u64(11);
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(case("")).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        let whole = std::fs::read(&path).unwrap();
        for _ in 0..300 {
            let mut bytes = whole.clone();
            if random.random_range(0..4) == 0 {
                bytes.truncate(random.random_range(0..bytes.len()));
            }
            for _ in 0..random.random_range(0..4) {
                if let Some(last) = bytes.len().checked_sub(1) {
                    bytes[random.random_range(0..=last)] = random.random();
                }
            }
            // Neither panics; what comes out is an error or a map.
            if let Ok(image) = read_image(&path, &bytes) {
                let _ = source_of_image(&path, image, String::new(), &SourceOptions::default());
            }
        }
    }
}

#[test]
fn tiff_of_reversed_bits_is_refused_by_name() {
    // One grey byte: little endian, eight entries, FillOrder (266) the fifth.
    let tiff = |fill_order: u32| {
        let entries: [(u16, u32); 8] =
            [(256, 1), (257, 1), (258, 8), (262, 1), (266, fill_order), (273, 110), (278, 1), (279, 1)];
        let mut bytes = b"II*\0\x08\0\0\0\x08\0".to_vec();
        for (tag, value) in entries {
            bytes.extend(tag.to_le_bytes());
            bytes.extend(4_u16.to_le_bytes());
            bytes.extend(1_u32.to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0; 4]);
        bytes.push(51);
        bytes
    };
    let read = |order: u32| read_image(Path::new("a.tif"), &tiff(order));
    assert_eq!(read(1).unwrap().samples, ndfmap_maps::Samples::U8(vec![51]));
    let error = read(2).err().unwrap().to_string();
    assert!(error.contains("FillOrder 2"), "{error}");
}

#[test]
fn a_picture_of_bits_may_be_small() {
    // 4096 × 4096 bits of one palette deflate to some two thousand bytes.
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 4096, 4096);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::One);
    encoder.write_header().unwrap().write_image_data(&[255; 512 * 4096]).unwrap();
    assert_eq!(read_image(Path::new("a.png"), &png).unwrap().size.width, 4096);
}
