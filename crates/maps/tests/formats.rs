//! Every format reads what it should, and what is written comes back.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;
#[path = "formats/compact.rs"]
mod compact;

use std::path::Path;

use common::{HEIGHT, WIDTH, baked, baked_at, pictures, png, rgb8};
use glam::Vec3;
use ndfmap_core::bake::{LevelSink, Place};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::surface::{Surface, SurfaceRow};
use ndfmap_maps::formats::{read_file, read_image, read_ndf, to_write};
use ndfmap_maps::picture::write_picture;
use ndfmap_maps::source::{SourceMap, SourceOptions, read_source, source_of_image};
use ndfmap_maps::{ChannelLayout, NdfMap, SourceKind, WriteOptions};

/// Options for pictures of noise, which do not tell where green points.
fn green_up() -> SourceOptions {
    SourceOptions { convention: Some(ndfmap_maps::source::Convention::OpenGl), ..SourceOptions::default() }
}

fn source(name: &str, bytes: &[u8], options: &SourceOptions) -> SourceMap {
    let path = Path::new(name);
    source_of_image(path, read_image(path, bytes).unwrap(), String::new(), options).unwrap()
}

fn normals(surface: &dyn Surface) -> Vec<glam::Vec3> {
    let mut row = SurfaceRow::flat(surface.size().width);
    (0..surface.size().height)
        .flat_map(|y| {
            surface.read_row(y, &mut row);
            (0..row.width()).map(|i| row.normal(i)).collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn every_picture_format_gives_the_same_normals() {
    let expected: Vec<glam::Vec3> = rgb8()
        .chunks(3)
        .map(|c| glam::Vec3::from_slice(&[0, 1, 2].map(|i| f32::from(c[i]) / 127.5 - 1.0)).normalize())
        .collect();
    for (name, bytes) in pictures() {
        let map = source(name, &bytes, &green_up());
        assert_eq!(map.source.kind, SourceKind::Normal, "{name}");
        assert_eq!(map.surface.size(), Size { width: WIDTH, height: HEIGHT });
        // JPEG and UASTC lose; RGBE cuts to 8 bits under a shared exponent, 2/256 a channel; all else is
        // exact.
        let tolerance = match name {
            "map.jpg" => 0.25,
            "map.hdr" => 0.015,
            "map.basis" => 0.05,
            _ => 1e-6,
        };
        for (got, expected) in normals(&*map.surface).iter().zip(&expected) {
            assert!((*got - *expected).length() < tolerance, "{name}: {got} {expected}");
        }
    }
}

#[test]
fn directx_turns_green_and_two_channels_get_their_z_back() {
    let bytes = png(png::ColorType::Rgb, png::BitDepth::Eight, &rgb8());
    let up = normals(&*source("a.png", &bytes, &green_up()).surface);
    let options =
        SourceOptions { convention: Some(ndfmap_maps::source::Convention::DirectX), ..Default::default() };
    let down = normals(&*source("a.png", &bytes, &options).surface);
    assert!(up.iter().zip(&down).all(|(u, d)| u.x == d.x && u.y == -d.y && u.z == d.z));
    let no_blue: Vec<u8> = rgb8().chunks(3).flat_map(|c| [c[0], c[1], 0]).collect();
    let bytes = png(png::ColorType::Rgb, png::BitDepth::Eight, &no_blue);
    let map = source("a.png", &bytes, &green_up());
    assert!(map.warnings[0].contains("no blue"), "{:?}", map.warnings);
    for (a, b) in normals(&*map.surface).iter().zip(&up) {
        // Both were rounded to 8 bits, z apart from x and y.
        assert!((*a - *b).length() < 0.02);
    }
}

#[test]
fn black_texels_point_up_and_are_counted() {
    let mut data = rgb8();
    data[..9].fill(0);
    let bytes = png(png::ColorType::Rgb, png::BitDepth::Eight, &data);
    let map = source("a.png", &bytes, &green_up());
    assert!(map.warnings[0].starts_with("3 texels (3.57 %) are black"), "{:?}", map.warnings);
    assert_eq!(normals(&*map.surface)[..3], [glam::Vec3::Z; 3]);
}

#[test]
fn grey_is_height_nan_is_counted_and_depth_inverts() {
    use tiff::encoder::colortype::Gray32Float;
    let mut heights: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| i as f32).collect();
    heights[5] = f32::NAN;
    heights[6] = f32::INFINITY;
    let bytes = common::tiff::<Gray32Float>(&heights);
    let options = SourceOptions { height_scale: Some(0.01), invert: true, ..Default::default() };
    let map = source("h.tif", &bytes, &options);
    assert_eq!(map.source.kind, SourceKind::Height);
    assert!(map.warnings[0].starts_with("2 texels are NaN, infinite"), "{:?}", map.warnings);
    let mut row = SurfaceRow::flat(WIDTH);
    map.surface.read_row(0, &mut row);
    assert_eq!(row.height[3], -0.03);
    assert!(row.z.iter().all(|z| z.is_finite() && *z > 0.0));
    let all_bad = common::tiff::<Gray32Float>(&vec![f32::NAN; WIDTH * HEIGHT]);
    let image = read_image("h.tif".as_ref(), &all_bad).unwrap();
    let error = source_of_image("h.tif".as_ref(), image, String::new(), &options).err().unwrap();
    assert_eq!(
        error.to_string(),
        "h.tif: holds no height: all are NaN, infinite or beyond a million texture widths"
    );
}

#[test]
fn missing_files_folders_and_strangers_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = |path: &Path| read_source(path, &green_up()).err().unwrap().to_string();
    assert!(error(folder.path()).ends_with("is a folder, not a file"));
    assert!(error(&folder.path().join("none.png")).contains("none.png"));
    assert!(error("builtin:armor".as_ref()).contains("there are carved-disk, armour"));
    let text = folder.path().join("a.png");
    std::fs::write(&text, "hello").unwrap();
    assert!(error(&text).ends_with("does not begin like a PNG file"));
    std::fs::write(&text, "").unwrap();
    assert!(error(&text).ends_with("is empty"));
    let other = folder.path().join("a.gif");
    std::fs::write(&other, "GIF89a").unwrap();
    assert!(error(&other).contains("is of no known format; known are PNG, JPEG"));
}

/// In bands of rows, all layers of a band one after another, as a bake does it.
fn write_in_rows(path: &Path, map: &NdfMap, options: &WriteOptions) -> u64 {
    let (p, layout) = (&map.pyramid, map.pyramid.layout());
    let open = to_write(path).unwrap().open_sink.unwrap();
    let mut sink = open(path, &map.header, layout, options).unwrap();
    for (level, size) in p.sizes().iter().enumerate() {
        let (rows, row_bytes) = (5, layout.layer_bytes(Size { height: 1, ..*size }));
        for row in (0..size.height).step_by(rows) {
            for (layer, bytes) in p.level_bytes(level).chunks_exact(row_bytes * size.height).enumerate() {
                let end = (row + rows).min(size.height);
                let band = &bytes[row * row_bytes..end * row_bytes];
                sink.write_rows(Place { level, layer, row }, band).unwrap();
            }
        }
    }
    sink.finish().unwrap()
}

#[test]
fn baked_maps_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for method in ndfmap_core::ndf::TABLE.iter().map(|row| row.samples[0]) {
        for precision in [Precision::Half, Precision::Single] {
            let map = baked(method, "foil", precision);
            for name in ["rows.ktx2", "map.ktx2", "small.ktx2", "map.exr"] {
                let path = folder.path().join(name);
                let zstd = (name == "small.ktx2").then_some(5);
                let length = match name {
                    "rows.ktx2" => write_in_rows(&path, &map, &WriteOptions::default()),
                    _ => map.save(&path, &WriteOptions { zstd, ..WriteOptions::default() }).unwrap(),
                };
                assert_eq!(length, std::fs::metadata(&path).unwrap().len(), "{name}");
                let back = read_ndf(&path, &read_file(&path).unwrap()).unwrap().unwrap();
                assert!(back == map, "{method} {precision:?} {name}");
            }
        }
    }
}

