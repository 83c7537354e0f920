//! Measured lobes: `kd + f(theta_h) g(theta_d)` in each channel, f a sum of kernels that widen in closed
//! form.
//!
//! Han et al. 2007, section 4, take measured materials in the factored form of Lawrence et al. 2006: f is a
//! lobe around the half-vector, and g does not depend on the normal. The factors are fitted to a table of
//! measurements (`factor.rs`), or to a table of values of a published fit (`analytic.rs`); [`Residual`] has
//! the error that this leaves. f is stored as a sum of von Mises-Fisher kernels, none of negative weight:
//! convolving with a lobe of normals adds its variance to each kernel's, which is what the paper's zonal
//! series `Σ Lambda_l rho_l Y_l0` does order by order, without its hundreds of orders for a shiny material
//! (`docs/decisions.md`). With Han et al.'s factor `max(n·wi, 0)` the lobe is the measured reflectance,
//! but for that error. Truths do not have it: they ask for [`Measured::reflectance`], the material itself.
//!
//! Each channel has an f of its own. What shades a texel does so channel by channel ([`Measured::channel`]).

mod analytic;
mod factor;
mod kernels;
mod table;

pub use factor::Residual;
pub use table::{BINS, MeasuredTable, half_angle};

use std::borrow::Cow;
use std::f64::consts::PI;
use std::fmt::{self, Display, Write as _};
use std::sync::Arc;

use glam::DVec3;

use super::{AnyLobe, Lobe, Microfacets, Row, Widen, twin};
use crate::units::SlopeVariance;
use crate::words;
use kernels::kernel;

/// A measured lobe.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Name, as on the command line.
    name: String,
    material: Arc<Material>,
    /// The one channel that it shows; `None` for the material as a whole.
    channel: Option<usize>,
    /// Slope variance that widened it.
    widened: SlopeVariance,
}

/// Material behind a lobe.
#[derive(Debug)]
struct Material {
    source: Source,
    factors: LobeFactors,
}

/// Origin of a material's reflectance.
#[derive(Debug)]
enum Source {
    Published(analytic::Material),
    Table(MeasuredTable),
}

/// The factors of a material.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeFactors {
    /// Diffuse albedo, linear RGB: pi times the constant part.
    pub diffuse: DVec3,
    /// f and g of red, green and blue.
    pub channels: [ChannelFactors; 3],
    /// Error that the fit leaves.
    pub residual: Residual,
}

/// Turns of the difference that tell apart all that published fits depend on.
const TURNS: u32 = 16;

/// Number of coefficients of g.
pub const TINT: usize = 12;

/// The factors of a channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelFactors {
    /// Kernels of f: weight, and variance on one axis.
    pub kernels: Vec<(f64, f64)>,
    /// `g cos² theta_d` by its coefficients of Bernstein's polynomials in `1 - cos theta_d`, none negative.
    pub tint: [f64; TINT],
}

impl ChannelFactors {
    /// Factors of these weights of all kernels; those that say nothing are left out.
    fn new(weights: &[f64], tint: [f64; TINT]) -> Self {
        let light: f64 = weights.iter().sum();
        let alive = weights.iter().enumerate().filter(|(_, w)| **w > 1e-6 * light);
        Self { kernels: alive.map(|(k, w)| (*w, kernels::variance(k))).collect(), tint }
    }

    /// f at the cosine u of `theta_h`.
    fn value(&self, u: f64) -> f64 {
        self.widened(0.0, u)
    }

    /// f widened by a variance.
    fn widened(&self, by: f64, u: f64) -> f64 {
        self.kernels.iter().map(|(weight, variance)| weight * kernel(variance + by, u.min(1.0))).sum()
    }

    /// Variance of f: that of a Gaussian of the same height and light; `None` where there is no light.
    fn variance(&self) -> Option<f64> {
        let (light, height) = self.kernels.iter().fold((0.0, 0.0), |(light, height), (weight, variance)| {
            (light + weight, height + weight * kernel(*variance, 1.0))
        });
        (light > 0.0).then(|| light / (2.0 * PI * height))
    }
}

pub(super) const SGD: Row = Row {
    name: "sgd",
    parameter: ":NAME",
    summary: "a MERL material by its fit of Bagher, Soler and Holzschuch 2012, factored, in its own colours",
    parse: |name| Ok(AnyLobe::from(Measured::published(PublishedFit::Sgd, name)?)),
    samples: &["sgd:blue-fabric", "sgd:gold-metallic-paint"],
};

