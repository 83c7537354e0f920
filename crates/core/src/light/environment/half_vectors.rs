//! Light over half-vectors: Han et al. 2007, section 8, equation 26. Twin: `half_vectors.wgsl`.
//!
//! For one view, a lobe around the half-vector meets `L'(wh) = L(wi(wh, wo)) 4 (wi·wh)`, and what an
//! effective lobe reflects of it is again a sum over spherical harmonics, `Σ Lambda_l rho_l L'_lm Y_lm(mu)`.
//! The views are precomputed on a grid of 16 × 16 directions, in the environment's own frame, and shading is
//! interpolated between four: so both the eye and the light may turn from frame to frame.
//!
//! Cut off at order 8, a small lamp rings: a second band of highlights lies beside its own. So each
//! environment has a least width of lobes, at which its ringing is low; narrower lobes are drawn as wide as
//! that. A sky leaves lobes as they are; a dark room with lamps needs some 11 degrees. The paper does not do
//! this.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Environment;
use crate::sphere::{sh_count, spherical_harmonics};
use crate::units::SlopeVariance;

/// Highest order, the paper's.
pub const HALF_VECTOR_ORDER: usize = 8;

/// Views on each axis: around the zenith, and from it down.
pub const VIEWS: usize = 16;

const COUNT: usize = sh_count(HALF_VECTOR_ORDER);

/// Texels around, of the picture that light is taken from: 2.8 degrees each, while order 8 resolves 22.
const TEXELS: usize = 128;

/// Ringing that is let through: how far the series falls below zero, from its peak over the half-vectors of a
/// view, in the mean over views. At a twentieth the false bands of a studio are faint; less blurs for nothing
/// that the eye sees (`docs/environment.md`).
const RINGING: f64 = 0.05;

/// Steps of bisection that find the least width.
const BISECTIONS: usize = 8;

/// Light over half-vectors, for every view of the grid.
#[derive(Clone, Debug)]
pub struct HalfVectors {
    /// RGB of every coefficient, of one view after the other, each row of views at one angle to the zenith.
    coefficients: Vec<DVec3>,
    narrowest: SlopeVariance,
}

impl HalfVectors {
    /// Projects an environment. An integral over half-vectors is one over the light's directions, whose solid
    /// angle is `4 (wi·wh)` times as large, so texels count by their own.
    #[must_use]
    pub fn of(environment: &Environment) -> Self {
        let light = environment.beams(TEXELS);
        let view = |i: usize| {
            let wo = view_direction(i % VIEWS, i / VIEWS);
            let (mut sums, mut basis) = (vec![DVec3::ZERO; COUNT], [0.0; COUNT]);
            for (wi, power) in &light {
                // Light from right behind has no half-vector.
                let Some(wh) = (*wi + wo).try_normalize() else { continue };
                spherical_harmonics(HALF_VECTOR_ORDER, wh, &mut basis);
                sums.iter_mut().zip(&basis).for_each(|(sum, b)| *sum += *power * *b);
            }
            sums
        };
        let views: Vec<Vec<DVec3>> = (0..VIEWS * VIEWS).into_par_iter().map(view).collect();
        let luminance: Vec<Vec<f64>> =
            views.iter().map(|view| view.iter().map(|c| c.element_sum()).collect()).collect();
        Self { coefficients: views.concat(), narrowest: narrowest(&luminance) }
    }

    /// Least variance of lobes that this light is drawn with: that of the half-vectors around the mean, the
    /// BRDF's own width in it.
    #[must_use]
    pub fn narrowest(&self) -> SlopeVariance {
        self.narrowest
    }

    /// Zonal coefficients of a lobe that is no narrower than [`Self::narrowest`]. The width of a lobe is read
    /// off its highest order, of which a Gaussian leaves `exp(-l(l+1) variance/2)`.
    #[must_use]
    pub fn widened(&self, zonal: [f64; HALF_VECTOR_ORDER + 1]) -> [f64; HALF_VECTOR_ORDER + 1] {
        let left = (zonal[HALF_VECTOR_ORDER] / zonal[0]).max(f64::MIN_POSITIVE);
        let lacking = self.narrowest.get() + left.ln() / rate(HALF_VECTOR_ORDER);
        std::array::from_fn(|l| zonal[l] * (-rate(l) * lacking.max(0.0)).exp())
    }

    /// All coefficients, view after view.
    #[must_use]
    pub fn coefficients(&self) -> &[DVec3] {
        &self.coefficients
    }

