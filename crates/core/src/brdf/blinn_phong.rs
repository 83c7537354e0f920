//! Normalised Blinn-Phong: `f(u) = (s+1)/(2 pi) u^s`, w the half-vector. Han et al. 2007, section 5.1.
//!
//! Zonal coefficients: `∫ u^s P_l du` obeys `a_l = a_{l-2} (s-l+2)/(s+l+1)`, exactly; the paper prints
//! `exp(-l²/2s)`. Widening: `s' = kappa s / (kappa + s)`, which adds the variances `1/s` and `1/kappa`.

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Display};

use super::{AnyLobe, Lobe, Row, Widen, number, twin};
use crate::units::{Exponent, SlopeVariance};

/// A normalised Blinn-Phong highlight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlinnPhong {
    /// The exponent `s`.
    pub exponent: Exponent,
}

pub(super) const ROW: Row = Row {
    name: "blinn-phong",
    parameter: ":S",
    summary: "normalised cosine lobe (s+1)/2pi (n·h)^s",
    parse: |text| Ok(AnyLobe::from(BlinnPhong { exponent: number(text, Exponent::new)? })),
    samples: &["blinn-phong:3", "blinn-phong:50", "blinn-phong:400.5"],
};

impl BlinnPhong {}

impl Display for BlinnPhong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", ROW.name, self.exponent)
    }
}

impl Widen for BlinnPhong {
    fn widened(&self, by: SlopeVariance) -> Self {
        let s = self.exponent.get();
        let widened = (s / (1.0 + s * by.get())).max(1e-3);
        Self { exponent: Exponent::new(widened).unwrap_or(self.exponent) }
    }
}

impl Lobe for BlinnPhong {
    fn evaluate(&self, u: f64) -> f64 {
        let mut one = [u];
        self.evaluate_all(&mut one);
        one[0]
    }

    fn evaluate_all(&self, u: &mut [f64]) {
        let s = self.exponent.get();
        let scale = (s + 1.0) / (2.0 * PI);
        // Whole exponents, the common ones, go by repeated squaring, which turns into SIMD.
        if s.fract() == 0.0 && s <= 4096.0 {
            u.iter_mut().for_each(|u| *u = scale * u.max(0.0).powi(s as i32));
        } else {
            u.iter_mut().for_each(|u| *u = scale * u.max(0.0).powf(s));
        }
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        Some(self.exponent.into())
    }

    fn shader(&self) -> Cow<'static, str> {
        [include_str!("blinn_phong.wgsl"), twin::GAUSSIAN_FACETS, twin::SLOPE_PROFILE, twin::UNTINTED]
            .join("\n")
            .into()
    }

    fn base(&self) -> f64 {
        self.exponent.get()
    }

    fn zonal(&self, order: usize) -> Vec<f64> {
        let s = self.exponent.get();
        // Times 2 pi and the lobe's own scale: a_0 = 1, a_1 = (s+1)/(s+2).
        let mut rho = vec![1.0, (s + 1.0) / (s + 2.0)];
        for l in 2..=order {
            let k = l as f64;
            rho.push(rho[l - 2] * (s - k + 2.0) / (s + k + 1.0));
        }
        rho.truncate(order + 1);
        rho
    }

    fn zonal_as_printed(&self, order: usize) -> Option<Vec<f64>> {
        let s = self.exponent.get();
        Some((0..=order).map(|l| (-((l * l) as f64) / (2.0 * s)).exp()).collect())
    }
}