#[test]
fn zstandard_gives_the_same_bytes_in_rows_as_whole_by_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let size = |width, height| Size { width, height };
    for (size, method, precision, strengths) in [
        (size(1, 1), "slopes", Precision::Half, &[3] as &[i32]),
        (size(96, 33), "naive", Precision::Single, &[1, 3, 22]),
        (size(200, 145), "vmf:3", Precision::Half, &[1, 3, 19]),
        // 14 MB: jobs are of 2 MiB at strength 1 and of 8 MiB at strength 3.
        (size(1000, 900), "slopes", Precision::Half, &[1, 3]),
    ] {
        let map = baked_at(size, method, "foil", precision);
        for zstd in strengths {
            let options = WriteOptions { zstd: Some(*zstd), ..WriteOptions::default() };
            let mut first: Option<Vec<u8>> = None;
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                for (name, in_rows) in [("rows.ktx2", true), ("whole.ktx2", false)] {
                    let path = folder.path().join(name);
                    let length = pool.install(|| match in_rows {
                        true => write_in_rows(&path, &map, &options),
                        false => map.save(&path, &options).unwrap(),
                    });
                    let bytes = read_file(&path).unwrap();
                    assert_eq!(length, bytes.len() as u64);
                    let same = first.get_or_insert_with(|| bytes.clone()) == &bytes;
                    assert!(same, "{size:?} {method} {zstd}: {name} by {threads} threads");
                }
            }
            let bytes = first.unwrap();
            assert!(read_ndf(Path::new("a.ktx2"), &bytes).unwrap().unwrap() == map);
            check_frames(&bytes, &map);
        }
    }
}

