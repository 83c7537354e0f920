//! `ndm`: normal distribution mapping, a 3-D Gaussian restricted to the sphere. Olano and North 1997.
//!
//! Mean and covariance of the normals; the base roughness is an initial covariance `v I`, v the lobe's slope
//! variance, which around a unit mean restricts to a vMF lobe of kappa = 1/v. Density
//! `k / sqrt|Σ| g(d)`, `d = (w-mu)ᵀ Σ⁻¹ (w-mu)` (their section 6), with three kernels `g` ([`NdmKernel`]) and
//! three normalisations ([`NdmNormalisation`]). `k` is one constant for a material, with which the lobe of a
//! flat map holds the BRDF's energy `rho_0`.
//!
//! Stored are the moments about the pole, of `n - (0,0,1)`: as linear as those about the origin, the same
//! covariance, and in half floats without the cancellation of `E[z²] - E[z]²` near 1 (the test
//! `moments_about_the_pole_keep_their_digits` has the numbers). Lambert is the mean positive part of `w·n`
//! for that Gaussian.

use std::fmt::{self, Display};

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3};

use super::slopes::stretched;
use super::table::{count_of, counted};
use super::{
    AnyMethod, Decoded, Describe, Encoding, FlatLobe, Form, FormKind, ParameterError, Representation, Row,
    Sample, direction_or_up,
};
use crate::brdf::{Lobe, mean_of_positive_part};
use crate::shader::Shader;
use crate::sphere::frame;
use crate::units::SlopeVariance;
use crate::words;

/// The generator `g(d)` of the elliptically contoured density.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NdmKernel {
    /// The BRDF's own profile, `g(d) = f(1 - v d/2) / f(1)`; ours. A flat map gives back the BRDF, and
    /// Blinn-Phong of exponent m is Pearson II of the same m.
    #[default]
    Profile,
    /// `e^{-d/2}`.
    Gaussian,
    /// Pearson type II, `max(0, 1 - d/(2m))^m`, m = 8 unless told (the stored text of the paper garbles
    /// `2m`).
    Pearson,
}

/// Normalisation: the way in which the density is made to integrate to one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NdmNormalisation {
    /// `1/sqrt|Σ|` and no more: the paper's own pictures.
    #[default]
    Partial,
    /// Times a factor found by integrating over the sphere when baking, stored in the spare channels
    /// for three roughnesses and interpolated between them, as between texels; or for one that is named.
    Integrated,
    /// Replaced by the 2-D Gaussian on the plane through the mean, projected to the sphere.
    Plane,
    /// That Gaussian on the plane that touches the sphere at the mean's direction.
    Tangent,
}

words!(NdmKernel { Profile => "brdf", Gaussian => "gaussian", Pearson => "pearson" });

words!(NdmNormalisation {
    Partial => "partial",
    Integrated => "integrated",
    Plane => "plane",
    Tangent => "tangent",
});

/// Normal distribution mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ndm {
    kernel: NdmKernel,
    normalisation: NdmNormalisation,
    /// `m` of the Pearson kernel.
    m: u8,
    /// Exponent of the only lobe that factors are integrated for.
    gloss: Option<u32>,
}

/// Density whose factors a stored map holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NdmFactors {
    kernel: NdmKernel,
    m: u8,
    gloss: Option<u32>,
}

impl Default for Ndm {
    fn default() -> Self {
        let (kernel, normalisation) = (NdmKernel::default(), NdmNormalisation::default());
        Self { kernel, normalisation, m: PEARSON_M, gloss: None }
    }
}

pub(super) const ROW: Row = Row {
    name: "ndm",
    aliases: &[],
    parameters: "[:KERNEL[=M]][:NORMALISATION]",
    summary: "3-D Gaussian of the normals, restricted to the sphere; kernels brdf, gaussian, pearson[=M]; \
              normalisations partial, integrated[=EXPONENT], plane, tangent",
    paper: "Olano and North 1997",
    parse,
    samples: &[
        "ndm",
        "ndm:plane",
        "ndm:gaussian",
        "ndm:pearson",
        "ndm:gaussian:integrated",
        "ndm:pearson:integrated",
        "ndm:gaussian:plane",
        "ndm:pearson:plane",
        "ndm:tangent",
        "ndm:pearson=3:tangent",
        "ndm:gaussian:integrated=50",
    ],
};

