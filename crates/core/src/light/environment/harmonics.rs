//! An environment in spherical harmonics, and the irradiance of normals that stray.
//!
//! Ramamoorthi and Hanrahan 2001: Lambert's cosine is so wide that orders to 2 carry nearly all of an
//! irradiance. Han et al. 2007, equation 25: a lobe of normals scales order l by `Lambda_l`.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::Environment;
use crate::sphere::{sh_count, spherical_harmonics};

/// Highest order of an irradiance.
pub const IRRADIANCE_ORDER: usize = 2;

/// Zonal coefficients of `max(u, 0)`: `pi, 2 pi/3, pi/4`.
const COSINE: [f64; IRRADIANCE_ORDER + 1] = [PI, 2.0 * PI / 3.0, PI / 4.0];

/// A function of direction, in real spherical harmonics.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    order: usize,
    /// RGB, at index `l² + l + m`.
    coefficients: Vec<DVec3>,
}

impl Harmonics {
    /// Projects an environment: the sum over its texels, each by its solid angle. Harmonics are taken at the
    /// middles of texels, which for the orders here and a picture of `h` rows costs at most `(pi k / h)²/24`
    /// of what is there, k being the order plus that of what the picture shows.
    ///
    /// # Panics
    /// For an order above [`crate::sphere::MAX_SH_ORDER`].
    #[must_use]
    pub fn of(environment: &Environment, order: usize) -> Self {
        let count = sh_count(order);
        let row = |y: usize| {
            let (mut sums, mut basis) = (vec![DVec3::ZERO; count], vec![0.0; count]);
            for (x, radiance) in environment.picture().row(y).iter().enumerate() {
                spherical_harmonics(order, environment.direction(x as f64 + 0.5, y as f64 + 0.5), &mut basis);
                sums.iter_mut().zip(&basis).for_each(|(sum, b)| *sum += radiance.as_dvec3() * *b);
            }
            sums.iter_mut().for_each(|sum| *sum *= environment.solid_angle(y));
            sums
        };
        // Row by row, and added up in their order: the same for any number of threads.
        let rows: Vec<Vec<DVec3>> = (0..environment.size().height).into_par_iter().map(row).collect();
        let mut coefficients = vec![DVec3::ZERO; count];
        for row in rows {
            coefficients.iter_mut().zip(row).for_each(|(sum, part)| *sum += part);
        }
        Self { order, coefficients }
    }

    /// The coefficients, l, then m from -l to l.
    #[must_use]
    pub fn coefficients(&self) -> &[DVec3] {
        &self.coefficients
    }

    /// Sum of the series, each order multiplied by a number of its own.
    #[must_use]
    pub fn evaluate(&self, direction: DVec3, zonal: &[f64]) -> DVec3 {
        let mut basis = vec![0.0; self.coefficients.len()];
        spherical_harmonics(self.order, direction, &mut basis);
        let order = |l: usize| {
            let of = l * l..(l + 1) * (l + 1);
            let sum: DVec3 = self.coefficients[of.clone()].iter().zip(&basis[of]).map(|(c, b)| *c * *b).sum();
            sum * zonal.get(l).copied().unwrap_or(0.0)
        };
        (0..=self.order).map(order).sum()
    }
}

/// Texels around, of the picture in which the least irradiance is looked for.
const FEW_TEXELS: usize = 64;

/// Irradiance that normals receive of an environment.
#[derive(Clone, Debug)]
pub struct Irradiance {
    /// Light of the environment, to order 2.
    pub light: Harmonics,
    /// Least irradiance that a normal receives, whichever way it faces. Order 2 is off by up to 3/32 of a
    /// small lamp, and may fall below zero; no result is darker than this.
    pub least: DVec3,
}

impl Irradiance {
    /// Irradiance of an environment.
    #[must_use]
    pub fn of(environment: &Environment) -> Self {
        let beams = environment.beams(FEW_TEXELS);
        let received = |n: DVec3| beams.iter().map(|(wi, power)| *power * n.dot(*wi).max(0.0)).sum::<DVec3>();
        // A minimum is the same in any order.
        let least = beams.par_iter().map(|(n, _)| received(*n)).reduce(|| DVec3::INFINITY, DVec3::min);
        Self { light: Harmonics::of(environment, IRRADIANCE_ORDER), least }
    }

    /// Irradiance of normals that stray around a direction, by Han et al.'s equation 25: `Lambda_l` as
    /// [`zonal_of_normals`] has it, or as `printed`, `exp(-l² variance/2)`.
    #[must_use]
    pub fn of_normals(&self, normal: DVec3, variance: f64, printed: bool) -> DVec3 {
        let lambda = if printed {
            [1.0, (-0.5 * variance).exp(), (-2.0 * variance).exp()]
        } else {
            zonal_of_normals(variance)
        };
        let zonal = [0, 1, 2].map(|l| COSINE[l] * lambda[l]);
        self.light.evaluate(normal, &zonal).max(self.least)
    }
}

/// Factors of a von Mises-Fisher lobe of normals at orders 0, 1 and 2: `1, coth(kappa) - 1/kappa, 1 - 3
/// A_1/kappa`, with `variance = 1/kappa`. Their product with a lobe's own coefficients is the convolution,
/// exactly.
#[must_use]
pub fn zonal_of_normals(variance: f64) -> [f64; 3] {
    let kappa = 1.0 / variance.max(1e-12);
    // The difference cancels for wide lobes; its series there is good to kappa^9/93555, some 1e-8.
    let first = if kappa < 0.5 {
        let square = kappa * kappa;
        kappa * (1.0 / 3.0 - square * (1.0 / 45.0 - square * (2.0 / 945.0 - square / 4725.0)))
    } else {
        1.0 / kappa.tanh() - 1.0 / kappa
    };
    let second = if kappa < 0.5 {
        kappa * kappa * (1.0 / 15.0 - 2.0 * kappa * kappa / 315.0)
    } else {
        1.0 - 3.0 * first / kappa
    };
    [1.0, first, second]
}