pub(super) const ABC: Row = Row {
    name: "abc",
    parameter: ":NAME",
    summary: "a MERL material by its fit of Löw et al. 2012, factored, in its own colours",
    parse: |name| Ok(AnyLobe::from(Measured::published(PublishedFit::Abc, name)?)),
    samples: &["abc:pearl-paint"],
};

/// Published fits of the hundred MERL materials.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PublishedFit {
    /// Shifted gamma: Bagher, Soler and Holzschuch 2012.
    Sgd,
    /// ABC: Löw et al. 2012.
    Abc,
}

words!(PublishedFit { Sgd => "sgd", Abc => "abc" });

/// Names of the materials with published fits.
#[must_use]
pub fn materials() -> Vec<&'static str> {
    analytic::names()
}

/// Reflectance of a published fit for unit directions to the light and the eye about the normal z, RGB.
///
/// # Errors
/// A sentence that says what is wrong with the name, and which is nearest.
pub fn published(fit: PublishedFit, name: &str) -> Result<impl Fn(DVec3, DVec3) -> DVec3 + use<>, String> {
    analytic::find(fit, name).map(|material| move |wi, wo| material.reflectance(wi, wo))
}

impl Measured {
    /// The material of this name, factored from a published fit.
    ///
    /// # Errors
    /// A sentence that says what is wrong with the name, and which is nearest.
    pub fn published(fit: PublishedFit, name: &str) -> Result<Self, String> {
        let material = analytic::find(fit, name)?;
        let table = MeasuredTable::of(TURNS as usize, |wi, wo| material.reflectance(wi, wo));
        let factors = factor::factor(&table);
        Ok(Self::of(&format!("{fit}:{name}"), Material { source: Source::Published(material), factors }))
    }

    /// Factors a table of measurements.
    #[must_use]
    pub fn new(name: &str, table: MeasuredTable) -> Self {
        let factors = factor::factor(&table);
        Self::of(name, Material { source: Source::Table(table), factors })
    }

    fn of(name: &str, material: Material) -> Self {
        let (name, material) = (name.to_owned(), Arc::new(material));
        Self { name, material, channel: None, widened: SlopeVariance::ZERO }
    }

    /// The factors.
    #[must_use]
    pub fn factors(&self) -> &LobeFactors {
        &self.material.factors
    }

    /// Reflectance of the material itself, linear RGB, before factoring, for unit directions to the light and
    /// the eye about the normal z; zero where one is below the surface.
    #[must_use]
    pub fn reflectance(&self, wi: DVec3, wo: DVec3) -> DVec3 {
        match &self.material.source {
            Source::Published(material) => material.reflectance(wi, wo),
            Source::Table(table) => table.reflectance(wi, wo),
        }
    }

    /// Reflectance of the material itself at a half angle and a difference angle, without the diffuse part of
    /// its factors: the mean over the turns of the difference, by both cosines squared.
    #[must_use]
    pub fn highlight(&self, theta_h: f64, theta_d: f64) -> DVec3 {
        let (mut sum, mut all) = (DVec3::ZERO, 0.0);
        for turn in 0..TURNS {
            let phi_d = PI * (f64::from(turn) + 0.5) / f64::from(TURNS);
            let (wi, wo) = table::directions(theta_h, theta_d, phi_d);
            if wi.z > 0.0 && wo.z > 0.0 {
                let weight = (wi.z * wo.z).powi(2);
                sum += self.reflectance(wi, wo) * weight;
                all += weight;
            }
        }
        if all > 0.0 { sum / all - self.factors().diffuse / PI } else { DVec3::ZERO }
    }

    /// Lobe of one channel, 0 to 2, whose colours are grey: the channel's own.
    #[must_use]
    pub fn channel(&self, channel: usize) -> Self {
        Self { channel: Some(channel), ..self.clone() }
    }

    /// Highlight by the factors, f g in each channel, at the cosines of `theta_h` and of `theta_d`.
    #[must_use]
    pub fn factored(&self, u: f64, difference: f64) -> DVec3 {
        DVec3::from([0, 1, 2].map(|c| self.channel(c).evaluate(u))) * self.tint(difference)
    }

    /// Factors of the channels that it shows.
    fn shown(&self) -> &[ChannelFactors] {
        let all = &self.factors().channels;
        self.channel.map_or(all.as_slice(), |c| &all[c..=c])
    }