fn parse(words: &[&str]) -> Result<AnyMethod, ParameterError> {
    let (mut kernel, mut normalisation) = (None, None);
    let (mut m, mut gloss) = (PEARSON_M, None);
    for word in words {
        let (name, number) = word.split_once('=').map_or((*word, None), |(name, n)| (name, Some(n)));
        let named_before = if let Ok(named) = name.parse::<NdmKernel>() {
            kernel.replace(named).is_some()
        } else if let Ok(named) = name.parse::<NdmNormalisation>() {
            normalisation.replace(named).is_some()
        } else {
            return Err(ParameterError::Words(format!(
                "`{word}` is no kernel (brdf, gaussian, pearson) and no normalisation (partial, integrated, plane, \
                 tangent)"
            )));
        };
        if named_before {
            return Err(ParameterError::Words(format!("`{word}` is a second word for the same choice")));
        }
        match (name, number) {
            (_, None) => {}
            ("pearson", Some(number)) => {
                let count = count_of(Some(&number));
                m = counted(count, "`m` of Pearson's kernel", 1..=MOST_M, "ndm:pearson=8")? as u8;
            }
            ("integrated", Some(number)) => {
                let count = count_of(Some(&number));
                gloss =
                    Some(counted(count, "exponent", 1..=MOST_GLOSS, "ndm:gaussian:integrated=50")? as u32);
            }
            _ => {
                let said = "only `pearson` and `integrated` take a number";
                return Err(ParameterError::Words(format!("`{word}`: {said}")));
            }
        }
    }
    let ndm = Ndm::new(kernel.unwrap_or_default(), normalisation.unwrap_or_default())?;
    Ok(AnyMethod::from(Ndm { m, gloss, ..ndm }))
}

/// Largest `m` of Pearson's kernel, which is a Gaussian to a hundredth there.
const MOST_M: usize = 64;

/// Largest exponent that factors are integrated for.
const MOST_GLOSS: usize = 100_000;

/// Stored sums: moments of `p = n - (0,0,1)`, and the normalisation factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoleMoments {
    /// `E[p]`.
    mean: [f32; 3],
    /// `E[p pᵀ]`: xx, yy, zz, xy, xz, yz.
    second: [f32; 6],
    /// Factors for the roughnesses of [`FACTOR_VARIANCES`]; 1 unless integrated.
    factors: [f32; 3],
}

/// A Gaussian in space, before the base roughness is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpaceGaussian {
    mean: DVec3,
    covariance: DMat3,
    factors: [f64; 3],
}

impl From<SpaceGaussian> for Decoded {
    fn from(g: SpaceGaussian) -> Self {
        Self::Gaussian { mean: g.mean, covariance: g.covariance }
    }
}

/// Base roughnesses (slope variances) for which factors are stored: exponents 8, 128 and 2048.
const FACTOR_VARIANCES: [f64; 3] = [1.0 / 8.0, 1.0 / 128.0, 1.0 / 2048.0];

/// `m` of the Pearson kernel unless told; the paper used eight.
const PEARSON_M: u8 = 8;

impl Ndm {
    /// `g(d)`; not for [`NdmKernel::Profile`], which has no shape of its own.
    fn generator(&self, d: f64) -> f64 {
        let m = f64::from(self.m);
        match self.kernel {
            NdmKernel::Pearson => (1.0 - d / (2.0 * m)).max(0.0).powf(m),
            NdmKernel::Gaussian | NdmKernel::Profile => (-d / 2.0).exp(),
        }
    }

    /// `∫ g` over the sphere for a flat map of roughness `v`, where d = 2 (1-u) / v: closed forms.
    fn flat_integral(&self, v: f64) -> f64 {
        let m = f64::from(self.m);
        match self.kernel {
            NdmKernel::Pearson => {
                let reach = m * v;
                let behind = (1.0 - 2.0 / reach).max(0.0).powf(m + 1.0);
                2.0 * PI * reach / (m + 1.0) * (1.0 - behind)
            }
            NdmKernel::Gaussian | NdmKernel::Profile => 2.0 * PI * v * -(-2.0 / v).exp_m1(),
        }
    }

    /// `∫ g(m)` over a plane, m the Mahalanobis distance, per unit of `sqrt|T|`.
    fn plane_integral(&self) -> f64 {
        let m = f64::from(self.m);
        match self.kernel {
            NdmKernel::Pearson => 2.0 * PI * m / (m + 1.0),
            NdmKernel::Gaussian | NdmKernel::Profile => 2.0 * PI,
        }
    }