    /// `Σ zonal_l L'_lm Y_lm(mu)` for an eye in a direction, interpolated between the four views around it.
    /// Ringing below zero is clamped to zero.
    #[must_use]
    pub fn evaluate(&self, wo: DVec3, mu: DVec3, zonal: &[f64; HALF_VECTOR_ORDER + 1]) -> DVec3 {
        let mut basis = [0.0; COUNT];
        spherical_harmonics(HALF_VECTOR_ORDER, mu, &mut basis);
        for (l, scale) in zonal.iter().enumerate() {
            basis[l * l..(l + 1) * (l + 1)].iter_mut().for_each(|b| *b *= scale);
        }
        let sum = |view: usize| -> DVec3 {
            self.coefficients[view * COUNT..][..COUNT].iter().zip(&basis).map(|(c, b)| *c * *b).sum()
        };
        let (views, part) = views_around(wo);
        let [a, b, c, d] = views.map(sum);
        a.lerp(b, part.x).lerp(c.lerp(d, part.x), part.y).max(DVec3::ZERO)
    }
}

/// Rate at which a unit of variance damps an order.
fn rate(l: usize) -> f64 {
    0.5 * (l * (l + 1)) as f64
}

/// Least variance at which the series rings no more than [`RINGING`].
fn narrowest(views: &[Vec<f64>]) -> SlopeVariance {
    let direction = |i: usize| view_direction(i % VIEWS, i / VIEWS);
    let basis = |i: usize| {
        let mut basis = [0.0; COUNT];
        spherical_harmonics(HALF_VECTOR_ORDER, direction(i), &mut basis);
        basis
    };
    let all: Vec<[f64; COUNT]> = (0..VIEWS * VIEWS).map(basis).collect();
    let ringing = |variance: f64| {
        let damping: Vec<f64> =
            (0..=HALF_VECTOR_ORDER).flat_map(|l| vec![(-rate(l) * variance).exp(); 2 * l + 1]).collect();
        let of_view = |(i, view): (usize, &Vec<f64>)| {
            let damped: Vec<f64> = view.iter().zip(&damping).map(|(c, d)| c * d).collect();
            let (mut least, mut most) = (0.0_f64, 0.0_f64);
            // Half-vectors lie on the side of the eye.
            for (_, basis) in all.iter().enumerate().filter(|(j, _)| direction(*j).dot(direction(i)) >= 0.0) {
                let value: f64 = damped.iter().zip(basis).map(|(c, b)| c * b).sum();
                (least, most) = (least.min(value), most.max(value));
            }
            if most > 0.0 { -least / most } else { 0.0 }
        };
        // Added up in their order: the same for any number of threads.
        let each: Vec<f64> = views.par_iter().enumerate().map(of_view).collect();
        each.iter().sum::<f64>() / each.len() as f64
    };
    if ringing(0.0) <= RINGING {
        return SlopeVariance::ZERO;
    }
    // Of a lamp that is a point, a twentieth of the highest order is still too little to ring.
    let (mut low, mut high) = (0.0, 20.0_f64.ln() / rate(HALF_VECTOR_ORDER));
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if ringing(middle) <= RINGING { high = middle } else { low = middle }
    }
    SlopeVariance::clamped(high)
}

/// A view of the grid: `i` around the zenith, `j` from the zenith (0) to the nadir.
fn view_direction(i: usize, j: usize) -> DVec3 {
    let (sin_phi, cos_phi) = (TAU * i as f64 / VIEWS as f64).sin_cos();
    let (sin, cos) = (PI * j as f64 / (VIEWS - 1) as f64).sin_cos();
    DVec3::new(sin * sin_phi, cos, -sin * cos_phi)
}

