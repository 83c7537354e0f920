//! Surfaces whose answers are known in closed form.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use glam::DVec3;
use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::AnyLobe;
use ndfmap_core::grid::Size;
use ndfmap_core::measure::{DISK_RADIUS, TexelTruth};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::procedural::{self, GROOVE_SLOPE};
use ndfmap_core::pyramid::Precision;
use ndfmap_core::sphere::DiskLattice;
use ndfmap_core::surface::Surface;
use ndfmap_core::units::SlopeVariance;

fn groove() -> Box<dyn Surface> {
    (procedural::find("v-groove").unwrap().build)(Size::new(64, 64).unwrap())
}

fn flanks() -> [DVec3; 2] {
    let slope = f64::from(GROOVE_SLOPE);
    [-slope, slope].map(|x| DVec3::new(x, 0.0, 1.0).normalize())
}

/// The effective lobe of the coarsest texel at these directions.
fn coarsest(surface: &dyn Surface, method: &str, lobe: &str, directions: &[DVec3]) -> Vec<f64> {
    let (method, lobe) = (method.parse::<AnyMethod>().unwrap(), lobe.parse::<AnyLobe>().unwrap());
    let bake = Bake::new(surface, &*method).precision(Precision::Single);
    let (pyramid, _) = bake.to_pyramid().unwrap();
    let mut out = vec![0.0; directions.len()];
    let texel = pyramid.texel(pyramid.sizes().len() - 1, 0, 0);
    method.evaluator(&*lobe, directions).evaluate(&texel, &mut out);
    out
}

#[test]
fn a_v_groove_has_two_lobes() {
    let lobe = "blinn-phong:400".parse::<AnyLobe>().unwrap();
    let lattice = DiskLattice::new(201, DISK_RADIUS);
    let surface = groove();
    let truth = TexelTruth::new(&*surface, &*lobe, &lattice).texel(Size::new(1, 1).unwrap(), 0, 0);
    // Along the middle row, y = 0, exactly two maxima, at the flanks' n.x = ± 0.447.
    let (_, middle) = lattice.rows.iter().find(|(y, _)| y.abs() < 1e-9).unwrap();
    let row: Vec<(f64, f64)> = middle.clone().map(|i| (lattice.directions[i].x, truth[i])).collect();
    let peaks: Vec<f64> =
        row.windows(3).filter(|w| w[1].1 > w[0].1 && w[1].1 > w[2].1).map(|w| w[1].0).collect();
    assert_eq!(peaks.len(), 2, "{peaks:?}");
    for (peak, flank) in peaks.iter().zip([-0.4472, 0.4472]) {
        assert!((peak - flank).abs() < 0.01, "{peak} for {flank}: the lattice's step");
    }
    // One lobe cannot: Toksvig and naive put their maximum where no normal points.
    let up = coarsest(&*surface, "toksvig", "blinn-phong:400", &[DVec3::Z, flanks()[1]]);
    assert!(up[0] > up[1]);
}

#[test]
fn sh_2_shades_a_v_groove_with_lambert_in_closed_form() {
    // max(u, 0) to order 2 is 1/4 + u/2 + 5 (3u²-1)/32 (Ramamoorthi and Hanrahan 2001), averaged over
    // the two flanks.
    let directions: Vec<DVec3> = (0..20)
        .map(|i| {
            let (angle, z) = (f64::from(i) * 0.7, 1.0 - f64::from(i) * 0.07);
            let r = f64::sqrt(1.0 - z * z);
            DVec3::new(r * angle.cos(), r * angle.sin(), z)
        })
        .collect();
    let series = |u: f64| 0.25 + u / 2.0 + 5.0 * (3.0 * u * u - 1.0) / 32.0;
    for (got, w) in coarsest(&*groove(), "sh:2", "lambert", &directions).iter().zip(&directions) {
        let expected = flanks().iter().map(|n| series(w.dot(*n))).sum::<f64>() / 2.0;
        // Coefficients in single floats.
        assert!((got - expected.max(0.0)).abs() < 1e-6, "{w}: {got} {expected}");
    }
    // And the truth itself, which order 2 meets to about 0.03 of a full cosine.
    let lambert = "lambert".parse::<AnyLobe>().unwrap();
    let lattice = DiskLattice::new(16, DISK_RADIUS);
    let surface = groove();
    let truth = TexelTruth::new(&*surface, &*lambert, &lattice).texel(Size::new(1, 1).unwrap(), 0, 0);
    let sh = coarsest(&*surface, "sh:2", "lambert", &lattice.directions);
    assert!(truth.iter().zip(sh).all(|(t, s)| (t - s).abs() < 0.04));
}

#[test]
fn gaussian_noise_is_what_slopes_are_exact_for() {
    // On Gaussian slopes with a Beckmann lobe, LEAN's Gaussian is the truth up to the weight of steep
    // normals; Toksvig, isotropic, is not, when the noise is anisotropic.
    let size = Size::new(256, 256).unwrap();
    let (x, y) = (SlopeVariance::new(0.04).unwrap(), SlopeVariance::new(0.005).unwrap());
    let surface = procedural::gaussian_noise(size, x, y, 3);
    let lobe = "beckmann:0.2".parse::<AnyLobe>().unwrap();
    let lattice = DiskLattice::new(64, DISK_RADIUS);
    let truth = TexelTruth::new(&*surface, &*lobe, &lattice).texel(Size::new(1, 1).unwrap(), 0, 0);
    let error = |method: &str| {
        let approx = coarsest(&*surface, method, "beckmann:0.2", &lattice.directions);
        let norm = |f: &dyn Fn(usize) -> f64| (0..truth.len()).map(|i| f(i).powi(2)).sum::<f64>().sqrt();
        norm(&|i| approx[i] - truth[i]) / norm(&|i| truth[i])
    };
    let (slopes, toksvig) = (error("slopes"), error("toksvig"));
    // 128 waves are not quite a Gaussian: kurtosis off by some percent, hence 0.06.
    assert!(slopes < 0.06 && toksvig > 4.0 * slopes, "slopes {slopes} toksvig {toksvig}");
}
