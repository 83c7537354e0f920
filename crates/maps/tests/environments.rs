//! Environments from files: HDR and EXR, and what is wrong with others.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_maps::environment::read_environment;
use ndfmap_maps::picture::write_picture;

fn exr(folder: &Path, name: &str, size: (usize, usize), texel: impl FnMut(usize, usize) -> Vec3) -> PathBuf {
    let path = folder.join(name);
    write_picture(&path, &Grid::from_fn(Size { width: size.0, height: size.1 }, texel), 1.0).unwrap();
    path
}

#[test]
fn exr_and_hdr_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let texel = |x: usize, y: usize| Vec3::new(x as f32, y as f32, 1000.0);
    let path = exr(folder.path(), "sky.exr", (8, 4), texel);
    let (sky, warnings) = read_environment(&path).unwrap();
    assert!(warnings.is_empty());
    assert_eq!(sky.radiance(sky.direction(6.5, 2.5)), DVec3::new(6.0, 2.0, 1000.0));
    let hdr = image::Rgb32FImage::from_fn(8, 4, |x, y| image::Rgb([x as f32, y as f32, 1024.0]));
    let path = folder.path().join("sky.hdr");
    image::DynamicImage::from(hdr).save(&path).unwrap();
    let (sky, _) = read_environment(&path).unwrap();
    // Eight bits, under the exponent of the brightest channel: 1024 comes in steps of 8.
    assert!(
        (sky.radiance(sky.direction(6.5, 2.5)) - DVec3::new(6.0, 2.0, 1024.0)).abs().max_element() <= 8.0
    );
}

#[test]
fn cubes_are_read() {
    let folder = tempfile::tempdir().unwrap();
    // A strip of six faces in the order of OpenGL, whose x runs against ours; each its number.
    let path = exr(folder.path(), "strip.exr", (24, 4), |x, _| Vec3::splat((x / 4) as f32 + 1.0));
    let (sky, _) = read_environment(&path).unwrap();
    let faces = [DVec3::NEG_X, DVec3::X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    for (face, w) in faces.into_iter().enumerate() {
        let aside = (w + DVec3::new(0.1, 0.12, 0.14)).normalize();
        assert_eq!(sky.radiance(aside).x, face as f64 + 1.0, "{w}");
    }
    // One place twice: red on the right of blue, green above. The cross looks to +z, the panorama to -z.
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases");
    for (name, turn) in [("b01_env_lat.exr", 1.0), ("b01_env_cross.exr", -1.0)] {
        let (sky, _) = read_environment(&cases.join(name)).unwrap();
        for (w, channel) in [(DVec3::X, 0), (DVec3::NEG_Z, 2), (DVec3::Y, 1)] {
            let w = w * DVec3::new(turn, 1.0, turn);
            // Half floats hold 8 exactly, and 0.1, which is the most of other ways, to a thousandth of
            // itself.
            assert_eq!(sky.radiance(w)[channel], 8.0, "{name} {w}");
            assert!(sky.radiance(-w)[channel] < 0.101, "{name} {w}");
        }
    }
}

#[test]
fn what_is_no_radiance_is_counted_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let odd = exr(folder.path(), "odd.exr", (8, 4), |x, y| match (x, y) {
        (0, 0) => Vec3::new(f32::NAN, 1.0, f32::INFINITY),
        (1, 0) => Vec3::new(-1.0, 2.0, 3.0),
        _ => Vec3::ONE,
    });
    let (sky, warnings) = read_environment(&odd).unwrap();
    assert_eq!(
        warnings,
        ["1 samples are negative, and taken as 0", "2 samples are not finite, and taken as 0"]
    );
    assert_eq!(sky.picture().row(0)[..2], [Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 2.0, 3.0)]);
    let black = exr(folder.path(), "black.exr", (8, 4), |_, _| Vec3::ZERO);
    assert_eq!(read_environment(&black).unwrap().1, ["is black"]);
    let message = |path: &Path| read_environment(path).unwrap_err().to_string();
    let square = exr(folder.path(), "square.exr", (5, 5), |_, _| Vec3::ONE);
    assert!(
        message(&square).contains("is 5 × 5; an environment is twice as wide as high"),
        "{}",
        message(&square)
    );
    let bytes = folder.path().join("bytes.png");
    let mut encoder = png::Encoder::new(std::fs::File::create(&bytes).unwrap(), 8, 4);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&[9; 96]).unwrap();
    assert!(message(&bytes).contains("is of integers"), "{}", message(&bytes));
    let mut cut = std::fs::read(&odd).unwrap();
    cut.truncate(cut.len() / 2);
    std::fs::write(&odd, cut).unwrap();
    assert!(message(&odd).contains("odd.exr"));
    assert!(message(Path::new("builtin:nowhere")).contains("built in are white, sky, studio"));
}
