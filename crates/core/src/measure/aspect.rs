//! Aspects of a material: functions of the half angle alone, which the normals of a texel average.
//!
//! A lobe has one aspect, itself. A measured material is no lobe: it has one for each channel at each of
//! three difference angles, beyond which lie a sixth, a half and five sixths of what [`Residual`] counts of
//! a mirror. Methods show the lobe that was fitted to it, and are charged for what the fit leaves.
//!
//! [`Residual`]: crate::brdf::measured::Residual

use std::f64::consts::SQRT_2;

use glam::DVec3;

use crate::brdf::{AnyLobe, Lobe, Measured};
use crate::ndf::{Evaluator, Shows};

/// Parts of the measure that lie within the difference angles: solid angle times both cosines squared,
/// `sin cos⁴` over a mirror.
const PARTS: [f64; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];

/// Number of aspects of a measured material.
const COUNT: usize = 3 * PARTS.len();

/// Aspects of a lobe or a material.
pub(super) enum Aspects<'a> {
    Lobe(&'a dyn Lobe),
    Material(Box<Material>),
}

/// Aspects of a measured material.
pub(super) struct Material {
    /// Lobes that methods show, and their scales.
    shown: Vec<(AnyLobe, f64)>,
    truth: Table,
    factored: Table,
}

/// Values of all aspects by the half angle; see [`Table::node`].
struct Table(Vec<[f64; COUNT]>);

/// Steps of a table: eight to each bin of measurements.
const STEPS: usize = 720;

impl Table {
    fn new(of: impl Fn(f64) -> [f64; COUNT]) -> Self {
        // Chords of the half angle grow as squares, finer towards the peak, as measurements do.
        let angle = |i: usize| 2.0 * ((i as f64 / STEPS as f64).powi(2) / SQRT_2).asin();
        Self((0..=STEPS).map(|i| of(angle(i))).collect())
    }

    /// Values at a cosine of the half angle: one side of the mix, the other, and its share. Nothing is behind
    /// the normal.
    fn at(&self, u: f64) -> Option<(&[f64; COUNT], &[f64; COUNT], f64)> {
        if u <= 0.0 {
            return None;
        }
        let at = (1.0 - u).max(0.0).sqrt().sqrt() * STEPS as f64;
        let i = (at as usize).min(STEPS - 1);
        Some((&self.0[i], &self.0[i + 1], at - i as f64))
    }
}

impl Material {
    fn new(measured: &Measured) -> Self {
        let angles = PARTS.map(|part| (1.0 - part).powf(0.2).acos());
        let all = || angles.iter().flat_map(|theta_d| (0..3).map(move |c| (*theta_d, c)));
        let shown = all().map(|(theta_d, c)| {
            let lobe = AnyLobe::from(measured.channel(c));
            let scale = lobe.tint(theta_d.cos()).x;
            (lobe, scale)
        });
        let shown: Vec<_> = shown.collect();
        let truth = Table::new(|theta_h| {
            let channels = angles.map(|theta_d| measured.highlight(theta_h, theta_d));
            std::array::from_fn(|k| channels[k / 3][k % 3])
        });
        let factored = Table::new(|theta_h| {
            std::array::from_fn(|k| shown[k].1 * shown[k].0.evaluate(theta_h.cos().max(1e-12)))
        });
        Self { shown, truth, factored }
    }
}

/// Reflectance that is averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reflectance {
    /// The material itself.
    True,
    /// The lobe that methods show.
    Factored,
}

/// Places that values are added to: the first aspect's begin at `first`, and each other's `stride` further
/// on.
pub(super) struct Places<'a> {
    pub(super) out: &'a mut [f64],
    pub(super) first: usize,
    pub(super) stride: usize,
}

impl<'a> Aspects<'a> {
    pub(super) fn new(lobe: &'a dyn Lobe) -> Self {
        match lobe.measured().filter(|m| m.is_itself()) {
            Some(measured) => Self::Material(Box::new(Material::new(measured))),
            None => Self::Lobe(lobe),
        }
    }

    pub(super) fn count(&self) -> usize {
        match self {
            Self::Lobe(_) => 1,
            Self::Material(_) => COUNT,
        }
    }

    /// Angle beyond which all stay below 1e-12 of their peak.
    pub(super) fn reach(&self) -> f64 {
        match self {
            Self::Lobe(lobe) => reach(*lobe),
            Self::Material(_) => std::f64::consts::FRAC_PI_2,
        }
    }

