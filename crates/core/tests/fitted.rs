//! Fitted lobes and diffuse light: the mean normal of a texel is kept, whatever the fit does.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::lookup::area_mean;
use ndfmap_core::measure::{DISK_RADIUS, TexelTruth};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::procedural;
use ndfmap_core::pyramid::{Precision, Pyramid};
use ndfmap_core::sphere::DiskLattice;
use ndfmap_core::surface::{Surface, SurfaceRow};

fn map(name: &str, width: usize, height: usize) -> Box<dyn Surface> {
    (procedural::find(name).unwrap().build)(Size::new(width, height).unwrap())
}

fn baked(surface: &dyn Surface, method: &str) -> (AnyMethod, Pyramid) {
    let method = method.parse::<AnyMethod>().unwrap();
    let pyramid = Bake::new(surface, &*method).precision(Precision::Single).to_pyramid().unwrap().0;
    (method, pyramid)
}

/// Normals of a surface; the fourth is one.
fn normals(surface: &dyn Surface) -> Grid<[f32; 4]> {
    let size = surface.size();
    let mut texels = Vec::new();
    let mut row = SurfaceRow::flat(size.width);
    for y in 0..size.height {
        surface.read_row(y, &mut row);
        texels.extend((0..size.width).map(|x| row.normal(x).extend(1.0).to_array()));
    }
    Grid::from_fn(size, |x, y| texels[y * size.width + x])
}

#[test]
fn lobes_keep_the_mean_normal() {
    for name in ["foil", "armour", "carved-disk"] {
        // Odd sides, where texels share the normals on their edges.
        let surface = map(name, 45, 32);
        let normals = normals(&*surface);
        for method in ["vmf:2", "vmf:4", "vmf:6", "gmm:4", "vmf:4:parent", "gmm:3:unaligned", "vmf:3:matched"]
        {
            let (_, pyramid) = baked(&*surface, method);
            let mut worst = 0.0_f32;
            for (level, size) in pyramid.sizes().iter().enumerate() {
                for (x, y) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y))) {
                    let [nx, ny, nz, _] = area_mean(&normals, *size, x, y);
                    let mut sums = [0.0_f32; 4];
                    for lobe in pyramid.texel(level, x, y).as_chunks::<4>().0 {
                        (0..4).for_each(|k| sums[k] += lobe[k]);
                    }
                    let [weight, sx, sy, w] = sums;
                    worst = worst.max((weight - 1.0).abs()).max((sx - nx).abs()).max((sy - ny).abs());
                    if method.starts_with("vmf") {
                        worst = worst.max((w - (1.0 - nz)).abs());
                    }
                }
            }
            // Single floats of two summations: 1.9e-6 is measured. Lobes refined freely were 0.089 off.
            assert!(worst < 2e-6, "{name} {method}: {worst}");
        }
    }
}

#[test]
fn diffuse_light_of_fitted_lobes_is_better_than_toksvigs() {
    let lambert = "lambert".parse::<AnyLobe>().unwrap();
    let lattice = DiskLattice::new(32, DISK_RADIUS);
    let surface = map("foil", 64, 64);
    let errors = |method: &str| {
        let (method, pyramid) = baked(&*surface, method);
        let truth = TexelTruth::new(&*surface, &*lambert, &lattice);
        let mut out = vec![0.0; lattice.directions.len()];
        let (mut off, mut all) = (0.0, 0.0);
        for (level, size) in pyramid.sizes().iter().enumerate().skip(2) {
            for (x, y) in (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y))) {
                method
                    .evaluator(&*lambert, &lattice.directions)
                    .evaluate(&pyramid.texel(level, x, y), &mut out);
                for (truth, made) in truth.texel(*size, x, y).iter().zip(&out) {
                    off += (truth - made) * (truth - made);
                    all += truth * truth;
                }
            }
        }
        f64::sqrt(off / all)
    };
    let toksvig = errors("toksvig");
    // Measured: 0.502, 0.341, 0.882 and 0.288. Lobes refined freely had 5.7, 3.1 and 37.
    for (method, ratio) in [("vmf:2", 0.52), ("vmf:4", 0.36), ("gmm:4", 0.91), ("vmf:4:parent", 0.31)] {
        let own = errors(method) / toksvig;
        assert!(own < ratio, "{method}: {own} of Toksvig's error");
    }
}