/// Checks that each level is one Zstandard frame that says how much it holds (RFC 8878, section 3.1.1.1), and
/// that levels fill the file, smallest first, to its end (KTX 2.0, "Mip Level Array").
fn check_frames(bytes: &[u8], map: &NdfMap) {
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let mut end = bytes.len();
    for level in 0..map.pyramid.sizes().len() {
        // The level index begins at byte 80: offset, length, length once inflated.
        let index = 80 + 24 * level;
        let (start, length) = (number(index), number(index + 8));
        assert_eq!(start + length, end);
        end = start;
        let (frame, held) = (&bytes[start..start + length], map.pyramid.level_bytes(level).len());
        assert_eq!(number(index + 16), held);
        assert_eq!(zstd::zstd_safe::get_frame_content_size(frame).unwrap(), Some(held as u64));
        assert_eq!(zstd::zstd_safe::find_frame_compressed_size(frame).unwrap(), length);
    }
}

#[test]
fn attributes_that_do_not_fit_the_method_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ktx2");
    let mut map = baked("slopes", "foil", Precision::Half);
    map.header.attributes =
        vec![ndfmap_maps::Attribute { name: "a.png".to_owned(), channels: 1, transfer: "linear".to_owned() }];
    map.save(&path, &WriteOptions::default()).unwrap();
    let error = read_ndf(&path, &read_file(&path).unwrap()).unwrap_err().to_string();
    assert!(error.ends_with("says that `slopes` carries 1 attributes"), "{error}");
}

/// OpenImageIO's channels, in the map's own precision.
const BUMPSLOPES: WriteOptions =
    WriteOptions { zstd: None, channels: ChannelLayout::Bumpslopes, precision: None, compact: None };

