//! Conformance suite: what every row of the table must satisfy. No test is written for one method.

use glam::{DVec3, Vec2, Vec3};

use super::elliptic::Elliptic;
use super::{AnyMethod, FlatLobe, Method, Representation, TABLE};
use crate::bake::Bake;
use crate::brdf::{self, AnyLobe, Lobe};
use crate::fit::Alignment;
use crate::grid::{Grid, Size};
use crate::procedural;
use crate::pyramid::Precision;
use crate::sphere::{DiskLattice, gauss_legendre, legendre};
use crate::surface::{NormalGrid, Surface, SurfaceRow, Wraps, normal_of_slope};

fn method(spelling: &str) -> AnyMethod {
    spelling.parse().unwrap()
}

fn methods() -> Vec<AnyMethod> {
    let table = TABLE.iter().flat_map(|row| row.samples).map(|s| method(s));
    // A method whose lobes have six statistics, in two layers each.
    table.chain([AnyMethod::from(Elliptic::new(2))]).collect()
}

fn of_normals(size: (usize, usize), normal: impl FnMut(usize, usize) -> Vec3) -> NormalGrid {
    let size = Size::new(size.0, size.1).unwrap();
    NormalGrid { normals: Grid::from_fn(size, normal), wraps: Wraps::default() }
}

fn bake(method: &dyn Method, surface: &dyn Surface, precision: Precision) -> crate::pyramid::Pyramid {
    Bake::new(surface, method).precision(precision).to_pyramid().unwrap().0
}

/// Totals that do not depend on how normals are shared out among lobes: the channels, summed over fitted
/// lobes.
fn totals(method: &dyn Method, channels: &[f32]) -> Vec<f32> {
    let Some(layout) = method.lobe_layout().filter(|_| method.fit().is_some()) else {
        return channels.to_vec();
    };
    let each = 4 * layout.layers_each;
    let statistics = method.fit().map_or(each, |fit| fit.kind.statistics());
    (0..statistics).map(|c| channels.iter().skip(c).step_by(each).sum()).collect()
}

#[test]
fn spellings_round_trip() {
    for row in TABLE {
        assert!(!row.samples.is_empty(), "{}", row.name);
        for sample in row.samples {
            assert_eq!(method(sample).to_string(), *sample);
        }
    }
}

#[test]
fn bad_spellings_say_why() {
    let message = |s: &str| s.parse::<AnyMethod>().unwrap_err().to_string();
    assert_eq!(message("vfm:4"), "there is no method called `vfm`");
    assert_eq!(message("toksvig:3"), "method `toksvig:3`: takes no parameter");
    assert_eq!(message("naive:3"), "method `naive:3`: takes `unnormalised`, or nothing");
    assert!(message("vmf:2:parent=3").contains("only `prior` has a strength"));
    assert_eq!(
        message("sh:99"),
        "method `sh:99`: the order must be a whole number from 2 to 16, as in `sh:7`"
    );
    assert_eq!(message("sh"), "method `sh`: the order must be a whole number from 2 to 16, as in `sh:7`");
    assert!(message("ndm:round").starts_with("method `ndm:round`: `round` is no kernel"));
    assert!(message("ndm:brdf:integrated").contains("before the BRDF is known"));
    assert!(message("ndm:gaussian:pearson").contains("second word"));
    assert!(message("vmf").contains("whole number from 1 to 8, as in `vmf:4`"));
    assert!(message("gmm:9").contains("whole number from 1 to 8, as in `gmm:4`"));
    assert!(
        message("vmf:4:algined")
            .contains("no alignment; there are refined, parent, prior, matched, unaligned")
    );
    assert!(message("gmm:4:parent:origin").contains("no more"));
}