    /// Roughnesses whose factors are stored. A named one takes every place, so that what lies between them is
    /// its own.
    fn factor_variances(&self) -> [f64; 3] {
        self.gloss.map_or(FACTOR_VARIANCES, |gloss| [1.0 / f64::from(gloss); 3])
    }
}

impl SpaceGaussian {
    /// Mean direction, two axes across it, variance along it, and the covariance seen from them.
    fn axes(&self) -> (DVec3, DVec3, DVec3) {
        let mu = direction_or_up(self.mean);
        let (a, b) = frame(mu);
        (mu, a, b)
    }

    /// The covariance with the base roughness `v` added.
    fn widened(&self, v: f64) -> DMat3 {
        with_pivots_above(self.covariance + DMat3::from_diagonal(DVec3::splat(v)), v)
    }

    /// `∫ g(d) / sqrt|Σ|` over the sphere, divided by the same for a flat map of roughness `v`.
    ///
    /// Midpoint rule in two angles, `w = (sin a, cos a sin b, cos a cos b)` with a along the narrower tangent
    /// axis: spacing 0.8 of the narrowest scale, where the rule's error for a Gaussian is e^{-2 pi²/0.64}.
    fn relative_integral(&self, ndm: &Ndm, v: f64) -> f64 {
        let sigma = self.widened(v);
        let (mu, a, b) = self.axes();
        let [aa, bb, ab] = [a.dot(sigma * a), b.dot(sigma * b), a.dot(sigma * b)];
        let angle = 0.5 * (2.0 * ab).atan2(aa - bb);
        let (wide, narrow) = (a * angle.cos() + b * angle.sin(), b * angle.cos() - a * angle.sin());
        let deviation = |axis: DVec3| axis.dot(sigma * axis).max(v).sqrt();
        let along = deviation(mu);
        let (inverse, determinant) = (sigma.inverse(), sigma.determinant());
        let steps = |axis: DVec3, limit: f64| {
            let reach = (7.0 * deviation(axis)).min(limit);
            let count = (2.0 * reach / (0.8 * deviation(axis).min(along))).ceil().clamp(16.0, 1024.0);
            let step = 2.0 * reach / count;
            (0..count as usize).map(move |i| (step * (i as f64 + 0.5) - reach, step))
        };
        let wide_angles: Vec<(f64, f64, f64)> =
            steps(wide, PI).map(|(t, step)| (t.sin(), t.cos(), step)).collect();
        let mut integral = 0.0;
        for (t, step) in steps(narrow, PI / 2.0) {
            let (sin, cos) = (t.sin(), t.cos());
            for (sin_b, cos_b, step_b) in &wide_angles {
                let w = narrow * sin + wide * (cos * sin_b) + mu * (cos * cos_b);
                let d = w - self.mean;
                integral += ndm.generator(d.dot(inverse * d)) * cos * step * step_b;
            }
        }
        integral / determinant.sqrt() / (ndm.flat_integral(v) / v.powf(1.5))
    }

    /// Factor at roughness `v`: the parabola in log-log through the stored ones, and beyond their roughnesses
    /// its value at the nearer end.
    fn factor(&self, v: f64) -> f64 {
        let x = FACTOR_VARIANCES.map(f64::ln);
        let y = self.factors.map(|f| f.max(1e-6).ln());
        let at = v.ln().clamp(x[2], x[0]);
        let basis = |i: usize| {
            let others = [0, 1, 2].into_iter().filter(|j| *j != i);
            others.map(|j| (at - x[j]) / (x[i] - x[j])).product::<f64>()
        };
        (0..3).map(|i| y[i] * basis(i)).sum::<f64>().exp()
    }
}

/// The matrix `L D Lᵀ` of a symmetric matrix, with the pivots held at `floor` or above.
///
/// A covariance plus `floor` times the identity has no pivot below `floor`. Rounding of the stored moments
/// can make the covariance indefinite, which a sharp lobe's small roughness does not mend; this does, and
/// leaves every sound matrix as it is. x and y come first: their moments are the well-conditioned ones.
fn with_pivots_above(m: DMat3, floor: f64) -> DMat3 {
    let d0 = m.x_axis.x.max(floor);
    let (l10, l20) = (m.x_axis.y / d0, m.x_axis.z / d0);
    let d1 = (m.y_axis.y - l10 * l10 * d0).max(floor);
    let l21 = (m.y_axis.z - l20 * l10 * d0) / d1;
    let d2 = (m.z_axis.z - l20 * l20 * d0 - l21 * l21 * d1).max(floor);
    let (c0, c1) = (DVec3::new(1.0, l10, l20), DVec3::new(0.0, 1.0, l21));
    let outer = |c: DVec3, d: f64| DMat3::from_cols(c * (c.x * d), c * (c.y * d), c * (c.z * d));
    outer(c0, d0) + outer(c1, d1) + outer(DVec3::Z, d2)
}

