//! The contract of a lobe: `D`, how microfacets are distributed around a normal, or any other `f(w · n)`.
//!
//! Han et al. 2007, section 4: every such lobe acts on a distribution of normals by spherical convolution, so
//! two facts are all that a method needs of it: its **zonal coefficients**, and how it **widens** when
//! convolved with an isotropic lobe of normals.

use std::any::Any;
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::{Debug, Display};
use std::ops::Deref;
use std::sync::Arc;

use glam::DVec3;

use super::beckmann::{self, Beckmann};
use super::{LobeFactors, Microfacets, mean_of_positive_part};
use crate::sphere::{gauss_legendre, legendre};
use crate::units::SlopeVariance;

/// Which vector the lobe takes beside the normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// The direction to the light.
    Light,
    /// The half-vector between light and eye.
    Half,
}

/// Reflectance lobe around a normal, of a kind chosen at run time; [`AnyLobe`] owns one.
///
/// [`Display`] writes the spelling that [`AnyLobe`] reads, such as `blinn-phong:50`.
pub trait Lobe: LobeObject + Debug + Display + Send + Sync {
    /// The vector `w` that the lobe takes beside the normal.
    fn argument(&self) -> Argument {
        Argument::Half
    }

    /// `f(u)`, u = w · n in [-1, 1]; zero where u ≤ 0 unless the lobe was widened.
    fn evaluate(&self, u: f64) -> f64;

    /// [`Self::evaluate`] of every element, in place.
    fn evaluate_all(&self, u: &mut [f64]) {
        u.iter_mut().for_each(|u| *u = self.evaluate(*u));
    }

    /// Slope variance of the lobe on one axis; `None` for Lambert, which is no narrow lobe.
    fn slope_variance(&self) -> Option<SlopeVariance>;

    /// Smith's masking (Walter et al. 2007, section 5.1) at cosine `u > 0` to the normal, of a lobe of this
    /// kind that is `width` wide; Beckmann's, where a lobe has none of its own.
    fn masking(&self, u: f64, width: SlopeVariance) -> f64 {
        beckmann::masking(u, width)
    }

    /// Colour of the lobe itself, at the cosine u = wi·wh; white, but for what was measured.
    fn tint(&self, _u: f64) -> DVec3 {
        DVec3::ONE
    }

    /// The factors of a material that was measured as a whole: its diffuse part belongs to the lobe.
    fn measured(&self) -> Option<&LobeFactors> {
        None
    }

    /// The microfacets whose blur of an environment is most like this lobe's.
    fn microfacets(&self) -> Microfacets {
        Microfacets::Beckmann
    }

    /// The microfacets of a lobe that is none: Beckmann's, as wide as it; `None` for lobes of microfacets,
    /// and for Lambert.
    fn as_beckmann(&self) -> Option<Beckmann> {
        self.slope_variance().map(Beckmann::of_width)
    }

    /// Density of facets over slopes, in units of the lobe's own deviations: D(u) u⁴ times its variance, at a
    /// slope of this squared length. Not through u where a lobe is a function of slopes: near 1, u has few of
    /// their digits.
    fn slope_profile(&self, square: f64) -> f64 {
        let variance = self.slope_variance().unwrap_or(SlopeVariance::ZERO).get();
        let u2 = 1.0 / (1.0 + variance * square);
        self.evaluate(u2.sqrt()) * u2 * u2 * variance
    }

    /// Area, projected along a direction, of the facets that face it: the mean of `max(X, 0)` for X of this
    /// mean and deviation, X being distributed as slopes are for lobes of this kind. Beckmann's Gaussian,
    /// where a lobe has none of its own. Per unit of area that the facets cover, and masking apart:
    /// [`Self::masking`] is the mean over this.
    fn visible_area(&self, mean: f64, deviation: f64) -> f64 {
        mean_of_positive_part(mean, deviation * deviation)
    }

    /// Zonal coefficients `rho_l = 2 pi ∫ f(u) P_l(u) du` for l = 0..`order` (Han et al., equation 8).
    ///
    /// Closed forms or recurrences where there are any; else [`zonal_by_quadrature`].
    fn zonal(&self, order: usize) -> Vec<f64> {
        zonal_by_quadrature(self, order)
    }

    /// Text of the twin in WGSL: `SPECULAR` and the functions `lobe_widen`, `lobe_evaluate`, `lobe_variance`,
    /// `lobe_masking`, `lobe_slope_profile`, `lobe_visible_area`, `lobe_tint`.
    fn shader(&self) -> Cow<'static, str>;

