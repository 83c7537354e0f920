//! Damaged and hostile files: an error or a map, never a panic, a hang or memory by an unchecked header.
//!
//! Deterministic cousins of the fuzz targets in `fuzz/`, so that every test run does some fuzzing.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;

use common::{baked, pictures};
use ndfmap_core::compact::Bits;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::pyramid::Precision;
use ndfmap_maps::formats::{read_image, read_ndf, to_write};
use ndfmap_maps::{ChannelLayout, WriteOptions};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Every format with a sound file, baked ones last.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let mut all = pictures();
    let map = baked("slopes", "armour", Precision::Half);
    let path = folder.path().join("map.exr");
    map.save(&path, &WriteOptions::default()).unwrap();
    all.push(("native.exr", std::fs::read(&path).unwrap()));
    let bumpslopes = WriteOptions { channels: ChannelLayout::Bumpslopes, ..WriteOptions::default() };
    map.save(&path, &bumpslopes).unwrap();
    all.push(("bumpslopes.exr", std::fs::read(&path).unwrap()));
    all.push(("map.ktx2", ktx2()));
    let path = folder.path().join("small.ktx2");
    let compressed = WriteOptions { zstd: Some(3), ..WriteOptions::default() };
    baked("vmf:2", "armour", Precision::Half).save(&path, &compressed).unwrap();
    all.push(("zstd.ktx2", std::fs::read(&path).unwrap()));
    let compact = WriteOptions { compact: Some(Bits::Ten), ..WriteOptions::default() };
    baked("vmf:2", "armour", Precision::Single).save(&path, &compact).unwrap();
    all.push(("compact.ktx2", std::fs::read(&path).unwrap()));
    all
}

fn ktx2() -> Vec<u8> {
    use ndfmap_core::bake::Bake;
    use ndfmap_maps::source::{SourceOptions, read_source};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ktx2");
    let options = SourceOptions {
        builtin_size: ndfmap_core::grid::Size { width: 21, height: 13 },
        ..Default::default()
    };
    let map = read_source("builtin:armour".as_ref(), &options).unwrap();
    let method = "slopes".parse::<AnyMethod>().unwrap();
    let bake = Bake::new(&*map.surface, &*method);
    let header = baked("slopes", "armour", Precision::Half).header;
    let open = to_write(&path).unwrap().open_sink.unwrap();
    let mut sink = open(&path, &header, bake.layout(), &WriteOptions::default()).unwrap();
    bake.run(&mut sink).unwrap();
    sink.finish().unwrap();
    std::fs::read(&path).unwrap()
}

/// Reads as both kinds; what matters is that it returns.
fn read_both(name: &str, bytes: &[u8]) -> bool {
    let path = Path::new(name);
    let image = read_image(path, bytes);
    let map = read_ndf(path, bytes);
    if let Ok(Some(map)) = &map {
        let method = map.method(path).unwrap();
        let last = map.pyramid.sizes().len() - 1;
        let _described = method.describe(&map.pyramid.texel(last, 0, 0));
    }
    let errors: Vec<String> =
        [image.err(), map.err()].into_iter().flatten().map(|error| error.to_string()).collect();
    assert!(errors.iter().all(|error| error.starts_with(name)), "{errors:?}");
    errors.is_empty()
}

#[test]
fn truncated_files_are_errors() {
    for (name, bytes) in samples() {
        for length in (0..bytes.len()).step_by(1 + bytes.len() / 150) {
            let read = read_both(name, &bytes[..length]);
            // A PNG that lacks only its end chunk is whole as a picture; a mip-mapped EXR is as a picture
            // as soon as its largest level is, and as a map never.
            let tail = bytes.len() - length <= 16 && name.ends_with("png");
            assert!(!read || tail, "{name} of {} bytes cut to {length}", bytes.len());
        }
    }
}

#[test]
fn flipped_bits_are_survived() {
    let mut random = Pcg64Mcg::seed_from_u64(9);
    for (name, bytes) in samples() {
        for _ in 0..400 {
            let mut damaged = bytes.clone();
            for _ in 0..random.random_range(1..4) {
                // Half of the hits on the first bytes, where headers are.
                let reach = if random.random() { 200.min(damaged.len()) } else { damaged.len() };
                damaged[random.random_range(0..reach)] ^= 1 << random.random_range(0..8);
            }
            read_both(name, &damaged);
        }
    }
}

#[test]
fn a_hostile_ktx2_data_format_descriptor_is_survived() {
    // A texel block dimension of 255 makes the ktx2 crate's own reader panic; ours does not look there.
    let mut bytes = ktx2();
    let dfd = u32::from_le_bytes(bytes[48..52].try_into().unwrap()) as usize;
    bytes[dfd + 4 + 12..dfd + 4 + 16].fill(255);
    read_both("map.ktx2", &bytes);
}

