//! Directions, quadrature and spherical harmonics.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

/// An orthonormal frame whose third axis is the unit vector `n`.
///
/// Duff et al. 2017, "Building an Orthonormal Basis, Revisited": no branch, no singular direction.
#[must_use]
pub fn frame(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Nodes and weights of Gauss-Legendre quadrature on [-1, 1], by Newton's method on `P_n`.
#[must_use]
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let node = |i: usize| {
        let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..100 {
            let p = legendre(n, x);
            slope = n as f64 * (x * p[n] - p[n - 1]) / (x * x - 1.0);
            let step = p[n] / slope;
            x -= step;
            if step.abs() < 1e-16 {
                break;
            }
        }
        (x, 2.0 / ((1.0 - x * x) * slope * slope))
    };
    if n == 1 { vec![(0.0, 2.0)] } else { (0..n).map(node).collect() }
}

/// Legendre polynomials `P_0 .. P_order` at `x`, by Bonnet's recurrence.
#[must_use]
pub fn legendre(order: usize, x: f64) -> Vec<f64> {
    let mut p = Vec::with_capacity(order + 1);
    p.push(1.0);
    if order > 0 {
        p.push(x);
    }
    for l in 2..=order {
        let k = l as f64;
        p.push(((2.0 * k - 1.0) * x * p[l - 1] - (k - 1.0) * p[l - 2]) / k);
    }
    p
}

/// Directions of the upper hemisphere, evenly spread over the unit disk of their x and y.
///
/// A square lattice, kept row by row so that a lobe's bounding box is a few runs of neighbours.
#[derive(Clone, Debug)]
pub struct DiskLattice {
    /// Unit directions, row by row.
    pub directions: Vec<DVec3>,
    /// For each row: its y, and where its directions begin and end in `directions`.
    pub rows: Vec<(f64, std::ops::Range<usize>)>,
}

impl DiskLattice {
    /// A lattice of `side` × `side` points over [-1, 1]², kept where the radius is below `radius`.
    #[must_use]
    pub fn new(side: usize, radius: f64) -> Self {
        let coordinate = |i: usize| (2 * i + 1) as f64 / side as f64 - 1.0;
        let (mut directions, mut rows) = (Vec::new(), Vec::new());
        for j in 0..side {
            let first = directions.len();
            for i in 0..side {
                let p = DVec2::new(coordinate(i), coordinate(j));
                if p.length() < radius {
                    directions.push(p.extend((1.0 - p.length_squared()).sqrt()));
                }
            }
            if directions.len() > first {
                rows.push((coordinate(j), first..directions.len()));
            }
        }
        Self { directions, rows }
    }

    /// Number of directions.
    #[must_use]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// True when no direction was kept.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.directions.is_empty()
    }
}

/// Highest order for which [`spherical_harmonics`] keeps its table of constants.
pub const MAX_SH_ORDER: usize = 16;

/// Number of real coefficients of orders 0 to `order`.
#[must_use]
pub const fn sh_count(order: usize) -> usize {
    (order + 1) * (order + 1)
}

/// Real orthonormal spherical harmonics `Y_lm(n)` for l = 0..`order`, m = -l..l, at index `l² + l + m`.
///
/// No Condon-Shortley phase: `Y_1` is `sqrt(3/4pi) (y, z, x)`. The associated Legendre recurrences run
/// in their normalised form with the powers of sin(theta) taken out, so nothing overflows and the
/// poles are not special (Sloan 2013, "Efficient Spherical Harmonic Evaluation", has the idea).
///
/// # Panics
/// When `out` is shorter than [`sh_count`] or `order` above [`MAX_SH_ORDER`].
pub fn spherical_harmonics(order: usize, n: DVec3, out: &mut [f64]) {
    assert!(order <= MAX_SH_ORDER, "spherical harmonics are tabulated up to order {MAX_SH_ORDER}");
    let table = sh_constants();
    // (cos m phi, sin m phi) sin^m theta = Re, Im of (x + iy)^m.
    let (mut re, mut im) = (1.0, 0.0);
    for m in 0..=order {
        let mut before = 0.0;
        let mut now = table.diagonal[m];
        for l in m..=order {
            let index = l * l + l;
            if m == 0 {
                out[index] = now;
            } else {
                out[index + m] = now * re;
                out[index - m] = now * im;
            }
            let (a, b) = table.step[l][m];
            (before, now) = (now, a * n.z * now - b * before);
        }
        (re, im) = (re * n.x - im * n.y, re * n.y + im * n.x);
    }
}

struct ShConstants {
    /// `P̂_mm / sin^m`, with the sqrt 2 of the real basis for m > 0.
    diagonal: [f64; MAX_SH_ORDER + 1],
    /// `P̂_{l+1,m} = a z P̂_lm - b P̂_{l-1,m}`.
    step: [[(f64, f64); MAX_SH_ORDER + 1]; MAX_SH_ORDER + 1],
}

