//! FLIP against its authors' own program, by `nv-flip`, and against its closed forms.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::{Vec2, Vec3};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_scene::metrics::{Picture, PixelsPerDegree, flip, flip_map, to_bytes};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Sizes, tiny and odd: less than the filters' reach, and more.
const SIZES: [(usize, usize); 6] = [(1, 1), (2, 1), (1, 3), (7, 5), (33, 17), (129, 65)];

/// Pictures to compare.
struct Pair {
    name: &'static str,
    a: Picture,
    b: Picture,
    /// True where their edges and points are different in all pixels.
    features_differ: bool,
}

fn pairs(size: Size) -> [Pair; 5] {
    [
        Pair { name: "noise", a: noise(size, 1), b: noise(size, 2), features_differ: true },
        Pair { name: "edges", a: edges(size, 5), b: edges(size, 4), features_differ: false },
        Pair { name: "gradients", a: gradients(size, 0.2), b: gradients(size, 0.3), features_differ: false },
        Pair { name: "sphere", a: sphere(size, 0.05), b: sphere(size, 0.0), features_differ: false },
        Pair { name: "noisy sphere", a: sphere(size, 0.5), b: sphere(size, 0.4), features_differ: true },
    ]
}

fn noise(size: Size, seed: u64) -> Picture {
    let mut random = Pcg64::seed_from_u64(seed);
    Grid::from_fn(size, |_, _| Vec3::from_array(random.random()))
}

/// Slanted stripes, so many of eleven pixels wide.
fn edges(size: Size, wide: usize) -> Picture {
    Grid::from_fn(size, |x, y| Vec3::splat(if (x + y / 3) % 11 < wide { 0.9 } else { 0.05 }))
}

fn gradients(size: Size, blue: f32) -> Picture {
    let part = |at: usize, all: usize| at as f32 / all as f32;
    Grid::from_fn(size, |x, y| Vec3::new(part(x, size.width), part(y, size.height), blue))
}

/// Sphere with a highlight brighter than white, before a blue sky, with so much noise.
fn sphere(size: Size, noise: f32) -> Picture {
    let mut random = Pcg64::seed_from_u64(1);
    let middle = Vec2::new(size.width as f32, size.height as f32) / 2.0;
    Grid::from_fn(size, |x, y| {
        let p = (Vec2::new(x as f32 + 0.5, y as f32 + 0.5) - middle) * 1.2 / middle.min_element();
        let colour = if p.length_squared() < 1.0 {
            let normal = Vec3::new(p.x, -p.y, (1.0 - p.length_squared()).sqrt());
            let cosine = normal.dot(Vec3::new(0.48, 0.64, 0.6)).max(0.0);
            Vec3::new(0.6, 0.3, 0.1) * cosine + Vec3::splat(cosine.powi(60))
        } else {
            Vec3::new(0.1, 0.2, 0.4)
        };
        colour * (1.0 + noise * (random.random::<f32>() - 0.5))
    })
}

fn flat(colour: Vec3) -> Picture {
    Grid::from_fn(Size { width: 5, height: 4 }, |_, _| colour)
}

/// Map of the authors' program.
fn theirs(picture: &Picture, truth: &Picture) -> Vec<f32> {
    let image = |p: &Picture| {
        let (Size { width, height }, bytes) = (p.size(), to_bytes(p, 1.0));
        nv_flip::FlipImageRgb8::with_data(width as u32, height as u32, bytes.texels().as_flattened())
    };
    let density = nv_flip::pixels_per_degree(0.7, 3840.0, 0.7);
    // Half a unit in float32's last place.
    assert!((f64::from(density) - PixelsPerDegree::SCREEN.get()).abs() < 4e-6);
    nv_flip::flip(image(truth), image(picture), density).to_vec()
}

#[test]
fn maps_are_those_of_the_authors_program() {
    for (width, height) in SIZES {
        let size = Size { width, height };
        for Pair { name, a, b, features_differ } in pairs(size) {
            let (ours, theirs) = (flip_map(&a, &b, 1.0), theirs(&a, &b));
            let differences =
                || ours.texels().iter().zip(&theirs).map(|(o, t)| f64::from(*o) - f64::from(*t));
            let pixel = differences().map(f64::abs).fold(0.0, f64::max);
            let mean = differences().sum::<f64>().abs() / theirs.len() as f64;
            println!(
                "{width} x {height} {name}: {:.4}, pixel {pixel:.1e}, mean {mean:.1e}",
                flip(&a, &b, 1.0)
            );
            // Theirs is float32. Where features are equal, its forty roundings, 2.4e-6 at most, are all that
            // is left of them. Their root enters the exponent, which changes an error of 1/e, where it does
            // most, by (2.4e-6 / sqrt 2)^(1/2) / e = 4.8e-4. Measured: 3.6e-4, and 7.5e-5 of a mean.
            assert!(pixel < 4.8e-4 && mean < 1e-4, "{width} x {height} {name}: {pixel:e}, mean {mean:e}");
            // Elsewhere roundings stay what they are. Measured: 5.5e-6, and 5.5e-8 of a mean.
            if features_differ && size.area() > 3 {
                assert!(pixel < 1e-5 && mean < 1e-7, "{width} x {height} {name}: {pixel:e}, mean {mean:e}");
            }
        }
    }
}

#[test]
fn flat_colours_have_their_closed_forms() {
    let [red, green, blue, black, white] =
        [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ZERO, Vec3::splat(7.0)].map(flat);
    // Of display value 10: on the curves' linear parts, so of lightness 903.3 times its light.
    let dark = flat(Vec3::splat(10.0 / 255.0 / 12.92));
    // By CIELAB's and FLIP's definitions, in rationals and double precision (Python). Green and blue are the
    // two that are farthest apart.
    let expected = [
        (&green, &blue, 1.0),
        (&white, &black, 0.967_379_761_5),
        (&red, &green, 0.986_662_275_2),
        (&red, &black, 0.970_497_336_6),
        (&dark, &black, 0.116_569_316_4),
    ];
    for (a, b, expected) in expected {
        // Half a unit in the last place of the map's float32.
        assert!((flip(a, b, 1.0) - expected).abs() < 3e-8, "{} {expected}", flip(a, b, 1.0));
    }
}

#[test]
fn equal_pictures_have_none_and_order_does_not_matter() {
    for (width, height) in SIZES {
        for Pair { name, a, b, .. } in pairs(Size { width, height }) {
            assert_eq!(flip(&a, &a, 1.0), 0.0, "{name}");
            assert_eq!(flip_map(&a, &b, 1.0), flip_map(&b, &a, 1.0), "{name}");
        }
    }
}

#[test]
fn the_same_map_for_any_number_of_threads() {
    let [Pair { a, b, .. }, ..] = pairs(Size { width: 33, height: 17 });
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| flip_map(&a, &b, 1.0))
    };
    assert_eq!(with(1), with(5));
}
