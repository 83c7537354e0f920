//! Streams of meshoptimizer's own encoder (`tests/cases/meshopt.mjs`), sound and damaged.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::{Filter, Layout, Mode};

#[derive(Deserialize)]
struct Case {
    name: String,
    layout: Layout,
    stream: String,
    /// Bytes that another decoder reads: all of them, or their hash.
    values: Option<String>,
    sha256: Option<String>,
}

fn cases() -> Vec<Case> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cases/meshopt.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn bytes(coded: &str) -> Vec<u8> {
    STANDARD.decode(coded).unwrap()
}

/// Integers of a filter's output, as bits for floats.
fn numbers(layout: Layout, bytes: &[u8]) -> Vec<i64> {
    match (layout.filter, layout.byte_stride) {
        (Filter::Exponential, _) => {
            bytes.as_chunks().0.iter().map(|b| i64::from(u32::from_le_bytes(*b))).collect()
        }
        (Filter::Color, 4) => bytes.iter().map(|b| i64::from(*b)).collect(),
        (_, 4) => bytes.iter().map(|b| i64::from(*b as i8)).collect(),
        (Filter::Color, _) => bytes.as_chunks().0.iter().map(|b| i64::from(u16::from_le_bytes(*b))).collect(),
        _ => bytes.as_chunks().0.iter().map(|b| i64::from(i16::from_le_bytes(*b))).collect(),
    }
}

#[test]
fn streams_hold_what_another_decoder_reads() {
    let cases = cases();
    assert_eq!(cases.len(), 44);
    for Case { name, layout, stream, values, sha256 } in cases {
        let decoded = layout.decode(&bytes(&stream)).unwrap_or_else(|e| panic!("{name} {e}"));
        assert_eq!(decoded.len(), layout.count * layout.byte_stride, "{name}");
        if let Some(sha256) = sha256 {
            let hash: String = Sha256::digest(&decoded).iter().map(|byte| format!("{byte:02x}")).collect();
            assert_eq!(hash, sha256, "{name}");
            continue;
        }
        let right = numbers(layout, &bytes(&values.unwrap()));
        let decoded = numbers(layout, &decoded);
        let most = decoded.iter().zip(&right).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        println!("{name}: {most}");
        // The specification leaves one step to rounding, but none to floats.
        let tolerance = if matches!(layout.filter, Filter::Exponential) { 0 } else { 1 };
        assert!(most <= tolerance, "{name}: {most}");
    }
}

#[test]
fn the_example_of_the_specification_is_decoded() {
    // Sixteen deltas of one byte, in groups of codes of four bits; the other bytes stay zero.
    let packed = [0x17, 0x5F, 0xF0, 0xBC, 0x77, 0xA9, 0x21, 0x00, 0x34, 0xB5];
    let stream = [&[0xA0, 2], packed.as_slice(), &[0, 0, 0], &[0; 32]].concat();
    let layout = Layout { mode: Mode::Attributes, filter: Filter::None, count: 16, byte_stride: 4 };
    let decoded = layout.decode(&stream).unwrap();
    let mut before = 0_u8;
    let deltas = decoded.chunks(4).map(|element| {
        let delta = element[0].wrapping_sub(before) as i8;
        before = element[0];
        assert_eq!(element[1..], [0; 3]);
        delta
    });
    let expected = [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0];
    assert_eq!(deltas.collect::<Vec<_>>(), expected);
}

#[test]
fn streams_of_another_length_are_errors() {
    for Case { name, layout, stream, .. } in cases() {
        let stream = bytes(&stream);
        for end in 0..stream.len() {
            assert!(layout.decode(&stream[..end]).is_err(), "{name}: {end}");
        }
        let longer = [stream.as_slice(), &[0]].concat();
        assert!(layout.decode(&longer).is_err(), "{name}");
    }
}