fn sh_constants() -> &'static ShConstants {
    static TABLE: std::sync::OnceLock<ShConstants> = std::sync::OnceLock::new();
    TABLE.get_or_init(|| {
        let mut table = ShConstants {
            diagonal: [0.0; MAX_SH_ORDER + 1],
            step: [[(0.0, 0.0); MAX_SH_ORDER + 1]; MAX_SH_ORDER + 1],
        };
        let mut diagonal = (1.0 / (4.0 * PI)).sqrt();
        for m in 0..=MAX_SH_ORDER {
            let mf = m as f64;
            if m > 0 {
                diagonal *= ((2.0 * mf + 1.0) / (2.0 * mf)).sqrt();
            }
            table.diagonal[m] = diagonal * if m > 0 { std::f64::consts::SQRT_2 } else { 1.0 };
            let ratio = |l: f64| ((4.0 * l * l - 1.0) / (l * l - mf * mf)).sqrt();
            for l in m..=MAX_SH_ORDER {
                let next = ratio(l as f64 + 1.0);
                let b = if l > m { next / ratio(l as f64) } else { 0.0 };
                table.step[l][m] = (next, b);
            }
        }
        table
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonics_are_orthonormal() {
        // Gauss-Legendre × trapezoid integrates products up to degree 32 exactly, so only rounding is left.
        let (order, count) = (MAX_SH_ORDER, sh_count(MAX_SH_ORDER));
        let mut gram = vec![0.0; count * count];
        let mut y = vec![0.0; count];
        for (z, weight) in gauss_legendre(20) {
            for k in 0..40 {
                let phi = 2.0 * PI * k as f64 / 40.0;
                let r = (1.0 - z * z).sqrt();
                spherical_harmonics(order, DVec3::new(r * phi.cos(), r * phi.sin(), z), &mut y);
                for i in 0..count {
                    for j in 0..=i {
                        gram[i * count + j] += y[i] * y[j] * weight * 2.0 * PI / 40.0;
                    }
                }
            }
        }
        for i in 0..count {
            for j in 0..=i {
                let expected = f64::from(i == j);
                assert!((gram[i * count + j] - expected).abs() < 1e-12, "{i} {j}");
            }
        }
    }

    #[test]
    fn first_harmonics_are_the_textbook_ones() {
        let n = DVec3::new(0.36, 0.48, 0.8);
        let mut y = [0.0; 9];
        spherical_harmonics(2, n, &mut y);
        let c1 = (3.0 / (4.0 * PI)).sqrt();
        let c2 = (15.0 / (4.0 * PI)).sqrt();
        let expected = [
            (1.0 / (4.0 * PI)).sqrt(),
            c1 * n.y,
            c1 * n.z,
            c1 * n.x,
            c2 * n.x * n.y,
            c2 * n.y * n.z,
            (5.0 / (16.0 * PI)).sqrt() * (3.0 * n.z * n.z - 1.0),
            c2 * n.x * n.z,
            c2 / 2.0 * (n.x * n.x - n.y * n.y),
        ];
        for (got, expected) in y.iter().zip(expected) {
            assert!((got - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn harmonics_satisfy_the_addition_theorem_even_at_the_poles() {
        let (a, mut y) = (DVec3::new(0.6, 0.0, 0.8), vec![0.0; 289]);
        let mut ya = vec![0.0; 289];
        spherical_harmonics(16, a, &mut ya);
        for b in [DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::new(-0.48, 0.64, -0.6)] {
            spherical_harmonics(16, b, &mut y);
            let p = legendre(16, a.dot(b));
            for (l, p) in p.iter().enumerate() {
                let range = l * l..(l + 1) * (l + 1);
                let sum: f64 = range.map(|i| ya[i] * y[i]).sum();
                assert!((sum - (2 * l + 1) as f64 / (4.0 * PI) * p).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        let integral: f64 = gauss_legendre(8).iter().map(|(x, w)| w * x.powi(14)).sum();
        assert!((integral - 2.0 / 15.0).abs() < 1e-15);
        assert_eq!(gauss_legendre(1), [(0.0, 2.0)]);
    }

    #[test]
    fn frames_are_orthonormal() {
        for n in [DVec3::Z, DVec3::NEG_Z, DVec3::new(0.6, -0.64, 0.48), DVec3::new(0.6, 0.8, -1e-17)] {
            let (a, b) = frame(n);
            assert!(a.dot(b).abs() < 1e-15 && a.dot(n).abs() < 1e-15 && b.dot(n).abs() < 1e-15);
            assert!((a.cross(b) - n).length() < 1e-14);
        }
    }
}
