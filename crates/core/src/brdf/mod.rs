//! Bidirectional reflectance: how one normal sends light to the eye.
//!
//! A [`Brdf`] is a [`Lobe`] (the distribution of facets, `D`) in a [`ShadingModel`] (what multiplies it:
//! Fresnel's term, masking, the diffuse part). [`TABLE`] lists the lobes; a row buys the conformance tests at
//! the end of this file.

mod beckmann;
mod blinn_phong;
mod ggx;
mod lambert;
mod lobe;
pub mod measured;
mod microfacets;
mod shading;
mod table;
mod torrance_sparrow;

pub use beckmann::Beckmann;
pub use blinn_phong::BlinnPhong;
pub use ggx::Ggx;
pub use lambert::{Lambert, mean_of_positive_part};
pub use lobe::{AnyLobe, Argument, Lobe, LobeObject, Widen, zonal_by_quadrature};
pub use measured::{ChannelFactors, LobeFactors, Measured, MeasuredTable, PublishedFit};
pub use microfacets::Microfacets;
pub use shading::{Brdf, Directions, LEAST_COSINE, ShadingModel, SurfaceParams};
pub use table::{ALIASES, ParseLobeError, Row, TABLE};
pub use torrance_sparrow::TorranceSparrow;

use lobe::twin;
use table::number;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::SlopeVariance;

    fn samples() -> impl Iterator<Item = AnyLobe> {
        TABLE.iter().flat_map(|row| row.samples).map(|s| s.parse().unwrap())
    }

    #[test]
    fn spellings_round_trip() {
        for lobe in samples() {
            assert_eq!(lobe.to_string().parse::<AnyLobe>().unwrap(), lobe);
        }
        assert!(TABLE.iter().all(|row| !row.samples.is_empty()));
    }

    #[test]
    fn roughness_is_the_root_of_alpha() {
        let lobe = |spelling: &str| spelling.parse::<AnyLobe>().unwrap().to_string();
        assert_eq!(lobe("roughness:0.5"), "ggx:0.25");
        assert_eq!(lobe("GGX:0.25"), "ggx:0.25");
    }

    #[test]
    fn bad_spellings_say_why() {
        let message = |s: &str| s.parse::<AnyLobe>().unwrap_err().to_string();
        assert_eq!(message("phong:3"), "there is no BRDF called `phong`");
        assert_eq!(message("ggx:2"), "BRDF `ggx:2`: alpha must be between 0.0001 and 1, not 2");
        assert_eq!(message("ggx"), "BRDF `ggx`: ALPHA must follow, as in `ggx:0.1`");
        assert_eq!(message("ggx:x"), "BRDF `ggx:x`: `x` is no number");
        assert_eq!(
            message("blinn-phong:NaN"),
            "BRDF `blinn-phong:NaN`: exponent must be between 0.001 and 1e6, not NaN"
        );
        assert_eq!(message("lambert:1"), "BRDF `lambert:1`: takes no number");
    }

    #[test]
    fn lobes_are_finite_falling_and_dark_behind() {
        for lobe in samples() {
            assert_eq!(lobe.evaluate(-0.5), 0.0, "{}", lobe);
            let mut all: Vec<f64> = (0..=1000).map(|i| f64::from(i) / 1000.0).collect();
            let one_by_one: Vec<f64> = all.iter().map(|u| lobe.evaluate(*u)).collect();
            lobe.evaluate_all(&mut all);
            assert_eq!(all, one_by_one);
            assert!(all.windows(2).all(|f| f[0].is_finite() && f[1] >= f[0]), "{}", lobe.to_string());
        }
    }

    #[test]
    fn zonal_coefficients_agree_with_quadrature() {
        for lobe in samples() {
            let (exact, numeric) = (lobe.zonal(16), zonal_by_quadrature(&*lobe, 16));
            for l in 0..=16 {
                // Lobes that are not polynomials near u = 0 leave the quadrature about 1e-10.
                assert!(
                    (exact[l] - numeric[l]).abs() < 1e-9,
                    "{} l = {l}: {} {}",
                    lobe,
                    exact[l],
                    numeric[l]
                );
            }
        }
    }

    #[test]
    fn widening_by_nothing_changes_nothing() {
        for lobe in samples() {
            let same = lobe.widen(SlopeVariance::ZERO);
            for u in [-0.2, 0.0, 0.3, 0.9, 0.999, 1.0] {
                let (a, b) = (lobe.evaluate(u), same.evaluate(u));
                assert!((a - b).abs() <= 1e-12 * a.abs(), "{} at {u}: {a} {b}", lobe);
            }
        }
    }

    #[test]
    fn widening_in_passing_is_widening() {
        let by = SlopeVariance::clamped(0.03);
        for lobe in samples() {
            for u in [-0.2, 0.3, 0.999] {
                assert_eq!(lobe.evaluate_widened(by, u), lobe.widen(by).evaluate(u), "{}", lobe);
            }
        }
    }

    #[test]
    fn widening_matches_the_convolution_with_a_von_mises_fisher_lobe() {
        // The exact effect of a vMF lobe (kappa = 1/v) is to scale rho_l by its own zonal coefficient A_l:
        // A_1 = coth k - 1/k, A_{l+1} = A_{l-1} - (2l+1)/k A_l. The rules approximate that. Shape (rho_l over
        // rho_0) must agree to 4 %. GGX has no variance to add to, and the rule costs it up to 16 %. Energy
        // rho_0 must stay, but for GGX and Beckmann, whose D holds one unit of *projected* area: the wider,
        // the more of it leans, at most 1 + pi v ~ 10 % here; Torrance-Sparrow, normalised as on a plane,
        // loses 2 sigma²/3.
        let kappa = 50.0_f64;
        let mut a = vec![1.0, 1.0 / kappa.tanh() - 1.0 / kappa];
        for l in 1..4 {
            a.push(a[l - 1] - (2 * l + 1) as f64 / kappa * a[l]);
        }
        for lobe in samples() {
            let (base, wide) = (lobe.zonal(4), lobe.widen(SlopeVariance::clamped(1.0 / kappa)).zonal(4));
            for l in 0..=4 {
                let (got, expected) = (wide[l] / wide[0], base[l] / base[0] * a[l]);
                let bound = if lobe.to_string().starts_with("ggx") { 0.16 } else { 0.04 };
                assert!((got - expected).abs() < bound, "{} l = {l}: {got} for {expected}", lobe);
            }
            let energy = wide[0] / base[0];
            let bound = if lobe.to_string().starts_with(['g', 'b']) { 0.1 } else { 0.01 };
            assert!((energy - 1.0).abs() < bound, "{} {energy}", lobe);
        }
    }
}
