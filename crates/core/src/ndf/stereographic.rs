//! `stereographic`: a Gaussian on the plane, projected to the full sphere from the pole below. Olano and
//! North 1997, section 4.
//!
//! Density that they tried among the first, `n([x y]/(z + 1), mu, Σ)`, and gave up: "quite difficult to
//! combine and filter". It is here to show that. Mean and second moments of `s = n.xy/(1 + n.z)` are stored,
//! which mix; the Gaussian of these moments is what a mixture is approximated by. The base lobe, of slope
//! variance v, is one of variance v/4 there: near the pole `s` is half a slope. Beside them lies the mean
//! normal, of which diffuse light takes the cosine.

use std::f64::consts::PI;
use std::fmt::{self, Display};

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::table::no_parameters;
use super::{Decoded, Describe, Encoding, FlatLobe, Form, FormKind, Representation, Row, Sample};
use crate::brdf::Lobe;
use crate::shader::Shader;
use crate::sphere::gauss_legendre;

/// The stereographic density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stereographic;

pub(super) const ROW: Row = Row {
    name: "stereographic",
    aliases: &[],
    parameters: "",
    summary: "a Gaussian of the plane, projected to the full sphere; what Olano and North tried and left",
    paper: "Olano and North 1997, section 4",
    parse: |words| no_parameters(words, Stereographic),
    samples: &["stereographic"],
};

/// Stored sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedMoments {
    mean: Vec2,
    /// xx, yy, xy.
    second: Vec3,
    normal: Vec3,
}

/// Gaussian of the projected normals, before the base roughness is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedGaussian {
    mean: DVec2,
    /// xx, yy, xy.
    covariance: [f64; 3],
    normal: DVec3,
}

impl From<ProjectedGaussian> for Decoded {
    fn from(g: ProjectedGaussian) -> Self {
        Self::Projected { mean: g.mean, covariance: g.covariance }
    }
}

/// A direction on the plane, seen from the pole below; the pole itself lies as far as numbers go.
fn projected(w: DVec3) -> DVec2 {
    w.truncate() / (1.0 + w.z).max(1e-9)
}

/// Integral over the sphere of the Gaussian of a flat map, `exp(-2 s²/v)/(2 pi v/4)`: `dω = 4 ds/(1 + s²)²`.
fn flat_integral(v: f64) -> f64 {
    // In t = s²: to where the exponential has ended, in panels that double.
    let (mut sum, mut from, mut to) = (0.0, 0.0, v / 16.0);
    while from < 20.0 * v {
        for (node, weight) in gauss_legendre(16) {
            let t = from + (to - from) * (node + 1.0) / 2.0;
            sum += (-2.0 * t / v).exp() / (1.0 + t).powi(2) * weight * (to - from) / 2.0;
        }
        (from, to) = (to, 2.0 * to);
    }
    sum * 4.0 * PI / (2.0 * PI * v / 4.0)
}

impl Display for Stereographic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(ROW.name)
    }
}

impl Describe for Stereographic {
    fn encoding(&self) -> Encoding {
        Encoding::ProjectedMoments
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Whole
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Whole, &[include_str!("stereographic.wgsl")]).table(1)
    }

    fn flat_lobe(&self, _brdf: &dyn Lobe) -> FlatLobe {
        FlatLobe::OwnKernel
    }
}

impl Representation for Stereographic {
    type Sums = ProjectedMoments;
    type Lobes = ProjectedGaussian;

    fn zero(&self) -> ProjectedMoments {
        ProjectedMoments { mean: Vec2::ZERO, second: Vec3::ZERO, normal: Vec3::ZERO }
    }

    fn accumulate(&self, sums: &mut ProjectedMoments, sample: &Sample, weight: f32) {
        let n = sample.normal;
        let s = n.truncate() / (1.0 + n.z).max(1e-6);
        let second = Vec3::new(s.x * s.x, s.y * s.y, s.x * s.y);
        self.blend(sums, &ProjectedMoments { mean: s, second, normal: n }, weight);
    }

    fn blend(&self, sums: &mut ProjectedMoments, part: &ProjectedMoments, weight: f32) {
        sums.mean += weight * part.mean;
        sums.second += weight * part.second;
        sums.normal += weight * part.normal;
    }

    fn pack(&self, sums: &ProjectedMoments, channels: &mut [f32]) {
        let (s, q, n) = (sums.mean, sums.second, sums.normal);
        channels.copy_from_slice(&[s.x, s.y, q.x, q.y, q.z, n.x, n.y, n.z]);
    }