    /// The one number, `base`, that the twin's functions take for this lobe.
    fn base(&self) -> f64;

    /// The approximation that Han et al. print for the zonal coefficients, if they do.
    fn zonal_as_printed(&self, _order: usize) -> Option<Vec<f64>> {
        None
    }
}

/// How a kind of lobe widens.
pub trait Widen: Lobe + Sized {
    /// This lobe convolved with an isotropic lobe of normals of variance `by`; exactly itself for zero.
    #[must_use]
    fn widened(&self, by: SlopeVariance) -> Self;

    /// [`Self::widened`], then [`Lobe::evaluate`].
    fn value_widened(&self, by: SlopeVariance, u: f64) -> f64 {
        self.widened(by).evaluate(u)
    }
}

/// The part of [`Lobe`] that every kind has by its [`Widen`].
pub trait LobeObject {
    /// This lobe convolved with an isotropic lobe of normals of variance `by`; exactly itself for zero.
    fn widen(&self, by: SlopeVariance) -> AnyLobe;

    /// [`Self::widen`], then [`Lobe::evaluate`], without a lobe on the heap: what a pixel asks of a lobe,
    /// once.
    fn evaluate_widened(&self, by: SlopeVariance, u: f64) -> f64;

    /// True for a lobe of the same kind and width.
    fn equals(&self, other: &dyn Lobe) -> bool;

    /// The lobe as what it is.
    fn as_any(&self) -> &dyn Any;
}

impl<L: Widen + PartialEq + 'static> LobeObject for L {
    fn widen(&self, by: SlopeVariance) -> AnyLobe {
        AnyLobe::from(self.widened(by))
    }

    fn evaluate_widened(&self, by: SlopeVariance, u: f64) -> f64 {
        self.value_widened(by, u)
    }

    fn equals(&self, other: &dyn Lobe) -> bool {
        other.as_any().downcast_ref::<L>() == Some(self)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

impl PartialEq for dyn Lobe {
    fn eq(&self, other: &Self) -> bool {
        self.equals(other)
    }
}

/// Lobe of any kind, shared: cloned for nothing, compared by kind and width, read from and written as its
/// spelling.
#[derive(Clone)]
pub struct AnyLobe(Arc<dyn Lobe>);

impl<L: Widen + PartialEq + 'static> From<L> for AnyLobe {
    fn from(lobe: L) -> Self {
        Self(Arc::new(lobe))
    }
}

impl Deref for AnyLobe {
    type Target = dyn Lobe;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl PartialEq for AnyLobe {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Debug for AnyLobe {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Debug::fmt(&*self.0, f)
    }
}

impl Display for AnyLobe {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Display::fmt(&*self.0, f)
    }
}

/// Zonal coefficients by Gauss-Legendre quadrature in the angle, in panels that halve towards the peak.
///
/// 14 panels of 24 nodes resolve a lobe of width 1e-3 and orders to 16 to about 1e-13 (tested against
/// closed forms and an independent script).
pub fn zonal_by_quadrature<B: Lobe + ?Sized>(lobe: &B, order: usize) -> Vec<f64> {
    let nodes = gauss_legendre(24);
    let mut rho = vec![0.0; order + 1];
    let mut end = PI;
    for panel in 0..15 {
        // Panels: (pi/2, pi), (pi/4, pi/2), ... and the last reaches zero.
        let start = if panel == 14 { 0.0 } else { FRAC_PI_2 * 0.5_f64.powi(panel) };
        for (x, weight) in &nodes {
            let theta = start + (end - start) * (x + 1.0) / 2.0;
            let u = theta.cos();
            let f = lobe.evaluate(u) * theta.sin() * weight * (end - start) / 2.0;
            for (rho, p) in rho.iter_mut().zip(legendre(order, u)) {
                *rho += 2.0 * PI * f * p;
            }
        }
        end = start;
    }
    rho
}

/// Twins in WGSL of the default methods of [`Lobe`], for lobes to be put together from.
pub(super) mod twin {
    /// Masking and projected area of Gaussian slopes.
    pub(in crate::brdf) const GAUSSIAN_FACETS: &str = include_str!("gaussian_facets.wgsl");

    /// The slope profile, from the lobe itself.
    pub(in crate::brdf) const SLOPE_PROFILE: &str = include_str!("slope_profile.wgsl");

    /// White, the colour of most lobes.
    pub(in crate::brdf) const UNTINTED: &str = include_str!("untinted.wgsl");
}