#[test]
fn rows_equal_texels_one_by_one() {
    // Whole rows may take a faster way; its bits must be those of the plain one.
    fn plain<R: Representation>(representation: &R, row: &SurfaceRow) -> Vec<f32> {
        let width = row.width();
        let mut channels = vec![0.0; representation.layers() * 4 * width];
        for i in 0..width {
            let mut sums = representation.zero();
            let sample = super::Sample { normal: row.normal(i), height: row.height[i], spread: [0.0; 3] };
            representation.accumulate(&mut sums, &sample, 1.0);
            let mut texel = vec![0.0; representation.layers() * 4];
            representation.pack(&sums, &mut texel);
            for (c, value) in texel.iter().enumerate() {
                channels[((c / 4) * width + i) * 4 + c % 4] = *value;
            }
        }
        channels
    }
    let surface = (procedural::find("foil").unwrap().build)(Size::new(37, 5).unwrap());
    let mut row = SurfaceRow::flat(37);
    surface.read_row(2, &mut row);
    let mut fast = vec![0.0; 37 * 8];
    Method::accumulate_row(&super::Slopes::default(), &row, &mut fast);
    assert_eq!(fast, plain(&super::Slopes::default(), &row));
}

/// The lobe cut at an order, its ringing clamped as the method clamps it.
fn band_limited(lobe: &dyn Lobe, order: usize, u: f64) -> f64 {
    let rho = lobe.zonal(order);
    let series = |l: usize| (2 * l + 1) as f64 / (4.0 * std::f64::consts::PI) * rho[l];
    legendre(order, u).iter().enumerate().map(|(l, p)| series(l) * p).sum::<f64>().max(0.0)
}

#[test]
fn a_flat_map_gives_back_the_brdf_at_every_level() {
    let flat = of_normals((20, 12), |_, _| Vec3::Z);
    let lattice = DiskLattice::new(24, 0.97);
    for method in methods() {
        let pyramid = bake(&*method, &flat, Precision::Single);
        for spelling in brdf::TABLE.iter().flat_map(|row| row.samples) {
            let lobe = spelling.parse::<AnyLobe>().unwrap();
            let evaluator = method.evaluator(&*lobe, &lattice.directions);
            let peak = lobe.evaluate(1.0);
            for (level, size) in pyramid.sizes().iter().enumerate() {
                let mut got = vec![0.0; lattice.len()];
                evaluator.evaluate(&pyramid.texel(level, size.width - 1, size.height / 2), &mut got);
                for (got, w) in got.iter().zip(&lattice.directions) {
                    let expected = match method.flat_lobe(&*lobe) {
                        FlatLobe::Exact => lobe.evaluate(w.z),
                        FlatLobe::BandLimited(_) if method.to_string().ends_with("printed") => continue,
                        FlatLobe::BandLimited(order) => band_limited(&*lobe, order, w.z),
                        FlatLobe::OwnKernel => continue,
                    };
                    // 1e-4 of the peak is the promise; single-precision storage leaves about 1e-6.
                    // A mean that is not renormalised is short by 1e-6, and an exponent of 400 makes that
                    // 2.4e-4.
                    let bound = if method.to_string() == "naive:unnormalised" { 3e-4 } else { 1e-4 };
                    let error = (got - expected).abs() / peak;
                    assert!(error < bound, "{} {spelling} level {level} {w}: {got} {expected}", method);
                }
            }
        }
    }
}

#[test]
fn a_lobe_within_the_band_limit_comes_back_whole() {
    // sh:16 holds Blinn-Phong up to s = 10 to 1e-4: rho_17 = exp(-17²/20) = 5e-7, times 35/4pi.
    let flat = of_normals((4, 4), |_, _| Vec3::Z);
    let method = method("sh:16");
    let pyramid = bake(&*method, &flat, Precision::Single);
    let lattice = DiskLattice::new(24, 0.97);
    for spelling in ["blinn-phong:3", "blinn-phong:10"] {
        let lobe = spelling.parse::<AnyLobe>().unwrap();
        let mut got = vec![0.0; lattice.len()];
        method.evaluator(&*lobe, &lattice.directions).evaluate(&pyramid.texel(1, 0, 0), &mut got);
        for (got, w) in got.iter().zip(&lattice.directions) {
            assert!((got - lobe.evaluate(w.z)).abs() < 1e-4 * lobe.evaluate(1.0), "{spelling} {w}");
        }
    }
}