    /// Variance of the lobe as it was fitted: the narrowest channel's.
    fn own_variance(&self) -> f64 {
        self.shown().iter().filter_map(ChannelFactors::variance).reduce(f64::min).unwrap_or(0.1)
    }

    /// True where nothing widened it.
    #[must_use]
    pub fn is_itself(&self) -> bool {
        self.widened == SlopeVariance::ZERO
    }
}

impl PartialEq for Measured {
    fn eq(&self, other: &Self) -> bool {
        let same = Arc::ptr_eq(&self.material, &other.material) || self.factors() == other.factors();
        same && self.name == other.name && self.channel == other.channel && self.widened == other.widened
    }
}

/// Least cosine whose square divides g: 89.4 degrees, past the middle of the last bin but one.
const LEAST_COSINE: f64 = 0.01;

/// Functions of the cosine of `theta_d` that g is a sum of: Bernstein's polynomials in `1 - u`, over `u²`. A
/// reflectance is a fraction over the two cosines to the normal, which at the narrow half angles of a
/// highlight are both `cos theta_d`, and its numerator is smooth. None is negative, and neither is g.
fn tint_basis(u: f64) -> [f64; TINT] {
    let u = u.clamp(LEAST_COSINE, 1.0);
    let last = TINT as i32 - 1;
    std::array::from_fn(|i| BINOMIALS[i] * (1.0 - u).powi(i as i32) * u.powi(last - i as i32) / (u * u))
}

/// Binomial coefficients of Bernstein's polynomials.
const BINOMIALS: [f64; TINT] = [1.0, 11.0, 55.0, 165.0, 330.0, 462.0, 462.0, 330.0, 165.0, 55.0, 11.0, 1.0];

/// g from its coefficients, at the cosine of `theta_d`.
fn tint_at(tint: &[f64; TINT], u: f64) -> f64 {
    tint.iter().zip(tint_basis(u)).map(|(c, b)| c * b).sum()
}

impl Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl Widen for Measured {
    fn widened(&self, by: SlopeVariance) -> Self {
        Self { widened: self.widened.widen(by), ..self.clone() }
    }

    /// Of the material as a whole, the mean over its channels.
    fn value_widened(&self, by: SlopeVariance, u: f64) -> f64 {
        if u <= 0.0 {
            return 0.0;
        }
        let (by, shown) = (self.widened.widen(by).get(), self.shown());
        shown.iter().map(|channel| channel.widened(by, u)).sum::<f64>() / shown.len() as f64
    }
}

impl Lobe for Measured {
    fn evaluate(&self, u: f64) -> f64 {
        self.value_widened(SlopeVariance::ZERO, u)
    }

    fn slope_variance(&self) -> Option<SlopeVariance> {
        Some(SlopeVariance::clamped(self.own_variance()).widen(self.widened))
    }

    fn tint(&self, u: f64) -> DVec3 {
        let of = |c: usize| tint_at(&self.factors().channels[c].tint, u);
        self.channel.map_or_else(|| DVec3::new(of(0), of(1), of(2)), |c| DVec3::splat(of(c)))
    }

    fn measured(&self) -> Option<&Measured> {
        self.channel.is_none().then_some(self)
    }

    fn microfacets(&self) -> Microfacets {
        Microfacets::Ggx
    }

    fn as_beckmann(&self) -> Option<super::Beckmann> {
        None
    }

    /// The numbers are written into the text.
    fn shader(&self) -> Cow<'static, str> {
        let mut text = [include_str!("measured.wgsl"), twin::GAUSSIAN_FACETS, twin::SLOPE_PROFILE].join("\n");
        let _ = writeln!(text, "\nconst LEAST_DIFFERENCE: f32 = {LEAST_COSINE:?};");
        text += &self.switch("own_variance() -> f32", |channel| {
            format!("return {:?};", channel.variance().unwrap_or(0.1) as f32)
        });
        text += &self.switch("kernels(by: f32, u: f32) -> f32", |channel| {
            let term = |(weight, variance): &(f64, f64)| {
                format!("{:?} * kernel({:?} + by, u)", *weight as f32, *variance as f32)
            };
            let sum: Vec<String> = channel.kernels.iter().map(term).collect();
            format!("return {};", if sum.is_empty() { "0.0".into() } else { sum.join("\n            + ") })
        });
        text += &self.switch("tint_polynomial(x: f32) -> f32", |channel| {
            let [first, rest @ ..] = channel.tint.map(|c| c as f32);
            let mut body = format!("var sum = {first:?};\n            var power = x;\n");
            for (c, binomial) in rest.iter().zip(&BINOMIALS[1..]) {
                let c = c * *binomial as f32;
                let _ = writeln!(body, "            sum = sum * (1.0 - x) + {c:?} * power;");
                body += "            power *= x;\n";
            }
            body + "            return sum;"
        });
        text.into()
    }

    /// Slope variance that widened it; the rest is in the text.
    fn base(&self) -> f64 {
        self.widened.get()
    }
}