/// Covariance on a plane (xx, yy, xy) with the pivots held at `floor` or above, as those of a restriction of
/// a Gaussian with that base roughness are but for rounding: differences of nearly equal numbers.
fn held_above([xx, yy, xy]: [f64; 3], floor: f64) -> [f64; 3] {
    let xx = xx.max(floor);
    let along = xy / xx;
    [xx, (yy - along * xy).max(floor) + along * xy, xy]
}

impl Display for Ndm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(ROW.name)?;
        if self.kernel != NdmKernel::default() {
            write!(f, ":{}", self.kernel)?;
        }
        if self.m != PEARSON_M {
            write!(f, "={}", self.m)?;
        }
        if self.normalisation != NdmNormalisation::default() {
            write!(f, ":{}", self.normalisation)?;
        }
        self.gloss.map_or(Ok(()), |gloss| write!(f, "={gloss}"))
    }
}

impl Describe for Ndm {
    fn encoding(&self) -> Encoding {
        let Self { kernel, normalisation, m, gloss } = *self;
        let integrated = normalisation == NdmNormalisation::Integrated;
        Encoding::PoleMoments { factors: integrated.then_some(NdmFactors { kernel, m, gloss }) }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Whole
    }

    fn reads(&self, stored: &Encoding) -> bool {
        // Factors that a method does not use do no harm.
        let integrated = self.normalisation == NdmNormalisation::Integrated;
        matches!(stored, Encoding::PoleMoments { .. }) && (!integrated || self.encoding() == *stored)
    }

    fn shader(&self) -> Shader {
        let sources =
            &[include_str!("ndm.wgsl"), include_str!("stretched.wgsl"), include_str!("../sphere.wgsl")];
        Shader::new(FormKind::Whole, sources)
            .constant("KERNEL", self.kernel as u32)
            .constant("NORMALISATION", self.normalisation as u32)
            .constant("PEARSON_M", f32::from(self.m))
    }

    fn flat_lobe(&self, _brdf: &dyn Lobe) -> FlatLobe {
        if self.kernel == NdmKernel::Profile { FlatLobe::Exact } else { FlatLobe::OwnKernel }
    }
}

impl Representation for Ndm {
    type Sums = PoleMoments;
    type Lobes = SpaceGaussian;

    fn zero(&self) -> PoleMoments {
        PoleMoments { mean: [0.0; 3], second: [0.0; 6], factors: [0.0; 3] }
    }

    fn accumulate(&self, sums: &mut PoleMoments, sample: &Sample, weight: f32) {
        let n = sample.normal;
        // 1 - z without its cancellation: (x² + y²) / (1 + z) on the upper half.
        let z = if n.z > 0.0 { -(n.x * n.x + n.y * n.y) / (1.0 + n.z) } else { n.z - 1.0 };
        let (x, y) = (n.x, n.y);
        let one = PoleMoments {
            mean: [x, y, z],
            second: [x * x, y * y, z * z, x * y, x * z, y * z],
            factors: [1.0; 3],
        };
        self.blend(sums, &one, weight);
    }

    fn blend(&self, sums: &mut PoleMoments, part: &PoleMoments, weight: f32) {
        let mix = |sums: &mut [f32], part: &[f32]| {
            for (sum, p) in sums.iter_mut().zip(part) {
                *sum += weight * p;
            }
        };
        mix(&mut sums.mean, &part.mean);
        mix(&mut sums.second, &part.second);
        mix(&mut sums.factors, &part.factors);
    }

    fn pack(&self, sums: &PoleMoments, channels: &mut [f32]) {
        let ([x, y, z], [xx, yy, zz, xy, xz, yz]) = (sums.mean, sums.second);
        let [f0, f1, f2] = sums.factors;
        channels.copy_from_slice(&[x, y, z, f0, xx, yy, zz, f1, xy, xz, yz, f2]);
    }

