//! Textures of games: each case holds what other decoders read from it (`cases/textures.py` writes both).

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::{Path, PathBuf};

use glam::Vec3;
use ndfmap_core::surface::SurfaceRow;
use ndfmap_maps::formats::{read_image, read_ndf};
use ndfmap_maps::source::{SourceMap, SourceOptions, read_source, source_of_image};
use ndfmap_maps::{Image, SourceKind};

const WIDTH: usize = 6;
const HEIGHT: usize = 5;

/// Options for small pictures, which do not tell where green points.
fn green_up() -> SourceOptions {
    let convention = Some(ndfmap_maps::source::Convention::OpenGl);
    SourceOptions { convention, ..SourceOptions::default() }
}

fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases").join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(case(name)).unwrap()
}

fn read(name: &str) -> Image {
    read_image(&case(name), &bytes(name)).unwrap_or_else(|e| panic!("{e}"))
}

fn source(name: &str) -> SourceMap {
    read_source(&case(name), &green_up()).unwrap_or_else(|e| panic!("{e}"))
}

/// Message about bytes that are refused.
fn refused(name: &str, bytes: &[u8]) -> String {
    match read_image(Path::new(name), bytes) {
        Ok(_) => panic!("{name} was read"),
        Err(error) => error.to_string(),
    }
}

/// Most that a sample may be from what another decoder read.
fn tolerance(name: &str) -> f64 {
    match name {
        // Steps of colours are rounded, or cut, to whole codes.
        "bc1.dds" | "bc1_clear.dds" | "bc2.dds" | "bc3.dds" | "bc3_dxt5nm.dds" => 1.01 / 255.0,
        // 16 bits stand for steps in closed form.
        "bc4.dds" | "bc5.dds" => 0.51 / 65535.0,
        // Single precision, or the script's nine digits.
        _ => 1e-6,
    }
}

#[test]
fn textures_hold_what_other_decoders_read() {
    let text = String::from_utf8(bytes("textures.json")).unwrap();
    let cases: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(cases.len(), 37);
    for (name, case) in &cases {
        let image = read(name);
        assert_eq!((image.size.width, image.size.height), (WIDTH, HEIGHT), "{name}");
        assert_eq!(image.channels as u64, case["channels"].as_u64().unwrap(), "{name}");
        let largest = case["largest"].as_f64().unwrap();
        let values = case["values"].as_array().unwrap();
        assert_eq!(image.samples.len(), values.len(), "{name}");
        let errors = values
            .iter()
            .enumerate()
            .map(|(i, value)| (f64::from(image.samples.get(i)) - value.as_f64().unwrap() / largest).abs());
        let most = errors.fold(0.0, f64::max);
        println!("{name}: {:.3}", most * 255.0);
        assert!(most <= tolerance(name), "{name}: {} codes of 255", most * 255.0);
    }
}

#[test]
fn normals_have_their_signs_and_their_z() {
    // The map that all cases are of, as the script makes it.
    let right = |x: usize, y: usize| {
        let (x, y) = (x as f32, y as f32);
        Vec3::new(0.5 * (0.8 * x + 0.3).sin(), 0.4 * (0.9 * y).cos(), 1.0).normalize()
    };
    // Half a code of 8 bits is 0.004 of a component, of 7 bits and a sign as much, of half precision 0.0002.
    // A ramp of BC5 has seven steps over the 0.7 that y spans in a block, and one of colours has three: half
    // a step is 0.05 and 0.12. UASTC loses 0.14 beside an alpha that is nowhere the same.
    let cases = [
        ("rgba8.dds", 0.005),
        ("bgra8.dds", 0.005),
        ("rgba8_zstd.ktx2", 0.005),
        ("rgba8_below.ktx2", 0.005),
        ("rgba8_swizzle.ktx2", 0.005),
        ("lossless.webp", 0.005),
        ("rgba16f.dds", 2e-4),
        ("rg16_signed.dds", 3e-5),
        ("v8u8.dds", 0.007),
        ("bc5.dds", 0.06),
        ("bc5_signed.dds", 0.06),
        ("bc3_dxt5nm.dds", 0.13),
        ("uastc_below.basis", 0.15),
    ];
    for (name, tolerance) in cases {
        let map = source(name);
        assert_eq!(map.source.kind, SourceKind::Normal, "{name}");
        let mut row = SurfaceRow::flat(WIDTH);
        let mut most = 0.0_f32;
        for y in 0..HEIGHT {
            map.surface.read_row(y, &mut row);
            most = (0..WIDTH).fold(most, |most, x| most.max(row.normal(x).distance(right(x, y))));
        }
        println!("{name}: {most}");
        assert!(most < tolerance, "{name}: {most}");
    }
    assert!(source("bc3_dxt5nm.dds").warnings.iter().any(|warning| warning.contains("DXT5nm")));
    assert_eq!(source("bc4.dds").source.kind, SourceKind::Height);
    assert_eq!(source("l8.dds").source.kind, SourceKind::Height);
}