#[test]
fn counts_beyond_the_stream_are_refused_before_memory_is_taken() {
    for Case { name, layout, stream, .. } in cases() {
        for count in [layout.count + 258, 3 << 40, usize::MAX] {
            assert!(Layout { count, ..layout }.decode(&bytes(&stream)).is_err(), "{name}: {count}");
        }
    }
    // The densest stream: blocks of 256 elements whose deltas are all zero.
    let stream = [&[0xA1], [0xAA; 10].as_slice(), &[0; 24]].concat();
    let layout = |count| Layout { mode: Mode::Attributes, filter: Filter::None, count, byte_stride: 4 };
    assert_eq!(stream.len(), 35);
    assert_eq!(layout(2560).decode(&stream).map(|decoded| decoded.len()), Ok(10_240));
    assert_eq!(layout(2561).decode(&stream), Err("ends too early"));
}

#[test]
fn damaged_streams_are_errors_or_values() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let (mut read, mut refused) = (0, 0);
    for Case { layout, stream, .. } in cases() {
        let stream = bytes(&stream);
        for _ in 0..300 {
            let mut copy = stream.clone();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(0..copy.len());
                copy[at] = random.random_range(0..=255);
            }
            match layout.decode(&copy) {
                Ok(decoded) => {
                    assert_eq!(decoded.len(), layout.count * layout.byte_stride);
                    read += 1;
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(read > 1000 && refused > 1000, "{read} {refused}");
}

#[test]
fn layouts_that_the_specification_forbids_are_refused() {
    let layout = |mode, filter, count, byte_stride| Layout { mode, filter, count, byte_stride };
    for layout in [
        layout(Mode::Attributes, Filter::None, 1, 0),
        layout(Mode::Attributes, Filter::None, 1, 6),
        layout(Mode::Attributes, Filter::None, 1, 260),
        layout(Mode::Attributes, Filter::Octahedral, 1, 12),
        layout(Mode::Attributes, Filter::Quaternion, 1, 4),
        layout(Mode::Attributes, Filter::Color, 1, 12),
        layout(Mode::Triangles, Filter::None, 4, 2),
        layout(Mode::Triangles, Filter::None, 3, 1),
        layout(Mode::Triangles, Filter::Exponential, 3, 4),
        layout(Mode::Indices, Filter::None, 1, 8),
    ] {
        assert!(layout.decode(&[]).unwrap_err().contains("does not allow"), "{layout:?}");
    }
}

#[test]
fn what_streams_must_not_hold_is_refused() {
    const BEFORE: &str = "names an edge or a vertex before the first";
    let triangles = Layout { mode: Mode::Triangles, filter: Filter::None, count: 3, byte_stride: 4 };
    // A triangle on the edge, then with the vertex, before the first.
    assert_eq!(triangles.decode(&[&[0xE1, 0x00], [0; 16].as_slice()].concat()), Err(BEFORE));
    assert_eq!(triangles.decode(&[&[0xE1, 0xF0, 0x10], [0; 15].as_slice()].concat()), Err(BEFORE));
    // A table that escapes, and one whose last bytes are in use.
    for at in [2, 17] {
        let mut stream = [&[0xE1, 0xF0], [0; 16].as_slice()].concat();
        assert!(triangles.decode(&stream).is_ok());
        stream[at] = if at == 2 { 0xF0 } else { 1 };
        assert_eq!(triangles.decode(&stream), Err("has a damaged table"));
    }
    let indices = Layout { mode: Mode::Indices, filter: Filter::None, count: 1, byte_stride: 4 };
    let long = [&[0xD1], [0x80; 5].as_slice(), &[0; 5]].concat();
    assert_eq!(indices.decode(&long), Err("has an index of more than five bytes"));
    let attributes = Layout { mode: Mode::Attributes, ..indices };
    // Bytes' deltas with a rotation, and a fourth kind of delta.
    for mode in [0x10, 3] {
        let stream = [&[0xA1, 0xAA], [0; 23].as_slice(), &[mode]].concat();
        assert_eq!(attributes.decode(&stream), Err("has a channel of an unknown mode"));
    }
    // Versions that glTF has not: the first of triangles, and the next of each.
    for (layout, header) in [(triangles, 0xE0), (triangles, 0xE2), (indices, 0xD2), (attributes, 0xA2)] {
        let stream = [&[header], [0; 40].as_slice()].concat();
        assert_eq!(layout.decode(&stream), Err("is of another mode or a later version"));
    }
}