    fn unpack(&self, c: &[f32]) -> PoleMoments {
        PoleMoments {
            mean: [c[0], c[1], c[2]],
            second: [c[4], c[5], c[6], c[8], c[9], c[10]],
            factors: [c[3], c[7], c[11]],
        }
    }

    fn decode(&self, sums: &PoleMoments) -> SpaceGaussian {
        let p = DVec3::from_array(sums.mean.map(f64::from));
        let [xx, yy, zz, xy, xz, yz] = sums.second.map(f64::from);
        let (xx, yy, zz) = ((xx - p.x * p.x).max(0.0), (yy - p.y * p.y).max(0.0), (zz - p.z * p.z).max(0.0));
        let (xy, xz, yz) = (xy - p.x * p.y, xz - p.x * p.z, yz - p.y * p.z);
        let columns = [DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz)];
        let covariance = DMat3::from_cols(columns[0], columns[1], columns[2]);
        SpaceGaussian { mean: p + DVec3::Z, covariance, factors: sums.factors.map(f64::from) }
    }

    fn form<'a>(&'a self, lobes: &SpaceGaussian) -> Form<'a> {
        Form::Whole(lobes.mean)
    }

    /// The lobe's energy, which kernels of their own shape are scaled to.
    fn table(&self, lobe: &dyn Lobe) -> Vec<f64> {
        let own = self.kernel != NdmKernel::Profile && lobe.slope_variance().is_some();
        if own { lobe.zonal(0) } else { Vec::new() }
    }

    fn effective<'a>(&'a self, lobes: &SpaceGaussian, lobe: &'a dyn Lobe) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        self.effective_of(*lobes, lobe, self.table(lobe).first().copied())
    }

    fn effective_with<'a>(
        &'a self,
        lobes: &SpaceGaussian,
        lobe: &'a dyn Lobe,
        table: &'a [f64],
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        self.effective_of(*lobes, lobe, table.first().copied())
    }

    fn has_finish(&self) -> bool {
        self.normalisation == NdmNormalisation::Integrated
    }

    fn finish(&self, channels: &mut [f32]) {
        let mut sums = self.unpack(channels);
        let gaussian = self.decode(&sums);
        // Less spread than this changes no factor by more than 1e-5, at any roughness that has one.
        let spread: f64 = (0..3).map(|i| gaussian.covariance.col(i)[i]).sum();
        if spread > 1e-9 || gaussian.mean.distance(direction_or_up(gaussian.mean)) > 1e-6 {
            for (factor, v) in sums.factors.iter_mut().zip(self.factor_variances()) {
                *factor = (1.0 / gaussian.relative_integral(self, v)) as f32;
            }
        }
        self.pack(&sums, channels);
    }
}

impl Ndm {
    /// A density of this kernel and normalisation.
    ///
    /// # Errors
    /// [`ParameterError::UnknownLobe`] for integrated factors of the lobe's own profile, which baking does
    /// not know.
    pub fn new(kernel: NdmKernel, normalisation: NdmNormalisation) -> Result<Self, ParameterError> {
        if kernel == NdmKernel::Profile && normalisation == NdmNormalisation::Integrated {
            return Err(ParameterError::UnknownLobe);
        }
        Ok(Self { kernel, normalisation, ..Self::default() })
    }

    /// Returns it with another `m` of Pearson's kernel, 1 to 64.
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another number.
    pub fn pearson_m(self, m: usize) -> Result<Self, ParameterError> {
        let m = counted(m, "`m` of Pearson's kernel", 1..=MOST_M, "ndm:pearson=8")? as u8;
        Ok(Self { m, ..self })
    }

    /// Returns it with factors integrated for a Blinn-Phong lobe of this exponent alone, 1 to 100 000: exact
    /// for that, and wrong for others.
    ///
    /// # Errors
    /// [`ParameterError::Count`] for another exponent.
    pub fn integrated_for(self, exponent: usize) -> Result<Self, ParameterError> {
        let gloss = counted(exponent, "exponent", 1..=MOST_GLOSS, "ndm:gaussian:integrated=50")? as u32;
        Ok(Self { gloss: Some(gloss), ..self })
    }