#[test]
fn signed_formats_are_signed_whatever_they_hold() {
    // Two channels that lean one way, as values from 0 to 1 would.
    let mut bytes = bytes("rg16_signed.dds");
    let (x, y) = (0.6_f32, 0.5_f32);
    for texel in bytes[148..].chunks_exact_mut(4) {
        texel[..2].copy_from_slice(&((x * 32767.0) as i16).to_le_bytes());
        texel[2..].copy_from_slice(&((y * 32767.0) as i16).to_le_bytes());
    }
    let path = Path::new("a.dds");
    let image = read_image(path, &bytes).unwrap();
    let map = source_of_image(path, image, String::new(), &green_up()).unwrap();
    let mut row = SurfaceRow::flat(WIDTH);
    map.surface.read_row(0, &mut row);
    let right = Vec3::new(x, y, (1.0 - x * x - y * y).sqrt());
    // A code of 16 bits.
    assert!(row.normal(0).distance(right) < 2.0 / 32767.0, "{}", row.normal(0));
}

#[test]
fn a_plain_ktx2_is_no_baked_map() {
    let path = case("bc7.ktx2");
    assert!(read_ndf(&path, &bytes("bc7.ktx2")).unwrap().is_none());
}

/// Side of a picture that no case can hold.
const SIDE: u32 = 16_384;

