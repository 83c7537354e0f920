//! MERL files: one made from a published fit is read as what it holds, and others say what is wrong with
//! them.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;
use ndfmap_core::brdf::{AnyLobe, PublishedFit, measured::published};
use ndfmap_maps::merl::{parse_merl, read_merl};

const BINS: usize = 90;
const TURNS: usize = 180;

/// Directions to the light and to the eye in the middle of a bin.
fn directions(h: usize, d: usize, p: usize) -> (DVec3, DVec3) {
    let part = (h as f64 + 0.5) / BINS as f64;
    let (sin_h, cos_h) = (part * part * PI / 2.0).sin_cos();
    let (sin_d, cos_d) = ((d as f64 + 0.5) / BINS as f64 * PI / 2.0).sin_cos();
    let (sin_p, cos_p) = ((p as f64 + 0.5) / TURNS as f64 * PI).sin_cos();
    // The difference vector, turned by the half angle about y.
    let (x, y, z) = (sin_d * cos_p, sin_d * sin_p, cos_d);
    let wi = DVec3::new(cos_h * x + sin_h * z, y, cos_h * z - sin_h * x);
    let wh = DVec3::new(sin_h, 0.0, cos_h);
    (wi, wh * (2.0 * wh.dot(wi)) - wi)
}

/// A MERL table of a material, as the database has them: unmeasured directions are negative.
fn table(material: &str) -> Vec<u8> {
    let reflectance = published(PublishedFit::Sgd, material).unwrap();
    let mut bytes: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    let mut channels = [const { Vec::new() }; 3];
    for h in 0..BINS {
        for d in 0..BINS {
            for p in 0..TURNS {
                let (wi, wo) = directions(h, d, p);
                let below = wi.z <= 0.0 || wo.z <= 0.0;
                let value = if below { DVec3::splat(-1.0) } else { reflectance(wi, wo) };
                let scales = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
                channels.iter_mut().zip(value.to_array()).zip(scales).for_each(|((c, v), s)| c.push(v / s));
            }
        }
    }
    bytes.extend(channels.iter().flatten().flat_map(|v: &f64| v.to_le_bytes()));
    bytes
}

#[test]
fn a_table_is_read_as_what_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gold.binary");
    let mut bytes = table("gold-metallic-paint");
    // No number, in one place that the light reaches.
    bytes[12..20].copy_from_slice(&f64::NAN.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    let (read, missing) = read_merl(&path).unwrap();
    let below = bytes[12..].as_chunks::<8>().0.iter().filter(|v| f64::from_le_bytes(**v) < 0.0).count();
    assert_eq!(missing, below + 1);
    let built_in = "sgd:gold-metallic-paint".parse::<AnyLobe>().unwrap();
    let itself = built_in.measured().unwrap();
    // In the middle of bins the table holds the material itself, in single floats.
    for (h, d, p) in [(0, 10, 0), (7, 40, 90), (30, 20, 45), (50, 5, 179)] {
        let (wi, wo) = directions(h, d, p);
        let (got, expected) = (read.reflectance(wi, wo), itself.reflectance(wi, wo));
        assert!((got - expected).length() < 1e-6 * expected.length(), "{h} {d} {p}: {got} {expected}");
    }
    let (a, b) = (read.factors(), itself.factors());
    // The built-in one takes sixteen turns of the difference where the file has 180, of a fit that hardly
    // depends on them but near the horizon: measured 2.2 % of a diffuse part that is nearly nothing.
    // Highlights are held to less.
    assert!((a.diffuse - b.diffuse).length() < 0.025 * b.diffuse.length(), "{} {}", a.diffuse, b.diffuse);
    for (u, difference) in [(1.0, 1.0), (0.99, 0.8), (0.95, 0.9), (0.8, 0.6)] {
        let (f, g) = (read.factored(u, difference), itself.factored(u, difference));
        assert!((f - g).length() < 0.02 * g.length(), "{u} {difference}: {f} {g}");
    }
    assert!((a.residual.fitted - b.residual.fitted).abs() < 0.002, "{:?} {:?}", a.residual, b.residual);
    assert_eq!(read.to_string(), format!("merl:{}", path.display()));
}

#[test]
fn what_is_no_table_says_why() {
    let path = Path::new("some.binary");
    let message = |bytes: &[u8]| parse_merl(path, bytes).unwrap_err().to_string();
    assert_eq!(message(b""), "some.binary: has 0 bytes, not even the header of a MERL table");
    let header = |n: [i32; 3]| n.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    assert_eq!(
        message(&header([90, 90, 90])),
        "some.binary: is no MERL table: it begins with 90 × 90 × 90, not 90 × 90 × 180"
    );
    assert_eq!(message(&header([-1, i32::MAX, 180])).split(':').nth(1), Some(" is no MERL table"));
    assert_eq!(message(&header([90, 90, 180])), "some.binary: has 12 bytes; a MERL table has 34992012");
    let mut all = header([90, 90, 180]);
    all.extend(std::iter::repeat_n((-1.0_f64).to_le_bytes(), 3 * 90 * 90 * 180).flatten());
    assert_eq!(message(&all), "some.binary: holds no value that is not negative");
    let folder = tempfile::tempdir().unwrap();
    let large = folder.path().join("large.binary");
    all.push(0);
    std::fs::write(&large, &all).unwrap();
    let told = read_merl(&large).unwrap_err().to_string();
    assert!(told.ends_with("has 34992013 bytes; a MERL table has 34992012"), "{told}");
    let missing = read_merl(&folder.path().join("nowhere")).unwrap_err().to_string();
    assert!(missing.contains("nowhere"), "{missing}");
}