#[test]
fn an_exr_without_parts_is_refused() {
    // Found by fuzzing: magic, version 2 with the multi-part flag, and an empty list of headers.
    let bytes = [0x76, 0x2f, 0x31, 0x01, 2, 0x10, 0, 0, 0];
    let error = read_ndf(Path::new("map.exr"), &bytes).unwrap_err().to_string();
    assert!(error.starts_with("map.exr: "), "{error}");
}

#[test]
fn huge_headers_are_refused_before_memory_is_taken() {
    let all = samples();
    let sample = |name: &str| all.iter().find(|(n, _)| *n == name).unwrap().1.clone();
    let refuse = |name: &str, bytes: &[u8], why: &str| {
        let error = match read_image(Path::new(name), bytes) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{name} was read"),
        };
        assert!(error.contains(why), "{error}");
    };
    let mut png = sample("rgb8.png");
    png[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let crc = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&crc.to_be_bytes());
    refuse("bomb.png", &png, "claims 65536 × 65536 texels");
    png[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let crc = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&crc.to_be_bytes());
    refuse("bomb.png", &png, "cannot hold 16384 × 16384 texels");
    png[16..24].fill(0);
    refuse("zero.png", &png, "zero.png");

    let mut jpeg = sample("map.jpg");
    let frame = jpeg.windows(2).position(|w| w == [0xFF, 0xC0]).unwrap();
    jpeg[frame + 5..frame + 9].fill(0xFF);
    refuse("bomb.jpg", &jpeg, "65535 × 65535");

    jpeg[frame + 5..frame + 9].copy_from_slice(&[0x40, 0, 0x40, 0]);
    refuse("bomb.jpg", &jpeg, "cannot hold 16384 × 16384 texels");

    // The data window's and display window's corners, in the first header.
    let mut exr = sample("map.exr");
    for name in [b"dataWindow\0box2i\0".as_slice(), b"displayWindow\0box2i\0"] {
        let at = exr.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4;
        exr[at + 8..at + 16].copy_from_slice(&[0xFF, 0x3F, 0, 0, 0xFF, 0x3F, 0, 0]);
    }
    refuse("bomb.exr", &exr, "cannot hold the 805306368 samples it claims");

    let mut tga = sample("map.tga");
    tga[12..16].fill(0xFF);
    refuse("bomb.tga", &tga, "claims 65535 × 65535 texels");
    tga[12..16].copy_from_slice(&[0, 0x40, 0, 0x40]);
    refuse("bomb.tga", &tga, "cannot hold 16384 × 16384 texels");
    tga[12..16].fill(0);
    refuse("zero.tga", &tga, "at least one texel");

    let hdr = String::from_utf8_lossy(&sample("map.hdr")[..60]).into_owned();
    let header = hdr.split("-Y").next().unwrap();
    refuse("bomb.hdr", format!("{header}-Y 65536 +X 65536\n").as_bytes(), "65536 × 65536");
    refuse("bomb.hdr", format!("{header}-Y 16384 +X 16384\n").as_bytes(), "cannot hold");

    let mut ktx2 = sample("map.ktx2");
    ktx2[20..28].copy_from_slice(&[0, 0, 1, 0, 0, 0, 1, 0]);
    let error = read_ndf(Path::new("bomb.ktx2"), &ktx2).unwrap_err().to_string();
    assert!(error.ends_with("has a width of 65536; its key `ndfmap` says 21"), "{error}");
}

#[test]
fn headers_that_contradict_their_file_are_refused() {
    let bytes = ktx2();
    let replaced = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let mut changed = bytes.clone();
        let at = changed.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        changed[at..at + to.len()].copy_from_slice(to.as_bytes());
        read_ndf(Path::new("map.ktx2"), &changed).unwrap_err().to_string()
    };
    assert!(replaced("\"slopes\"", "\"vfm:99\"").contains("there is no method called `vfm`"));
    assert!(
        replaced("\"version\":1", "\"version\":7")
            .contains("has header version 7; this program reads up to 2")
    );
    assert!(replaced("\"slopes\"", "\"sh:016\"").contains("layer count of 2"));
    assert!(replaced("\"width\":21", "\"width\":99").contains("has a width of 21"));
    assert!(replaced("[\"repeat\"", "[\"mirror\"").contains("unknown wrap `mirror`"));
    assert!(replaced("{\"version\"", "[\"version\"").contains("cannot be read"));
}

/// The checksum of PNG chunks.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { 0xEDB8_8320 ^ (c >> 1) } else { c >> 1 })
    })
}