impl Measured {
    /// A function in WGSL that returns what `body` says of the channel that is being shaded.
    fn switch(&self, head: &str, body: impl Fn(&ChannelFactors) -> String) -> String {
        let mut text = format!("\nfn {head} {{\n    switch channel {{\n");
        for (c, channel) in self.factors().channels.iter().enumerate() {
            let case = if c == 2 { "default".to_owned() } else { format!("case {c}u") };
            let _ = writeln!(text, "        {case}: {{\n            {}\n        }}", body(channel));
        }
        text + "    }\n}\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brdf::zonal_by_quadrature;
    use crate::sphere::legendre;

    #[test]
    fn colours_are_finite() {
        for name in materials() {
            let lobe = (SGD.parse)(name).unwrap();
            let material = lobe.measured().unwrap();
            let diffuse = material.factors().diffuse;
            assert!(diffuse.min_element() >= 0.0 && diffuse.max_element() < 1.0, "{name} {diffuse}");
            for u in [0.0, 0.3, 1.0] {
                let colour = material.factored(1.0, u);
                assert!(colour.is_finite() && colour.min_element() >= 0.0, "{name}");
            }
        }
    }

    #[test]
    fn a_material_of_the_form_is_found_again() {
        // kd + f g with f a kernel between those of the dictionary, and g a polynomial.
        let (kd, f) = (DVec3::new(0.05, 0.1, 0.02), |u: f64| 0.08 * kernel(0.0123, u));
        let g = |u: f64| DVec3::new(1.0, 0.8, 0.6) + DVec3::ONE * (1.0 - u).powi(5);
        let table = MeasuredTable::of(4, |wi, wo| {
            let wh = (wi + wo).normalize();
            kd + f(wh.z) * g(wh.dot(wi))
        });
        let lobe = Measured::new("test:form", table);
        let LobeFactors { diffuse, residual, .. } = lobe.factors();
        assert!(residual.factored < 0.01, "{residual:?}");
        assert!((*diffuse / PI - kd).length() < 0.01, "{}", *diffuse / PI);
        for (u, d) in [(1.0, 1.0), (0.99, 0.8), (0.98, 0.5)] {
            let (got, expected) = (lobe.factored(u, d), f(u) * g(d));
            // Two kernels of the dictionary make one between them to 1 % (so does scipy's nonnegative least
            // squares); descent has not quite ended.
            assert!((got - expected).length() < 0.03 * expected.length(), "{u}: {got} {expected}");
        }
    }

    #[test]
    fn widening_is_the_zonal_series() {
        // Han et al.'s series, to an order where it has ended: Lambda_l of normals of variance v against the
        // same added to each kernel.
        for name in ["blue-fabric", "gold-metallic-paint", "pearl-paint"] {
            let lobe = (SGD.parse)(name).unwrap();
            let v = 0.02;
            let rho = zonal_by_quadrature(&*lobe, 48);
            // A_l of the normals' lobe: A_{l-1} = A_{l+1} + (2l+1) v A_l, downwards.
            let mut ratio = vec![0.0; 200];
            for l in (1..199).rev() {
                ratio[l] = 1.0 / ((2 * l + 1) as f64 * v + ratio[l + 1]);
            }
            let peak = lobe.evaluate_widened(SlopeVariance::clamped(v), 1.0);
            for u in [1.0, 0.98, 0.9, 0.7] {
                let (mut sum, mut a) = (0.0, 1.0);
                for (l, p) in legendre(48, u).iter().enumerate() {
                    a *= if l == 0 { 1.0 } else { ratio[l] };
                    sum += (2 * l + 1) as f64 / (4.0 * PI) * a * rho[l] * p;
                }
                let got = lobe.evaluate_widened(SlopeVariance::clamped(v), u);
                // Variances add exactly for Gaussians in the plane; on the sphere to some 2 % of the peak at
                // this width. The series itself rings by exp(-48² v/2), which is nothing.
                assert!((got - sum).abs() < 0.02 * peak, "{name} at {u}: {got} {sum}");
            }
        }
    }
}