/// The four views around a direction, and its place between them.
fn views_around(wo: DVec3) -> ([usize; 4], DVec2) {
    let around = wo.x.atan2(-wo.z).rem_euclid(TAU) / TAU * VIEWS as f64;
    let down = wo.y.clamp(-1.0, 1.0).acos() / PI * (VIEWS - 1) as f64;
    let (i, j) = (around as usize % VIEWS, (down as usize).min(VIEWS - 2));
    let next = (i + 1) % VIEWS;
    let part = DVec2::new(around - around.floor(), down - j as f64);
    ([j * VIEWS + i, j * VIEWS + next, (j + 1) * VIEWS + i, (j + 1) * VIEWS + next], part)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{smooth, smooth_radiance};
    use super::*;

    use crate::brdf::AnyLobe;
    use crate::grid::Size;
    use crate::sphere::gauss_legendre;

    #[test]
    fn a_wide_lobe_reflects_the_integral() {
        let e = smooth(Size { width: 256, height: 128 });
        let table = HalfVectors::of(&e);
        let lobe = "blinn-phong:12".parse::<AnyLobe>().unwrap();
        let zonal: [f64; HALF_VECTOR_ORDER + 1] = std::array::from_fn(|l| lobe.zonal(HALF_VECTOR_ORDER)[l]);
        for j in [3, 7, 11] {
            // On a view of the grid, so that nothing is interpolated.
            let wo = view_direction(5, j);
            let mu = (wo + DVec3::new(0.1, 0.3, -0.2)).normalize();
            let (mut expected, nodes) = (DVec3::ZERO, gauss_legendre(200));
            for (z, weight) in &nodes {
                for k in 0..400 {
                    let (s, c) = (TAU * f64::from(k) / 400.0).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let wi = DVec3::new(r * c, r * s, *z);
                    let f = lobe.evaluate((wi + wo).normalize().dot(mu));
                    expected += smooth_radiance(wi) * (f * weight * TAU / 400.0);
                }
            }
            let got = table.evaluate(wo, mu, &zonal);
            // Orders above 8 of this lobe against a light that ends at the horizon of half-vectors: 2 %.
            assert!((got - expected).length() < 0.02 * expected.length(), "{got} {expected}");
        }
    }

    #[test]
    fn narrow_lobes_are_widened_where_light_rings() {
        // A smooth sky is of order 2, so its half-vectors hardly ring.
        let sky = HalfVectors::of(&smooth(Size { width: 128, height: 64 }));
        let mirror = [1.0; HALF_VECTOR_ORDER + 1];
        assert!(sky.narrowest() == SlopeVariance::ZERO && sky.widened(mirror) == mirror);
        // A lamp of one texel in the dark: measured 0.036, 11 degrees.
        let mut lamp = crate::grid::Grid::from_fn(Size { width: 128, height: 64 }, |_, _| glam::Vec3::ZERO);
        lamp.row_mut(20)[30] = glam::Vec3::ONE;
        let lamp = HalfVectors::of(&Environment::new(lamp).unwrap());
        assert!((lamp.narrowest().get() - 0.036).abs() < 2e-3, "{:?}", lamp.narrowest());
        let last = lamp.widened(mirror)[HALF_VECTOR_ORDER];
        assert!((last - (-rate(HALF_VECTOR_ORDER) * lamp.narrowest().get()).exp()).abs() < 1e-12);
        // A lobe that is wide by itself stays as it is.
        let wide = std::array::from_fn(|l| (-rate(l) * 2.0 * lamp.narrowest().get()).exp());
        assert!(lamp.widened(wide) == wide);
        // Least of the series beside the lamp's highlight, over the highlight.
        let values = |zonal: &[f64; HALF_VECTOR_ORDER + 1]| {
            let series = |i: usize| {
                let mu = view_direction(i % VIEWS, i / VIEWS);
                let mut basis = [0.0; COUNT];
                spherical_harmonics(HALF_VECTOR_ORDER, mu, &mut basis);
                let of = |i: usize| zonal[(i as f64).sqrt() as usize] * basis[i];
                let at = (7 * VIEWS + 2) * COUNT;
                (0..COUNT).map(|i| of(i) * lamp.coefficients[at + i].x).sum::<f64>()
            };
            let all: Vec<f64> = (0..VIEWS * VIEWS).map(series).collect();
            let of = |pick: fn(f64, f64) -> f64| all.iter().copied().fold(0.0, pick);
            -of(f64::min) / of(f64::max)
        };
        // Measured 0.164 and 0.053: this view's, where RINGING bounds the mean over views.
        assert!(values(&mirror) > 0.15 && values(&lamp.widened(mirror)) < 0.06);
    }

    #[test]
    fn views_are_interpolated_without_a_seam() {
        for wo in [DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::new(-1e-12, 0.0, -1.0), DVec3::new(0.6, 0.0, 0.8)]
        {
            let (views, part) = views_around(wo);
            assert!(views.iter().all(|v| *v < VIEWS * VIEWS), "{wo}");
            assert!((0.0..=1.0).contains(&part.x) && (0.0..=1.0).contains(&part.y), "{wo} {part}");
        }
        let (views, part) = views_around(view_direction(3, 4));
        assert!(
            views[0] == 4 * VIEWS + 3 && part.length() < 1e-9
                || views[0] == 4 * VIEWS + 2
                || views[0] == 3 * VIEWS + 3
        );
    }
}