#[test]
fn options_that_a_format_has_not_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let map = baked("slopes", "foil", Precision::Half);
    let refused = |name: &str, options: &WriteOptions| {
        let path = folder.path().join(name);
        let error = map.save(&path, options).unwrap_err().to_string();
        assert!(!path.exists(), "{name}");
        error
    };
    let zstd = WriteOptions { zstd: Some(3), ..WriteOptions::default() };
    assert!(refused("a.exr", &zstd).contains("Zstandard is for KTX2"));
    assert!(refused("a.ktx2", &BUMPSLOPES).contains("ending in .exr"));
    assert!(refused("a.png", &WriteOptions::default()).ends_with("maps are written as .exr or .ktx2"));
}

#[test]
fn bumpslopes_come_back_for_heights_and_normals() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("b.exr");
    for builtin in ["armour", "v-groove"] {
        let map = baked("slopes", builtin, Precision::Single);
        map.save(&path, &BUMPSLOPES).unwrap();
        let back = read_ndf(&path, &read_file(&path).unwrap()).unwrap().unwrap();
        assert_eq!(back.header, map.header);
        for (level, size) in map.pyramid.sizes().iter().enumerate() {
            for i in 0..size.area() {
                let (x, y) = (i % size.width, i / size.width);
                for (a, b) in back.pyramid.texel(level, x, y).iter().zip(map.pyramid.texel(level, x, y)) {
                    // Scaled to OpenImageIO's units and back in single precision.
                    assert!((a - b).abs() <= 4e-7 * b.abs(), "{builtin} level {level}: {a} {b}");
                }
            }
        }
    }
    let naive = baked("naive", "armour", Precision::Half);
    let error = naive.save(&path, &BUMPSLOPES).unwrap_err().to_string();
    assert!(error.ends_with("holds the method `slopes`, not `naive`"));
}

#[test]
fn a_map_is_read_by_every_method_of_its_channels() {
    let path = Path::new("map.ktx2");
    let by = |map: &NdfMap, method: &str| map.read_by(path, &*method.parse::<AnyMethod>().unwrap());
    for (baked_by, readers) in [
        ("slopes", &["slopes:9", "slopes:9:drawn"] as &[&str]),
        ("toksvig", &["naive"]),
        ("sh:7", &["sh:7:printed", "sh:4", "sh:2"]),
        ("vmf:4", &["vmf:4:parent"]),
        ("ndm:gaussian:integrated", &["ndm", "ndm:plane", "ndm:pearson"]),
    ] {
        let map = baked(baked_by, "foil", Precision::Single);
        for method in readers {
            let read = by(&map, method).unwrap();
            assert_eq!(read.header.method, *method);
            // It decodes to what the method itself would have baked, where nothing is fitted.
            if !baked_by.starts_with("vmf") {
                let own = baked(method, "foil", Precision::Single);
                assert_eq!(
                    read.texel(2, 1, 1).unwrap().decoded(),
                    own.texel(2, 1, 1).unwrap().decoded(),
                    "{method}"
                );
            }
        }
    }
    let slopes = baked("slopes", "foil", Precision::Half);
    for method in ["toksvig", "vmf:4", "sh:4"] {
        let error = by(&slopes, method).unwrap_err().to_string();
        assert!(error.contains("was baked by `slopes`"), "{error}");
    }
    // More coefficients than there are.
    assert!(by(&baked("sh:4", "foil", Precision::Half), "sh:7").is_err());
}

#[test]
fn a_picture_is_written_as_the_same_bytes_every_time() {
    // As many blocks as compress on all threads at once.
    let size = Size { width: 300, height: 400 };
    let wave = |x: usize, y: usize| ((x * y) as f32 * 0.37).sin();
    let picture = Grid::from_fn(size, |x, y| Vec3::new(wave(x, y), wave(y, x + 1), 0.5));
    let folder = tempfile::tempdir().unwrap();
    for name in ["picture.exr", "picture.png"] {
        let path = folder.path().join(name);
        let written = || {
            write_picture(&path, &picture, 1.0).unwrap();
            std::fs::read(&path).unwrap()
        };
        let first = written();
        assert!((0..8).all(|_| written() == first), "{name}");
    }
}
