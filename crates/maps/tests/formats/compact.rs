//! Maps in integers: what is read is what the ranges say, and what two ways of writing wrote.

use ndfmap_core::bake::{LevelSink as _, Place};
use ndfmap_core::compact::{Bits, Compact};
use ndfmap_core::pyramid::Precision;
use ndfmap_maps::formats::{read_file, read_ndf, to_write};
use ndfmap_maps::{COMPACT_VERSION, Header, NdfMap, VERSION, WriteOptions};

use crate::common::baked;

/// Methods of one layer to many, and with sums of several kinds.
const METHODS: [&str; 6] = ["toksvig", "slopes", "sh:3", "vmf:3", "gmm:2", "phong:2"];

#[test]
fn what_is_read_is_what_the_ranges_say() {
    let folder = tempfile::tempdir().unwrap();
    let (memory, sunk) = (folder.path().join("memory.ktx2"), folder.path().join("sunk.ktx2"));
    for method in METHODS {
        for bits in Bits::ALL {
            let map = baked(method, "armour", Precision::Single);
            let encoding = map.method(&memory).unwrap().encoding();
            let due = Compact::of(bits, &map.pyramid, encoding).rounded(&map.pyramid);
            for zstd in [None, Some(3)] {
                let options = WriteOptions { compact: Some(bits), zstd, ..WriteOptions::default() };
                map.save(&memory, &options).unwrap();
                // Row by row, as a bake does, and in the order of no level.
                let layout = map.pyramid.layout();
                let mut sink =
                    to_write(&sunk).unwrap().open_sink.unwrap()(&sunk, &map.header, layout, &options)
                        .unwrap();
                for level in (0..map.pyramid.sizes().len()).rev() {
                    let bytes = map.pyramid.level_bytes(level);
                    for (layer, bytes) in bytes.chunks(bytes.len() / layout.layers).enumerate() {
                        let row = bytes.len() / map.pyramid.sizes()[level].height;
                        for (row, bytes) in bytes.chunks(row).enumerate() {
                            sink.write_rows(Place { level, layer, row }, bytes).unwrap();
                        }
                    }
                }
                sink.finish().unwrap();
                let bytes = read_file(&memory).unwrap();
                assert!(bytes == read_file(&sunk).unwrap(), "{method} {bits} {zstd:?}");
                let read = read_ndf(&memory, &bytes).unwrap().unwrap();
                assert!(read.pyramid == due, "{method} {bits} {zstd:?}");
                assert_eq!(read.header.version, COMPACT_VERSION);
                assert_eq!(read.header.compact.as_ref().unwrap().bits, bits.count());
                assert_eq!(Header { version: map.header.version, compact: None, ..read.header }, map.header);
            }
        }
    }
}

#[test]
fn floats_of_integers_have_no_ranges() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ktx2");
    let integers = WriteOptions { compact: Some(Bits::Eight), ..WriteOptions::default() };
    baked("vmf:2", "foil", Precision::Single).save(&path, &integers).unwrap();
    let map = NdfMap::open(&path).unwrap();
    let bytes = read_file(&path).unwrap();
    map.save(&path, &integers).unwrap();
    assert!(read_file(&path).unwrap() == bytes, "integers go back as they were");
    map.save(&path, &WriteOptions::default()).unwrap();
    let again = NdfMap::open(&path).unwrap();
    assert!(again.header.compact.is_none() && again.pyramid == map.pyramid);
    assert_eq!(again.header.version, VERSION);
    let error = map.save(&folder.path().join("map.exr"), &integers).unwrap_err().to_string();
    assert!(error.contains("unorm8") && error.contains("OpenEXR holds floats"), "{error}");
}

#[test]
fn ranges_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ktx2");
    let options = WriteOptions { compact: Some(Bits::Eight), ..WriteOptions::default() };
    baked("toksvig", "foil", Precision::Single).save(&path, &options).unwrap();
    let sound = read_file(&path).unwrap();
    let text = String::from_utf8_lossy(&sound).into_owned();
    let at = text.find("\"ranges\":[[").unwrap();
    let front = sound.windows(11).position(|window| window == b"\"ranges\":[[").unwrap();
    assert!(at >= front);
    let with = |from: &[u8], to: &[u8]| {
        assert_eq!(from.len(), to.len());
        let at = sound.windows(from.len()).position(|window| window == from).unwrap();
        let mut bytes = sound.clone();
        bytes[at..at + to.len()].copy_from_slice(to);
        read_ndf(&path, &bytes).unwrap_err().to_string()
    };
    // No such bits; and a range fewer than channels, whose bytes become white space.
    assert!(with(b"\"bits\":8,", b"\"bits\":7,").contains("channels of 7 bits"));
    let end = sound[front..].windows(3).position(|window| window == b"]]}").unwrap() + front;
    let last = sound[..end].iter().rposition(|byte| *byte == b',').unwrap();
    let last = sound[..last].iter().rposition(|byte| *byte == b']').unwrap() + 1;
    let mut short = sound.clone();
    short[last..end + 1].fill(b' ');
    let error = read_ndf(&path, &short).unwrap_err().to_string();
    assert!(error.contains("no sound range for each channel"), "{error}");
    // Half floats where the key says eight bits.
    let mut other = sound;
    other[12] = 97;
    let error = read_ndf(&path, &other).unwrap_err().to_string();
    assert!(error.contains("where its key") && error.contains("R8G8B8A8_UNORM"), "{error}");
}
