//! The contract of a lobe: `D`, how microfacets are distributed around a normal, or any other `f(w · n)`.
//!
//! Han et al. 2007, section 4: every such lobe acts on a distribution of normals by spherical convolution, so
//! a method needs only two facts about it: its **zonal coefficients**, and how it **widens** when convolved
//! with an isotropic lobe of normals.

use std::any::Any;
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::{Debug, Display};
use std::ops::Deref;
use std::sync::Arc;

use glam::DVec3;

use super::beckmann::{self, Beckmann};
use super::{Measured, Microfacets, mean_of_positive_part};
use crate::sphere::{gauss_legendre, legendre};
use crate::units::SlopeVariance;

/// Vector that the lobe takes beside the normal.
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

    /// Slope variance of the lobe on one axis; `None` for Lambert, whose lobe is not narrow.
    fn slope_variance(&self) -> Option<SlopeVariance>;

    /// Smith's masking (Walter et al. 2007, section 5.1) at cosine `u > 0` to the normal, of a lobe of this
    /// kind that is `width` wide. Lobes without a form of their own use Beckmann's.
    fn masking(&self, u: f64, width: SlopeVariance) -> f64 {
        beckmann::masking(u, width)
    }

    /// Colour of the lobe itself, at the cosine u = wi·wh; white, except for measured lobes.
    fn tint(&self, _u: f64) -> DVec3 {
        DVec3::ONE
    }

    /// The material that was measured as a whole: its diffuse part belongs to the lobe, and channels differ
    /// by more than a colour.
    fn measured(&self) -> Option<&Measured> {
        None
    }

    /// Microfacets that blur an environment most like this lobe.
    fn microfacets(&self) -> Microfacets {
        Microfacets::Beckmann
    }

    /// Beckmann microfacets as wide as this lobe, for a lobe that is no distribution of microfacets itself;
    /// `None` for lobes that are one, and for Lambert.
    fn as_beckmann(&self) -> Option<Beckmann> {
        self.slope_variance().map(Beckmann::of_width)
    }

    /// Density of facets over slopes, in units of the lobe's own deviations: D(u) u⁴ times its variance, at a
    /// slope of this squared length. A lobe that is a function of slopes computes it without u, which near 1
    /// has few of their digits.
    fn slope_profile(&self, square: f64) -> f64 {
        let variance = self.slope_variance().unwrap_or(SlopeVariance::ZERO).get();
        let u2 = 1.0 / (1.0 + variance * square);
        self.evaluate(u2.sqrt()) * u2 * u2 * variance
    }

    /// Area of the facets that face a direction, projected along it: the mean of `max(X, 0)` for X of this
    /// mean and deviation. X is distributed as the slopes of lobes of this kind; as Beckmann's Gaussian,
    /// where a lobe has no distribution of its own. The area is per unit of area that the facets cover,
    /// without masking: [`Self::masking`] is the mean over this.
    fn visible_area(&self, mean: f64, deviation: f64) -> f64 {
        mean_of_positive_part(mean, deviation * deviation)
    }

    /// Zonal coefficients `rho_l = 2 pi ∫ f(u) P_l(u) du` for l = 0..`order` (Han et al., equation 8).
    ///
    /// By closed form or recurrence where there is one; else by [`zonal_by_quadrature`].
    fn zonal(&self, order: usize) -> Vec<f64> {
        zonal_by_quadrature(self, order)
    }

    /// Text of the twin in WGSL: `SPECULAR` and the functions `lobe_widen`, `lobe_evaluate`, `lobe_variance`,
    /// `lobe_masking`, `lobe_slope_profile`, `lobe_visible_area`, `lobe_tint`.
    fn shader(&self) -> Cow<'static, str>;

    /// The one number, `base`, that the twin's functions take for this lobe.
    fn base(&self) -> f64;

    /// The approximation that Han et al. print for the zonal coefficients, if they print one.
    fn zonal_as_printed(&self, _order: usize) -> Option<Vec<f64>> {
        None
    }
}

/// Widening of a kind of lobe.
pub trait Widen: Lobe + Sized {
    /// This lobe convolved with an isotropic lobe of normals of variance `by`; exactly itself for zero.
    #[must_use]
    fn widened(&self, by: SlopeVariance) -> Self;

    /// [`Self::widened`], then [`Lobe::evaluate`].
    fn value_widened(&self, by: SlopeVariance, u: f64) -> f64 {
        self.widened(by).evaluate(u)
    }
}

/// Part of [`Lobe`] that every kind gets from its [`Widen`].
pub trait LobeObject {
    /// This lobe convolved with an isotropic lobe of normals of variance `by`; exactly itself for zero.
    fn widen(&self, by: SlopeVariance) -> AnyLobe;

    /// [`Self::widen`], then [`Lobe::evaluate`], without a lobe on the heap: for a pixel, which asks this of
    /// a lobe once.
    fn evaluate_widened(&self, by: SlopeVariance, u: f64) -> f64;

    /// True for a lobe of the same kind and width.
    fn equals(&self, other: &dyn Lobe) -> bool;

    /// The lobe as `Any`, to be cast down to its own type.
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

/// Lobe of any kind, shared. Cloning costs nothing. Lobes compare by kind and width, and are read from and
/// written as their spelling.
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

/// Twins in WGSL of the default methods of [`Lobe`], from which the shaders of lobes are put together.
pub(super) mod twin {
    /// Masking and projected area of Gaussian slopes.
    pub(in crate::brdf) const GAUSSIAN_FACETS: &str = include_str!("gaussian_facets.wgsl");

    /// The slope profile, from the lobe itself.
    pub(in crate::brdf) const SLOPE_PROFILE: &str = include_str!("slope_profile.wgsl");

    /// White, the colour of most lobes.
    pub(in crate::brdf) const UNTINTED: &str = include_str!("untinted.wgsl");
}
