//! Lambert: `f(u) = max(u, 0)`, w the light.
//!
//! Zonal coefficients: Ramamoorthi and Hanrahan 2001 (`pi, 2 pi/3, pi/4, 0, -pi/24, ...`), by recurrence.
//! Widening: for normals of a vMF lobe around `mu`, `w·n` has mean `A_1 (w·mu)` and a variance that is
//! known in closed form; taking it as Gaussian, the mean of `max(w·n, 0)` is `m Phi(m/s) + s phi(m/s)`.

use std::borrow::Cow;
use std::f64::consts::{PI, SQRT_2};
use std::fmt::{self, Display};

use super::{AnyLobe, Argument, Lobe, Row, Widen, twin};
use crate::units::SlopeVariance;

/// A diffuse surface, perhaps already widened by a lobe of normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lambert {
    normals: SlopeVariance,
}

impl Lambert {
    /// Lambert's cosine.
    pub const SHARP: Self = Self { normals: SlopeVariance::ZERO };
}

pub(super) const ROW: Row = Row {
    name: "lambert",
    parameter: "",
    summary: "diffuse cosine max(n·l, 0)",
    parse: |text| {
        if text.is_empty() { Ok(AnyLobe::from(Lambert::SHARP)) } else { Err("takes no number".to_owned()) }
    },
    samples: &["lambert"],
};

/// Mean of `max(X, 0)` for Gaussian X of this mean and variance.
#[must_use]
pub fn mean_of_positive_part(mean: f64, variance: f64) -> f64 {
    if variance <= 0.0 {
        return mean.max(0.0);
    }
    let s = variance.sqrt();
    let t = mean / s;
    let density = (-0.5 * t * t).exp() / (2.0 * PI).sqrt();
    mean * 0.5 * libm::erfc(-t / SQRT_2) + s * density
}

impl Display for Lambert {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(ROW.name)
    }
}

impl Widen for Lambert {
    fn widened(&self, by: SlopeVariance) -> Self {
        Self { normals: self.normals.widen(by) }
    }
}

impl Lobe for Lambert {
    fn argument(&self) -> Argument {
        Argument::Light
    }

    fn evaluate(&self, u: f64) -> f64 {
        let v = self.normals.get();
        if v == 0.0 {
            return u.max(0.0);
        }
        // vMF with kappa = 1/v: A_1 = coth kappa - v; E[(w·n)²] = (1 - 3 A_1 v) u² + A_1 v.
        let a1 = 1.0 / (1.0 / v).tanh() - v;
        let mean = a1 * u;
        let second = (1.0 - 3.0 * a1 * v) * u * u + a1 * v;
        mean_of_positive_part(mean, second - mean * mean)
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        None
    }

    fn shader(&self) -> Cow<'static, str> {
        [include_str!("diffuse_only.wgsl"), twin::UNTINTED].join("\n").into()
    }

    fn base(&self) -> f64 {
        0.0
    }

    fn zonal(&self, order: usize) -> Vec<f64> {
        if self.normals.get() > 0.0 {
            return super::zonal_by_quadrature(self, order);
        }
        // rho_0 = pi, rho_1 = 2 pi / 3, other odd orders vanish; even ones by the ratio
        // rho_l / rho_{l-2} = -(l-3)/(l+2) of  2 pi (-1)^{l/2-1} / ((l+2)(l-1)) l! / (2^l (l/2)!²).
        let mut rho = vec![0.0; order + 1];
        rho[0] = PI;
        if order > 0 {
            rho[1] = 2.0 * PI / 3.0;
        }
        let mut even = PI;
        for l in (2..=order).step_by(2) {
            let k = l as f64;
            even *= -(k - 3.0) / (k + 2.0);
            rho[l] = even;
        }
        rho
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zonal_coefficients_are_the_published_ones() {
        let expected = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0, PI / 64.0];
        for (got, expected) in Lambert::SHARP.zonal(6).iter().zip(expected) {
            assert!((got - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn positive_part_has_its_closed_forms() {
        assert!((mean_of_positive_part(0.0, 1.0) - 1.0 / (2.0 * PI).sqrt()).abs() < 1e-15);
        assert_eq!(mean_of_positive_part(2.0, 0.0), 2.0);
        assert!((mean_of_positive_part(5.0, 0.01) - 5.0).abs() < 1e-12);
        assert!(mean_of_positive_part(-5.0, 0.01).abs() < 1e-12);
    }
}