#[test]
fn a_constant_map_is_the_same_at_every_level() {
    let n = Vec3::new(0.3, -0.2, 0.8).normalize();
    let tilted = of_normals((13, 7), |_, _| n);
    for method in methods() {
        let pyramid = bake(&*method, &tilted, Precision::Single);
        let fine = pyramid.texel(0, 0, 0);
        let last = pyramid.sizes().len() - 1;
        let (fine, coarse) = (totals(&*method, &fine), totals(&*method, &pyramid.texel(last, 0, 0)));
        for (a, b) in fine.iter().zip(coarse) {
            // Averages of equal numbers: rounding of single floats only. The integrated factors are
            // computed from moments whose covariance is nothing but that rounding.
            let tolerance = if method.to_string().contains("integrated") { 1e-3 } else { 2e-6 };
            assert!((a - b).abs() <= tolerance * a.abs().max(1.0), "{} {a} {b}", method);
        }
    }
}

#[test]
fn levels_are_area_weighted_means_of_the_finest() {
    // The direct mean, from nothing but footprints, at sizes where no level nests in the one before.
    let size = Size::new(21, 13).unwrap();
    let surface = (procedural::find("armour").unwrap().build)(size);
    for method in methods().iter().filter(|m| !m.to_string().contains("integrated") && m.filterable()) {
        let pyramid = bake(&**method, &*surface, Precision::Single);
        let mut row = SurfaceRow::flat(21);
        let mut fine = Vec::new();
        for y in 0..13 {
            surface.read_row(y, &mut row);
            let mut values = vec![0.0; 21 * 4 * method.layers()];
            method.accumulate_row(&row, &mut values);
            if let Some(layout) = method.lobe_layout() {
                // All in the first lobe's layers, which are also their sum; other lobes' spare channels are
                // ones.
                values.truncate(21 * 4 * layout.layers_each);
            }
            fine.push(values);
        }
        for (level, coarse) in pyramid.sizes().iter().enumerate() {
            for (x, y) in [(0, 0), (coarse.width - 1, coarse.height - 1), (coarse.width / 2, 0)] {
                let got = totals(&**method, &pyramid.texel(level, x, y));
                for (c, got) in got.iter().enumerate() {
                    let mut expected = 0.0;
                    let overlap = |fine: usize, coarse: usize, i: usize, j: usize| {
                        let (a, b) = (
                            i as f64 * fine as f64 / coarse as f64,
                            (i + 1) as f64 * fine as f64 / coarse as f64,
                        );
                        (b.min((j + 1) as f64) - a.max(j as f64)).max(0.0) / (b - a)
                    };
                    for (j, values) in fine.iter().enumerate() {
                        for i in 0..21 {
                            let weight = overlap(21, coarse.width, x, i) * overlap(13, coarse.height, y, j);
                            expected += weight * f64::from(values[((c / 4) * 21 + i) * 4 + c % 4]);
                        }
                    }
                    // Sums of up to 273 single floats. Lobes too light to store give their 1/8192 to the
                    // others. The prior and refinement move means on purpose; the bound is what a picture
                    // would hardly show.
                    let tolerance = match method.fit().map(|f| f.alignment) {
                        None => 1e-5,
                        Some(Alignment::Refined | Alignment::Prior) => 0.1,
                        Some(_) => 5e-4,
                    };
                    let error = (f64::from(*got) - expected).abs();
                    assert!(error < tolerance * expected.abs().max(1.0), "{} {level} {x} {y} {c}", method);
                }
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let surface = (procedural::find("foil").unwrap().build)(Size::new(131, 67).unwrap());
    for method in methods() {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| bake(&*method, &*surface, Precision::Half))
        };
        let one = with(1);
        assert!(one == with(2) && one == with(8), "{}", method);
    }
}

#[test]
fn degenerate_normals_stay_finite() {
    // Horizon, below it, straight down, opposite pairs that cancel: nothing may become NaN.
    let nasty = [Vec3::X, Vec3::NEG_Z, Vec3::NEG_X, Vec3::new(0.6, 0.0, -0.8), Vec3::Y, Vec3::Z];
    let surface = of_normals((6, 5), |x, y| nasty[(x + y) % 6]);
    let lattice = DiskLattice::new(12, 0.97);
    for method in methods() {
        for precision in [Precision::Half, Precision::Single] {
            let pyramid = bake(&*method, &surface, precision);
            for spelling in ["lambert", "blinn-phong:50", "ggx:0.01", "beckmann:0.5", "torrance-sparrow:0.1"]
            {
                let lobe = spelling.parse::<AnyLobe>().unwrap();
                let evaluator = method.evaluator(&*lobe, &lattice.directions);
                for (level, size) in pyramid.sizes().iter().enumerate() {
                    for i in 0..size.area() {
                        let mut out = vec![0.0; lattice.len()];
                        evaluator.evaluate(&pyramid.texel(level, i % size.width, i / size.width), &mut out);
                        assert!(
                            out.iter().all(|f| f.is_finite() && *f >= 0.0),
                            "{} {spelling} level {level}",
                            method
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn lobes_of_degenerate_maps_have_weights_that_sum_to_one_and_point_somewhere() {
    // Constant, two normals only, one texel, at and below the horizon, and fewer distinct normals than lobes.
    let two = [Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8)];
    let nasty = [Vec3::X, Vec3::NEG_Z, Vec3::NEG_X, Vec3::new(0.6, 0.0, -0.8), Vec3::Y, Vec3::Z];
    let maps = [
        of_normals((8, 8), |_, _| Vec3::Z),
        of_normals((8, 8), |x, y| two[(x + y) % 2]),
        of_normals((1, 1), |_, _| two[0]),
        of_normals((12, 7), |x, y| nasty[(x + 2 * y) % 6]),
    ];
    for method in methods().iter().filter(|m| m.fit().is_some()) {
        for (surface, precision) in maps.iter().flat_map(|m| [(m, Precision::Half), (m, Precision::Single)]) {
            let pyramid = bake(&**method, surface, precision);
            for (level, size) in pyramid.sizes().iter().enumerate() {
                for i in 0..size.area() {
                    let texel = pyramid.texel(level, i % size.width, i / size.width);
                    let decoded = method.describe(&texel);
                    let lobes: Vec<(f64, DVec3)> =
                        decoded.lobes().iter().map(|l| (l.weight, l.mean)).collect();
                    assert!(!lobes.is_empty(), "{method} decodes to {decoded:?}");
                    let total: f64 = lobes.iter().map(|l| l.0).sum();
                    // Peaks are not divided by their sum: eight rounded half floats.
                    assert!((total - 1.0).abs() < 2e-3, "{} level {level}: {lobes:?}", method);
                    let points = |m: DVec3| m.is_finite() && (m.z == 0.0 || (m.length() - 1.0).abs() < 1e-6);
                    assert!(lobes.iter().all(|l| l.0 > 0.0 && points(l.1)), "{}", method);
                }
            }
        }
    }
}

#[test]
fn half_floats_and_sharp_lobes_stay_in_bounds() {
    // Rounded moments of almost flat texels are where a covariance turns indefinite. No effective lobe of
    // a distribution exceeds the lobe's own peak; methods that only approximate one get a factor of 20.
    let surface = (procedural::find("dunes").unwrap().build)(Size::new(128, 128).unwrap());
    let lattice = DiskLattice::new(96, 0.97);
    for method in methods() {
        let pyramid = bake(&*method, &*surface, Precision::Half);
        for spelling in ["beckmann:0.01", "blinn-phong:20000", "ggx:0.003"] {
            let lobe = spelling.parse::<AnyLobe>().unwrap();
            let evaluator = method.evaluator(&*lobe, &lattice.directions);
            for i in 0..256 {
                let mut out = vec![0.0; lattice.len()];
                evaluator.evaluate(&pyramid.texel(1, i % 64, i / 4), &mut out);
                let bound = 20.0 * lobe.evaluate(1.0);
                assert!(out.iter().all(|f| *f >= 0.0 && *f <= bound), "{} {spelling} texel {i}", method);
            }
        }
    }
}

#[test]
fn any_finite_channels_decode_to_something_finite() {
    // Values that a damaged but well-formed file can hold.
    for method in methods() {
        let lobe = "blinn-phong:50".parse::<AnyLobe>().unwrap();
        let directions = [DVec3::Z, DVec3::new(0.6, 0.0, 0.8)];
        let evaluator = method.evaluator(&*lobe, &directions);
        for fill in [0.0, 1.0, -1.0, 65504.0, -65504.0, 1e-7] {
            let channels = vec![fill; 4 * method.layers()];
            let mut out = [0.0; 2];
            evaluator.evaluate(&channels, &mut out);
            assert!(out.iter().all(|f| f.is_finite()), "{} {fill} {out:?}", method);
        }
    }
}

#[test]
fn effective_lobes_keep_their_energy() {
    // The integral over all directions of the effective lobe is rho_0 of the BRDF, whatever the normals, for
    // methods that promise to be distributions. `fixed` and `naive` promise it too: they only misplace it.
    // Normals that are not renormalised go dark. Ndm's partial normalisation does not, by its own account;
    // spherical harmonics only where they reach the lobe, L² > 4 s (Han et al., section 5.1): below, clamped
    // ringing adds energy.
    let surface = of_normals((8, 8), |x, y| {
        normal_of_slope(Vec2::new(
            0.25 * ((x * 5 + y) % 8) as f32 / 8.0,
            0.2 * ((y * 3 + x) % 8) as f32 / 8.0 - 0.1,
        ))
    });
    let mut directions = Vec::new();
    let mut weights = Vec::new();
    // A lobe of exponent 200 is four degrees wide; a hundred and sixty rings are half a degree apart there.
    for (z, weight) in gauss_legendre(160) {
        for k in 0..160 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 160.0).sin_cos();
            let r = (1.0 - z * z).sqrt();
            directions.push(DVec3::new(r * cos, r * sin, z));
            weights.push(weight * std::f64::consts::TAU / 160.0);
        }
    }
    for (spelling, exponent) in [("blinn-phong:8", 8.0), ("blinn-phong:30", 30.0), ("blinn-phong:200", 200.0)]
    {
        let lobe = spelling.parse::<AnyLobe>().unwrap();
        for method in methods() {
            let name = method.to_string();
            let too_narrow = matches!(
                method.flat_lobe(&*lobe),
                FlatLobe::BandLimited(order) if ((order * order) as f64) < 4.0 * exponent
            );
            // The stereographic density is one around the pole alone.
            let goes_dark = name == "naive:unnormalised" || name == "stereographic";
            // Factors for another exponent are none of this lobe's.
            let foreign = name.contains("integrated=");
            let unnormalised = name.starts_with("ndm") && !name.contains("integrated");
            if goes_dark || too_narrow || foreign || unnormalised {
                continue;
            }
            let pyramid = bake(&*method, &surface, Precision::Single);
            let mut out = vec![0.0; directions.len()];
            method.evaluator(&*lobe, &directions).evaluate(&pyramid.texel(3, 0, 0), &mut out);
            let total: f64 = out.iter().zip(&weights).map(|(f, w)| f * w).sum();
            let bound = match name.split(':').next() {
                // A Gaussian of the plane lies on more than its area of the sphere, by the cosine there, and
                // the wide one of exponent 8 reaches the horizon: measured 0.22, and 0.05 at 30.
                Some("gmm") if name.ends_with(":printed") => 0.24,
                // The plane places a lobe by shifting it, which only near the vertical is a rotation: 0.020.
                Some("gmm") => 0.021,
                // Ringing below zero is clamped: 0.010, and 0.037 with the printed coefficients.
                Some("sh") => {
                    if name.ends_with(":printed") {
                        0.038
                    } else {
                        0.011
                    }
                }
                // Factors are interpolated between three roughnesses: 0.0021.
                Some("ndm") => 0.0025,
                Some("vmf") if name.ends_with(":series") => 0.011,
                // Single floats, magnified by the exponent.
                _ => 1e-4,
            };
            assert!((total - 1.0).abs() < bound, "{spelling} {name} {total}");
        }
    }
}

#[test]
fn a_texel_has_the_form_that_its_method_says() {
    for method in methods() {
        let channels = vec![0.5; 4 * method.layers()];
        assert_eq!(method.form_of(&channels), method.form_kind(), "{method}");
        assert_eq!(method.shader().form(), method.form_kind(), "{method}");
    }
}