#[cfg(test)]
mod tests {
    use super::super::tests::{smooth, smooth_radiance};
    use super::*;
    use crate::grid::{Grid, Size};
    use crate::sphere::gauss_legendre;
    use glam::Vec3;

    #[test]
    fn a_smooth_sky_comes_back() {
        // Order 2, so nothing is cut off. The error left comes from the middles of texels: of products of
        // order 6 at most, (6 pi/128)²/24 = 9e-4.
        let e = smooth(Size { width: 256, height: 128 });
        let harmonics = Harmonics::of(&e, 4);
        for w in [DVec3::Y, DVec3::new(0.6, -0.64, 0.48), DVec3::new(-0.8, 0.0, 0.6)] {
            let back = harmonics.evaluate(w, &[1.0; 5]);
            assert!((back - smooth_radiance(w)).length() < 1e-3, "{back} at {w}");
        }
    }

    #[test]
    fn irradiance_of_a_constant_is_pi_and_of_one_direction_is_a_cosine() {
        let size = Size { width: 128, height: 64 };
        let constant = Environment::new(Grid::from_fn(size, |_, _| Vec3::splat(0.5))).unwrap();
        let e = Irradiance::of(&constant).of_normals(DVec3::new(0.6, 0.0, 0.8), 0.1, false);
        // Solid angles are exact, order 0 is too; orders 1 and 2 vanish by symmetry but for the middles of
        // texels.
        assert!((e - DVec3::splat(0.5 * PI)).length() < 1e-3, "{e}");
        let mut one = Grid::from_fn(size, |_, _| Vec3::ZERO);
        let (x, y) = constant.texel(DVec3::Y + 1e-9 * DVec3::X);
        one.row_mut(y)[x] = Vec3::splat((1.0 / constant.solid_angle(y)) as f32);
        let one = Environment::new(one).unwrap();
        let towards = one.direction(x as f64 + 0.5, y as f64 + 0.5);
        let irradiance = Irradiance::of(&one);
        for angle in [0.0, 0.5, 1.0_f64] {
            let (side, _) = crate::sphere::frame(towards);
            let n = towards * angle.cos() + side * angle.sin();
            // Known of order 2: 1/4 + u/2 + 5/32 (3u² - 1), which is off max(u, 0) by at most 3/32 (at u = 0
            // and 1).
            let u = angle.cos();
            let expected = 0.25 + 0.5 * u + 5.0 / 32.0 * (3.0 * u * u - 1.0);
            assert!((irradiance.of_normals(n, 0.0, false).x - expected).abs() < 1e-6);
            assert!((expected - u).abs() <= 3.0 / 32.0 + 1e-12);
        }
    }

    #[test]
    fn nothing_is_darker_than_what_a_normal_receives() {
        // A lamp of irradiance 1 in a dim room, 0.01 from everywhere: its back is lit by the room, pi/100 =
        // 0.031, where order 2 has nothing: the lamp rings to 1/4 - 1/5 - 5/32 0.52 = -0.031 there, at u =
        // -0.4, and takes away what the room gives.
        let size = Size { width: 128, height: 64 };
        let mut room = Grid::from_fn(size, |_, _| Vec3::splat(0.01));
        let lamp = 1.0 / Environment::new(room.clone()).unwrap().solid_angle(20);
        room.row_mut(20)[30] += Vec3::splat(lamp as f32);
        let room = Environment::new(room).unwrap();
        let lamp = room.direction(30.5, 20.5);
        let irradiance = Irradiance::of(&room);
        // Error of sums over texels three degrees wide.
        assert!((irradiance.least.x / (0.01 * PI) - 1.0).abs() < 0.01, "{}", irradiance.least);
        let (side, _) = crate::sphere::frame(lamp);
        let back = lamp * -0.4 + side * 0.84_f64.sqrt();
        // Error of the middles of texels.
        assert!(irradiance.light.evaluate(back, &COSINE).x.abs() < 1e-3);
        assert!(irradiance.of_normals(back, 0.0, false) == irradiance.least);
    }

    #[test]
    fn normals_leave_what_their_lobe_says() {
        for variance in [0.01, 0.2, 1.0, 5.0, 100.0] {
            let kappa: f64 = 1.0 / variance;
            // Means of P_1 and P_2 over the lobe, whose density in u is proportional to exp(kappa u).
            let (mut weight, mut p1, mut p2) = (0.0, 0.0, 0.0);
            for (u, w) in gauss_legendre(200) {
                let density = w * (kappa * (u - 1.0)).exp();
                weight += density;
                p1 += density * u;
                p2 += density * (1.5 * u * u - 0.5);
            }
            let [one, first, second] = zonal_of_normals(variance);
            // The series' own accuracy; kappa up to 0.5 times an error of the next terms.
            assert!(one == 1.0 && (first - p1 / weight).abs() < 1e-7, "{variance}: {first} {}", p1 / weight);
            assert!((second - p2 / weight).abs() < 2e-5, "{variance}: {second} {}", p2 / weight);
        }
    }
}