/// A case, words put over it, and what its error says then.
type Refused = (&'static str, &'static [(usize, u32)], &'static str);

/// Case with these words put over it.
fn patched(name: &str, words: &[(usize, u32)]) -> Vec<u8> {
    let mut bytes = bytes(name);
    for (at, word) in words {
        bytes[*at..*at + 4].copy_from_slice(&word.to_le_bytes());
    }
    bytes
}

#[test]
fn several_pictures_are_refused_by_what_they_are() {
    let cases: &[Refused] = &[
        ("bc1.dds", &[(112, 0xFE00)], "is a cube map of 6 faces"),
        ("bc1.dds", &[(112, 0x20_0000), (24, 8)], "is a volume of 8 layers"),
        ("bc7.dds", &[(136, 4)], "is a cube map of 6 faces"),
        ("bc7.dds", &[(140, 3)], "is an array of 3 layers"),
        ("bc7.dds", &[(132, 4), (24, 2)], "is a volume of 2 layers"),
        ("bc7.ktx2", &[(36, 6)], "is a cube map of 6 faces"),
        ("bc7.ktx2", &[(32, 5)], "is an array of 5 layers"),
        ("bc7.ktx2", &[(28, 2)], "is a volume of 2 layers"),
        ("etc1s.ktx2", &[(36, 6)], "is a cube map of 6 faces"),
        ("uastc.basis", &[(17, 0x0100_0006)], "is an array of 6 pictures"),
        ("uastc.basis", &[(20, 0x0200_0801)], "is a cube map"),
        ("uastc.basis", &[(20, 0x0801)], "whose colours are in another file"),
    ];
    for (name, words, why) in cases {
        let error = refused(name, &patched(name, words));
        assert!(error.contains(why), "{error}");
    }
}

#[test]
fn texels_that_are_not_read_are_named() {
    let cases: &[Refused] = &[
        ("bc7.dds", &[(128, 67)], "the DXGI format 67 (R9G9B9E5_SHAREDEXP)"),
        ("bc1.dds", &[(84, 0x3454_5844)], "the code DXT4"),
        ("bc1.dds", &[(84, 41)], "the Direct3D 9 format 41"),
        ("rgba8.dds", &[(80, 0x200)], "the pixel flags 0x200"),
        ("rgba8.dds", &[(92, 0xF0F)], "masks"),
        ("bc7.ktx2", &[(12, 147)], "ETC2_R8G8B8_UNORM_BLOCK"),
        ("bc7.ktx2", &[(44, 3)], "is supercompressed (ZLIB)"),
        ("uastc.ktx2", &[(44, 3)], "is supercompressed (ZLIB)"),
    ];
    for (name, words, why) in cases {
        let error = refused(name, &patched(name, words));
        assert!(error.contains(why), "{error}");
    }
}

#[test]
fn sizes_beyond_a_file_are_refused_before_memory_is_taken() {
    let cases: &[Refused] = &[
        ("bc1.dds", &[(12, SIDE), (16, SIDE)], "cannot hold 16384 × 16384 texels"),
        ("rgba8.dds", &[(12, SIDE), (16, SIDE)], "cannot hold 16384 × 16384 texels"),
        ("rgba8.dds", &[(12, 0)], "at least one texel"),
        ("bc7.dds", &[(12, 65536), (16, 65536)], "claims 65536 × 65536 texels"),
        ("bc7.ktx2", &[(20, SIDE), (24, SIDE)], "where 268435456 are due"),
        // The uncompressed length agrees, and the compressed one is far too short.
        ("rgba8_zstd.ktx2", &[(20, SIDE), (24, SIDE), (96, 4 * SIDE * SIDE)], "cannot hold 1073741824"),
        ("uastc_zstd.ktx2", &[(20, SIDE), (24, SIDE), (96, SIDE * SIDE)], "cannot hold 268435456"),
        ("uastc.ktx2", &[(20, SIDE), (24, SIDE)], "cannot hold 16384 × 16384 texels"),
        ("etc1s.ktx2", &[(20, SIDE), (24, SIDE)], "cannot hold 16384 × 16384 texels"),
    ];
    for (name, words, why) in cases {
        let error = refused(name, &patched(name, words));
        assert!(error.contains(why), "{name}: {error}");
    }
    // Lossless WebP: 14 bits of width and 14 of height behind the signature, both less one.
    let mut webp = bytes("lossless.webp");
    webp[21..25].copy_from_slice(&[0xFE, 0xBF, 0xFF, 0x0F]);
    let error = refused("a.webp", &webp);
    assert!(error.contains("cannot hold 16383 × 16383 texels"), "{error}");
}

#[test]
fn two_channels_of_basis_universal_come_out_as_two() {
    // Descriptors that say "red, and green in alpha": samples 3 and 4 of ETC1S, 5 of UASTC.
    let cases = [("etc1s_alpha.ktx2", vec![(31, 3), (47, 4)]), ("uastc.ktx2", vec![(31, 5)])];
    for (name, samples) in cases {
        let whole = read(name);
        let mut bytes = bytes(name);
        let descriptor = u32::from_le_bytes(bytes[48..52].try_into().unwrap()) as usize;
        for (at, sample) in samples {
            bytes[descriptor + at] = sample | (bytes[descriptor + at] & 0xF0);
        }
        let image = read_image(Path::new(name), &bytes).unwrap();
        assert_eq!(image.channels, 2, "{name}");
        for i in 0..WIDTH * HEIGHT {
            for (channel, of) in [(0, 0), (1, 3)] {
                assert_eq!(image.samples.get(2 * i + channel), whole.samples.get(4 * i + of), "{name} {i}");
            }
        }
    }
}

#[test]
fn swizzles_choose_channels() {
    let from = |letters: &str| {
        let mut bytes = bytes("rgba8_swizzle.ktx2");
        let at = bytes.windows(4).position(|four| four == b"bgr1").unwrap();
        bytes[at..at + 4].copy_from_slice(letters.as_bytes());
        read_image(Path::new("a.ktx2"), &bytes)
    };
    let all = from("rgba").unwrap();
    let stored = [0, 1, 2, 3].map(|channel| all.samples.get(channel));
    let [r, g, b, a] = stored;
    for (letters, texel) in [
        ("rgba", vec![r, g, b, a]),
        ("rgb1", vec![r, g, b]),
        ("rg01", vec![r, g]),
        ("0a1b", vec![0.0, a, 1.0, b]),
        // Grey, and two channels as grey with alpha.
        ("ggg1", vec![g]),
        ("ggga", vec![g, a]),
    ] {
        let image = from(letters).unwrap();
        assert_eq!(image.channels, texel.len(), "{letters}");
        let first: Vec<f32> = (0..texel.len()).map(|channel| image.samples.get(channel)).collect();
        assert_eq!(first, texel, "{letters}");
    }
    assert!(from("xyzw").err().unwrap().to_string().contains("KTXswizzle of `xyzw`"));
}

#[test]
fn masks_of_ten_bits_are_those_that_writers_exchange() {
    // Red in the lowest ten bits, whatever the header says: 1023, 512 and 0, and an alpha of 3.
    let word: u32 = 1023 | 512 << 10 | 3 << 30;
    let masks = [(92, 0x3FF0_0000), (96, 0xF_FC00), (100, 0x3FF), (104, 0xC000_0000), (128, word)];
    let image = read_image(Path::new("a.dds"), &patched("rgba8.dds", &masks)).unwrap();
    let texel = [0, 1, 2, 3].map(|channel| image.samples.get(channel));
    // 16 bits hold 512/1023 to half a code.
    assert!((texel[1] - 512.0 / 1023.0).abs() <= 0.51 / 65535.0, "{texel:?}");
    assert_eq!([texel[0], texel[2], texel[3]], [1.0, 0.0, 1.0]);
}