    /// The effective lobe; `energy` is that of the BRDF, for a kernel that is not the BRDF's own.
    fn effective_of<'a>(
        self,
        g: SpaceGaussian,
        lobe: &'a dyn Lobe,
        energy: Option<f64>,
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let Some(base) = lobe.slope_variance() else {
            return Box::new(move |w| mean_of_positive_part(w.dot(g.mean), w.dot(g.covariance * w)));
        };
        let energy = energy.unwrap_or(1.0);
        if matches!(self.normalisation, NdmNormalisation::Plane | NdmNormalisation::Tangent) {
            self.on_plane(g, lobe, base, energy)
        } else {
            self.on_sphere(g, lobe, base, energy)
        }
    }

    /// The density on the sphere.
    fn on_sphere<'a>(
        self,
        g: SpaceGaussian,
        lobe: &'a dyn Lobe,
        base: SlopeVariance,
        energy: f64,
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let v = base.get();
        let sigma = g.widened(v);
        let inverse = sigma.inverse();
        let factor = if self.normalisation == NdmNormalisation::Integrated { g.factor(v) } else { 1.0 };
        let scale = factor * (v.powi(3) / sigma.determinant().max(f64::MIN_POSITIVE)).sqrt();
        let distance = move |w: DVec3| (w - g.mean).dot(inverse * (w - g.mean)).max(0.0);
        match self.kernel {
            NdmKernel::Profile => Box::new(move |w| scale * lobe.evaluate(1.0 - v * distance(w) / 2.0)),
            NdmKernel::Gaussian | NdmKernel::Pearson => {
                let scale = scale * energy / self.flat_integral(v);
                Box::new(move |w| scale * self.generator(distance(w)))
            }
        }
    }

    /// The density on the plane through the mean, or on that which touches the sphere at the mean's
    /// direction, projected from the centre of the sphere.
    fn on_plane<'a>(
        self,
        g: SpaceGaussian,
        lobe: &'a dyn Lobe,
        base: SlopeVariance,
        energy: f64,
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let (mu, a, b) = g.axes();
        let short = g.mean.length().clamp(1e-3, 1.0);
        let sigma = g.widened(base.get());
        // Restriction of a Gaussian to a plane: its covariance given the coordinate across the plane, and its
        // mean, which is in the middle of the plane through it.
        let (sa, sb, along) = (a.dot(sigma * mu), b.dot(sigma * mu), mu.dot(sigma * mu));
        let tangent = self.normalisation == NdmNormalisation::Tangent;
        let length = if tangent { 1.0 } else { short };
        let middle = DVec2::new(sa, sb) * ((length - short) / along);
        let covariance = held_above(
            [
                a.dot(sigma * a) - sa * sa / along,
                b.dot(sigma * b) - sb * sb / along,
                a.dot(sigma * b) - sa * sb / along,
            ],
            base.get(),
        );
        // The cosine to the mean, and the place on the plane less the middle.
        let place = move |w: DVec3| {
            let u = w.dot(mu);
            (u, DVec2::new(w.dot(a), w.dot(b)) * (length / u) - middle)
        };
        if self.kernel == NdmKernel::Profile {
            let p22 = stretched(lobe, base, covariance);
            return Box::new(move |w| match place(w) {
                (u, d) if u > 0.0 => p22(d) * length * length / u.powi(3),
                _ => 0.0,
            });
        }
        let [aa, bb, ab] = covariance;
        let determinant = (aa * bb - ab * ab).max(f64::MIN_POSITIVE);
        let scale = energy * length * length / (self.plane_integral() * determinant.sqrt());
        Box::new(move |w| match place(w) {
            (u, d) if u > 0.0 => {
                let m = (bb * d.x * d.x - 2.0 * ab * d.x * d.y + aa * d.y * d.y) / determinant;
                scale * self.generator(m) / u.powi(3)
            }
            _ => 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::brdf::AnyLobe;
    use crate::pyramid::Precision;
    use crate::sphere::gauss_legendre;
    use glam::Vec3;

    fn sums_of(ndm: Ndm, normals: &[Vec3]) -> PoleMoments {
        let mut sums = ndm.zero();
        for normal in normals {
            ndm.accumulate(
                &mut sums,
                &Sample { normal: *normal, height: 0.0, spread: [0.0; 3] },
                1.0 / normals.len() as f32,
            );
        }
        sums
    }

    fn groove() -> Vec<Vec3> {
        vec![Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.1, 0.3, 0.9).normalize()]
    }

    fn integral(f: &dyn Fn(DVec3) -> f64) -> f64 {
        let mut sum = 0.0;
        for (z, weight) in gauss_legendre(400) {
            for k in 0..400 {
                let (sin, cos) = (2.0 * PI * f64::from(k) / 400.0).sin_cos();
                let r = (1.0 - z * z).sqrt();
                sum += f(DVec3::new(r * cos, r * sin, z)) * weight * 2.0 * PI / 400.0;
            }
        }
        sum
    }

    #[test]
    fn integrated_factors_make_the_density_integrate_to_one() {
        for kernel in [NdmKernel::Gaussian, NdmKernel::Pearson] {
            let ndm = Ndm { kernel, normalisation: NdmNormalisation::Integrated, ..Ndm::default() };
            let mut channels = [0.0; 12];
            ndm.pack(&sums_of(ndm, &groove()), &mut channels);
            ndm.finish(&mut channels);
            let g = ndm.decode(&ndm.unpack(&channels));
            // At a roughness with a stored factor, only the factor's single precision and the 400×400 check
            // are left; midway between two of them the parabola is off by up to 6 % on so extreme a pair.
            for (s, tolerance) in
                [("blinn-phong:8", 1e-4), ("blinn-phong:128", 1e-4), ("blinn-phong:32", 0.06)]
            {
                let lobe = s.parse::<AnyLobe>().unwrap();
                let effective = ndm.effective(&g, &*lobe);
                let total = integral(&effective);
                assert!((total - 1.0).abs() < tolerance, "{kernel:?} {s}: {total}");
            }
        }
    }

    #[test]
    fn factors_for_a_named_exponent_are_exact_for_it() {
        for kernel in ["gaussian", "pearson", "pearson=3"] {
            let lobe = "blinn-phong:32".parse::<AnyLobe>().unwrap();
            let method = format!("ndm:{kernel}:integrated=32").parse::<AnyMethod>().unwrap();
            assert_eq!(method.to_string(), format!("ndm:{kernel}:integrated=32"));
            let ndm = method.as_any().downcast_ref::<Ndm>().unwrap();
            let mut channels = [0.0; 12];
            ndm.pack(&sums_of(*ndm, &groove()), &mut channels);
            ndm.finish(&mut channels);
            let g = ndm.decode(&ndm.unpack(&channels));
            let total = integral(&ndm.effective(&g, &*lobe));
            // Single precision of the factor, and the check's own 400 × 400; with so small an m the density
            // ends at a kink, which the midpoint rule meets to a thousandth.
            let bound = if kernel == "pearson=3" { 1e-3 } else { 1e-4 };
            assert!((total - 1.0).abs() < bound, "{kernel}: {total}");
        }
    }

    #[test]
    fn planes_through_and_at_the_mean_meet_where_normals_hardly_stray() {
        let normals: Vec<Vec3> = (0..8)
            .map(|i| Vec3::new(0.3 + 0.01 * (i as f32).sin(), 0.01 * (2.0 * i as f32).cos(), 1.0).normalize())
            .collect();
        let lobe = "beckmann:0.2".parse::<AnyLobe>().unwrap();
        let of = |normalisation, w: DVec3| {
            let ndm = Ndm { normalisation, ..Ndm::default() };
            ndm.effective(&ndm.decode(&sums_of(ndm, &normals)), &*lobe)(w)
        };
        for w in [DVec3::new(0.3, 0.0, 0.95), DVec3::new(0.1, 0.1, 0.9)].map(DVec3::normalize) {
            let [plane, tangent] = [NdmNormalisation::Plane, NdmNormalisation::Tangent].map(|n| of(n, w));
            // The planes are 1e-4 apart.
            assert!((plane / tangent - 1.0).abs() < 1e-3, "{plane} {tangent}");
        }
        // Normals that stray: both are densities, to the part that lies below the horizon of the mean.
        let g = |ndm: Ndm| ndm.decode(&sums_of(ndm, &groove()));
        for normalisation in [NdmNormalisation::Plane, NdmNormalisation::Tangent] {
            let ndm = Ndm { normalisation, ..Ndm::default() };
            let total = integral(&ndm.effective(&g(ndm), &*lobe));
            assert!((total - 1.0).abs() < 0.05, "{normalisation}: {total}");
        }
    }

    #[test]
    fn partial_normalisation_is_not_one_and_says_so() {
        let ndm =
            Ndm { kernel: NdmKernel::Gaussian, normalisation: NdmNormalisation::Partial, ..Ndm::default() };
        let g = ndm.decode(&sums_of(ndm, &groove()));
        let lobe = "blinn-phong:128".parse::<AnyLobe>().unwrap();
        let total = integral(&ndm.effective(&g, &*lobe));
        assert!((total - 1.0).abs() > 0.02, "{total}");
    }

    #[test]
    fn sharp_lobes_on_a_plane_stay_numbers() {
        // Steep normals, alone and in pairs: rounding to half floats is all the covariance that is left, or
        // far more than the lobe's own.
        for i in 0..200 {
            let (x, y) = (f32::sin(1.3 * i as f32), f32::cos(2.1 * i as f32));
            let normals = [Vec3::new(x, y, 0.3).normalize(), Vec3::new(y, 0.9 * x, 0.4).normalize()];
            for kernel in NdmKernel::ALL {
                let ndm = Ndm { kernel, normalisation: NdmNormalisation::Plane, ..Ndm::default() };
                let mut channels = [0.0; 12];
                ndm.pack(&sums_of(ndm, &normals[..1 + i % 2]), &mut channels);
                let (mut bytes, mut stored) = (Vec::new(), Vec::new());
                Precision::Half.pack(&channels, &mut bytes);
                Precision::Half.unpack(&bytes, &mut stored);
                let g = ndm.decode(&ndm.unpack(&stored));
                for spelling in ["ggx:0.003", "ggx:0.0001", "blinn-phong:100000"] {
                    let lobe = spelling.parse::<AnyLobe>().unwrap();
                    let (effective, peak) = (ndm.effective(&g, &*lobe), lobe.evaluate(1.0));
                    for n in [g.mean.normalize(), normals[0].as_dvec3().normalize()] {
                        let f = effective(n);
                        // No wider lobe is brighter than the flat map's; kernels of their own have other
                        // peaks.
                        assert!((0.0..=2.0 * peak).contains(&f), "{i} {kernel} {spelling}: {f} of {peak}");
                    }
                }
            }
        }
    }

    #[test]
    fn blinn_phong_is_pearson_ii() {
        let bp = "blinn-phong:8".parse::<AnyLobe>().unwrap();
        let [own, pearson] = [NdmKernel::Profile, NdmKernel::Pearson].map(|kernel| Ndm {
            kernel,
            normalisation: NdmNormalisation::Partial,
            ..Ndm::default()
        });
        let g = own.decode(&sums_of(own, &groove()));
        let w = DVec3::new(0.3, 0.2, 0.9).normalize();
        let (a, b) = (own.effective(&g, &*bp)(w), pearson.effective(&g, &*bp)(w));
        // Pearson's flat lobe is normalised over u > -1, Blinn-Phong's over u > 0: equal here, as m v = 1.
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }

    #[test]
    fn moments_about_the_pole_keep_their_digits() {
        // Slopes of deviation 0.02: covariance 4e-4. Half-float moments about the origin cancel from 1
        // with steps of 5e-4, about the pole from 4e-4 with steps of 2e-7.
        let normals: Vec<Vec3> = (0..64)
            .map(|i| Vec3::new(0.02 * (i as f32).sin(), 0.03 * (1.7 * i as f32).cos(), 1.0).normalize())
            .collect();
        let ndm =
            Ndm { kernel: NdmKernel::Gaussian, normalisation: NdmNormalisation::Partial, ..Ndm::default() };
        let sums = sums_of(ndm, &normals);
        let exact = ndm.decode(&sums).covariance;
        let half = |values: &[f32]| {
            let (mut bytes, mut back) = (Vec::new(), Vec::new());
            Precision::Half.pack(values, &mut bytes);
            Precision::Half.unpack(&bytes, &mut back);
            back
        };
        let mut channels = [0.0; 12];
        ndm.pack(&sums, &mut channels);
        let about_pole = ndm.decode(&ndm.unpack(&half(&channels))).covariance;
        let mean = |f: &dyn Fn(Vec3) -> f32| normals.iter().map(|n| f(*n)).sum::<f32>() / 64.0;
        let about_origin = half(&[mean(&|n| n.z), mean(&|n| n.z * n.z)]);
        let zz_about_origin = f64::from(about_origin[1]) - f64::from(about_origin[0]).powi(2);
        let error_pole = (about_pole.z_axis.z - exact.z_axis.z).abs();
        let error_origin = (zz_about_origin - exact.z_axis.z).abs();
        // Against the covariance 1/400 of a base lobe of s = 400: nothing, and a fifth of it.
        assert!(error_pole < 1e-7 && error_origin > 2e-4, "{error_pole} {error_origin}");
    }
}