    /// Adds `weight` times the values at these cosines, which are lost.
    pub(super) fn add(&self, reflectance: Reflectance, cosines: &mut [f64], weight: f64, to: Places<'_>) {
        let Places { out, first, stride } = to;
        match self {
            Self::Lobe(lobe) => {
                lobe.evaluate_all(cosines);
                out[first..].iter_mut().zip(cosines.iter()).for_each(|(out, f)| *out += weight * f);
            }
            Self::Material(material) => {
                let table = match reflectance {
                    Reflectance::True => &material.truth,
                    Reflectance::Factored => &material.factored,
                };
                for (i, u) in cosines.iter().enumerate() {
                    let Some((a, b, part)) = table.at(*u) else { continue };
                    for k in 0..COUNT {
                        out[k * stride + first + i] += weight * (a[k] + (b[k] - a[k]) * part);
                    }
                }
            }
        }
    }
}

/// Angle beyond which a falling lobe stays below 1e-12 of its peak.
fn reach(lobe: &dyn Lobe) -> f64 {
    let peak = lobe.evaluate(1.0);
    let (mut near, mut far) = (0.0, std::f64::consts::FRAC_PI_2);
    if lobe.evaluate(1e-3) > 1e-12 * peak {
        return far;
    }
    for _ in 0..60 {
        let middle = (near + far) / 2.0;
        if lobe.evaluate(f64::cos(middle)) > 1e-12 * peak { near = middle } else { far = middle }
    }
    far
}

/// Effective lobes of a method's texels, in every aspect, one after the other.
pub(super) struct AspectEvaluator<'a> {
    /// Evaluator of each lobe that is shown.
    evaluators: Vec<Box<dyn Evaluator + 'a>>,
    /// Of each aspect, its lobe and scale.
    shown: Vec<(usize, f64)>,
    directions: usize,
}

impl<'a> AspectEvaluator<'a> {
    pub(super) fn new(aspects: &'a Aspects<'_>, method: &'a dyn Shows, directions: &'a [DVec3]) -> Self {
        let (evaluators, shown) = match aspects {
            Aspects::Lobe(lobe) => (vec![method.show(*lobe, directions)], vec![(0, 1.0)]),
            Aspects::Material(material) => {
                // Three channels are shown at every difference angle, at other scales.
                let channels = material.shown[..3].iter();
                let evaluators = channels.map(|(lobe, _)| method.show(&**lobe, directions)).collect();
                let scales = material.shown.iter().enumerate().map(|(k, (_, scale))| (k % 3, *scale));
                (evaluators, scales.collect())
            }
        };
        Self { evaluators, shown, directions: directions.len() }
    }
}

impl Evaluator for AspectEvaluator<'_> {
    fn evaluate(&self, channels: &[f32], out: &mut [f64]) {
        if let [evaluator] = &*self.evaluators {
            return evaluator.evaluate(channels, out);
        }
        let mut lobes = vec![vec![0.0; self.directions]; self.evaluators.len()];
        self.evaluators.iter().zip(&mut lobes).for_each(|(of, lobe)| of.evaluate(channels, lobe));
        for ((lobe, scale), out) in self.shown.iter().zip(out.chunks_exact_mut(self.directions)) {
            out.iter_mut().zip(&lobes[*lobe]).for_each(|(out, f)| *out = scale * f);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lobe_is_its_own_aspect_and_a_material_has_nine() {
        let ggx = "ggx:0.2".parse::<AnyLobe>().unwrap();
        assert_eq!(Aspects::new(&*ggx).count(), 1);
        let paint = "sgd:gold-metallic-paint".parse::<AnyLobe>().unwrap();
        let measured = paint.measured().unwrap();
        let all = Aspects::new(&*paint);
        assert_eq!(all.count(), 9);
        for u in [0.9999_f64, 0.99, 0.9, 0.5] {
            let of = |reflectance| {
                let mut out = [0.0; 9];
                all.add(reflectance, &mut [u], 1.0, Places { out: &mut out, first: 0, stride: 1 });
                out
            };
            let (truth, shown) = (of(Reflectance::True), of(Reflectance::Factored));
            for (part, k) in PARTS.iter().zip([0, 3, 6]) {
                // The table's steps are some thousandths of a highlight that is 8 degrees wide.
                let theta_d = (1.0 - part).powf(0.2).acos();
                let exact = measured.highlight(u.acos(), theta_d);
                for c in 0..3 {
                    let peak = measured.highlight(0.0, theta_d)[c];
                    assert!((truth[k + c] - exact[c]).abs() < 1e-4 * peak, "{u} {c}: {truth:?} {exact}");
                    // Factors are 3 % of the table off, and so they are here, of the peak.
                    assert!((shown[k + c] - exact[c]).abs() < 0.05 * peak, "{u} {c}: {shown:?} {exact}");
                }
            }
        }
    }
}