    fn unpack(&self, c: &[f32]) -> ProjectedMoments {
        ProjectedMoments {
            mean: Vec2::new(c[0], c[1]),
            second: Vec3::new(c[2], c[3], c[4]),
            normal: Vec3::new(c[5], c[6], c[7]),
        }
    }

    fn decode(&self, sums: &ProjectedMoments) -> ProjectedGaussian {
        let (s, q) = (sums.mean.as_dvec2(), sums.second.as_dvec3());
        let covariance = [(q.x - s.x * s.x).max(0.0), (q.y - s.y * s.y).max(0.0), q.z - s.x * s.y];
        ProjectedGaussian { mean: s, covariance, normal: sums.normal.as_dvec3() }
    }

    fn form<'a>(&'a self, lobes: &ProjectedGaussian) -> Form<'a> {
        Form::Whole(lobes.normal)
    }

    /// The lobe's energy over the flat map's integral.
    fn table(&self, lobe: &dyn Lobe) -> Vec<f64> {
        let of = |v: crate::units::SlopeVariance| lobe.zonal(0)[0] / flat_integral(v.get());
        lobe.slope_variance().map(of).into_iter().collect()
    }

    fn effective<'a>(
        &'a self,
        lobes: &ProjectedGaussian,
        lobe: &'a dyn Lobe,
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let table = self.table(lobe);
        effective_of(*lobes, lobe, table.first().copied())
    }

    fn effective_with<'a>(
        &'a self,
        lobes: &ProjectedGaussian,
        lobe: &'a dyn Lobe,
        table: &'a [f64],
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        effective_of(*lobes, lobe, table.first().copied())
    }
}

fn effective_of<'a>(
    g: ProjectedGaussian,
    lobe: &'a dyn Lobe,
    scale: Option<f64>,
) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
    let Some(v) = lobe.slope_variance() else {
        return Box::new(move |w| w.dot(g.normal).max(0.0));
    };
    let floor = v.get() / 4.0;
    let [xx, yy, xy] = [g.covariance[0] + floor, g.covariance[1] + floor, g.covariance[2]];
    // Rounding of the moments may leave less than the base roughness across.
    let determinant = (xx * yy - xy * xy).max(floor * floor);
    let scale = scale.unwrap_or(1.0) / (2.0 * PI * determinant.sqrt());
    Box::new(move |w| {
        let d = projected(w) - g.mean;
        let far = (yy * d.x * d.x - 2.0 * xy * d.x * d.y + xx * d.y * d.y) / determinant;
        scale * (-far.max(0.0) / 2.0).exp()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::AnyLobe;

    /// Integral over the sphere.
    fn integral(f: &dyn Fn(DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        for (z, weight) in gauss_legendre(400) {
            for k in 0..200 {
                let (sin, cos) = (2.0 * PI * f64::from(k) / 200.0).sin_cos();
                let r = (1.0 - z * z).sqrt();
                sum += f(DVec3::new(r * cos, r * sin, z)) * weight * 2.0 * PI / 200.0;
            }
        }
        sum
    }

    fn energy(normals: &[Vec3], lobe: &str) -> f64 {
        let mut sums = Stereographic.zero();
        for normal in normals {
            let sample = Sample { normal: *normal, height: 0.0, spread: [0.0; 3] };
            Stereographic.accumulate(&mut sums, &sample, 1.0 / normals.len() as f32);
        }
        let lobe = lobe.parse::<AnyLobe>().unwrap();
        integral(&Stereographic.effective(&Stereographic.decode(&sums), &*lobe))
    }

    #[test]
    fn a_flat_map_keeps_its_energy_and_mixtures_do_not() {
        // A density around the pole, and none of normals that lean.
        for lobe in ["blinn-phong:8", "blinn-phong:200"] {
            assert!((energy(&[Vec3::Z], lobe) - 1.0).abs() < 1e-6);
        }
        let leaning = Vec3::new(0.75_f32.sqrt(), 0.0, 0.5);
        let alone = energy(&[leaning], "blinn-phong:200");
        // (1 + z)²/4 at z = 1/2: a lobe of the same variance on the plane covers less of the sphere.
        assert!((alone - 0.5625).abs() < 0.01, "{alone}");
        let pair = energy(&[leaning, Vec3::new(-leaning.x, 0.0, 0.5)], "blinn-phong:200");
        assert!((pair - 1.0).abs() > 0.1, "{pair}");
    }
}
