//! Shading models of the papers: how a surface answers a light, by a lobe, what multiplies it, and a diffuse
//! part.
//!
//! Light sent to the eye by one normal, per unit of irradiance on a plane that faces the light: `F(u) f(wh·n)
//! c(n) + share(F) albedo max(wi·n, 0)/pi`, with u = wi·wh. The factor c sets the models apart. It varies
//! slowly with n, while f is narrow, and that makes filtering possible (`ndf/reflect.rs`).

use std::f64::consts::PI;

use glam::DVec3;

use crate::brdf::{AnyLobe, Argument, Measured};
use crate::units::SlopeVariance;
use crate::words;

/// Shading model: the factor and the Fresnel term that go with a lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadingModel {
    /// Tan et al. 2005, section 3, a Cook-Torrance model without attenuation: `c = 1/(n·wo)`, Schlick's F,
    /// and `1 - F` on the diffuse part. The cosine is held to [`LEAST_COSINE`], below which the paper says
    /// nothing.
    Tan,
    /// Han et al. 2007, section 6: `c = max(n·wi, 0)`, no F.
    Han,
    /// Walter et al. 2007, equation 20: `c = G/(4 n·wo)`, G Smith's for the lobe's own width, Schlick's F.
    Smith,
    /// Dupuy et al. 2013 without shadowing: `c = 1/(4 n·wo (1 + Lambda(wo)))`, Schlick's F. Facets hide each
    /// other from the eye, but not from the light.
    Masked,
    /// Dupuy et al. 2013 in full: `c = 1/(4 n·wo (1 + Lambda(wo) + Lambda(wi)))`, Schlick's F.
    Shadowed,
}

/// Least `n·wo` that Tan et al.'s model divides by: a normal turned further from the eye counts as one at 87
/// degrees.
pub const LEAST_COSINE: f64 = 0.05;

words!(ShadingModel { Tan => "tan", Han => "han", Smith => "smith", Masked => "masked", Shadowed => "shadowed" });

impl ShadingModel {
    /// Number of the model in shaders.
    #[must_use]
    pub fn index(self) -> u32 {
        self as u32
    }

    /// The Fresnel term: Schlick's, from the reflectance at normal incidence; for Han et al. that reflectance
    /// itself.
    #[must_use]
    pub fn fresnel(self, specular: DVec3, u: f64) -> DVec3 {
        match self {
            Self::Han => specular,
            _ => specular + (DVec3::ONE - specular) * (1.0 - u).clamp(0.0, 1.0).powi(5),
        }
    }

    /// Share that is left for the diffuse part.
    #[must_use]
    pub fn diffuse_share(self, fresnel: DVec3) -> DVec3 {
        match self {
            Self::Han => DVec3::ONE,
            _ => DVec3::ONE - fresnel,
        }
    }
}

/// A path from light to eye, in the tangent frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// Unit vector to the light.
    pub wi: DVec3,
    /// Unit vector to the eye.
    pub wo: DVec3,
    /// Half-vector.
    pub wh: DVec3,
    /// `wi · wh`.
    pub u: f64,
}

impl Directions {
    /// The path between two unit vectors; `None` where light or eye is below the surface, and nothing is
    /// reflected.
    #[must_use]
    pub fn new(wi: DVec3, wo: DVec3) -> Option<Self> {
        if wi.z <= 0.0 || wo.z <= 0.0 { None } else { Self::between(wi, wo) }
    }

    /// The path between two unit vectors, even below the base surface: displaced facets may still face them.
    /// `None` only for a light right behind what is seen, which has no half-vector.
    #[must_use]
    pub fn between(wi: DVec3, wo: DVec3) -> Option<Self> {
        let wh = (wi + wo).try_normalize()?;
        Some(Self { wi, wo, wh, u: wi.dot(wh) })
    }

    /// Directions to the light and to the eye in a frame whose z is the unit vector `n`; the light lies over
    /// x.
    #[must_use]
    pub fn about(&self, n: DVec3) -> (DVec3, DVec3) {
        let (i, o) = (n.dot(self.wi), n.dot(self.wo));
        let x = (self.wi - i * n).try_normalize().unwrap_or_else(|| n.any_orthonormal_vector());
        let local = |w: DVec3, cosine: f64| DVec3::new(w.dot(x), w.dot(n.cross(x)), cosine);
        (local(self.wi, i), local(self.wo, o))
    }
}

/// Surface parameters of a place: its material, apart from its normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceParams {
    /// Diffuse albedo, linear RGB.
    pub diffuse: DVec3,
    /// Reflectance at normal incidence, or Han et al.'s `K_s`; linear RGB.
    pub specular: DVec3,
    /// Slope variance that a roughness map adds to the lobe's own here.
    pub roughness: SlopeVariance,
}

/// A lobe in a shading model: everything about a material that does not change over its surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Brdf {
    /// The lobe, where it is sharpest. With Lambert there is only the diffuse part.
    pub lobe: AnyLobe,
    /// Shading model.
    pub shading: ShadingModel,
}

impl Brdf {
    /// A lobe in a shading model.
    #[must_use]
    pub fn new(lobe: impl Into<AnyLobe>, shading: ShadingModel) -> Self {
        Self { lobe: lobe.into(), shading }
    }

    /// Slope variance of the lobe at a place.
    #[must_use]
    pub fn width(&self, roughness: SlopeVariance) -> SlopeVariance {
        self.lobe.slope_variance().unwrap_or(SlopeVariance::ZERO).widen(roughness)
    }

    /// Colour of the highlight at `u = wi·wh`: Fresnel's term, and the lobe's own.
    #[must_use]
    pub fn fresnel(&self, specular: DVec3, u: f64) -> DVec3 {
        self.lobe.tint(u) * self.shading.fresnel(specular, u)
    }

    /// False for a lobe around the light's direction, which is the diffuse part already.
    #[must_use]
    pub fn is_specular(&self) -> bool {
        self.lobe.argument() == Argument::Half
    }

    /// The factor c at a normal, for the lobe at this roughness.
    #[must_use]
    pub fn factor(&self, n: DVec3, directions: &Directions, roughness: SlopeVariance) -> f64 {
        let (i, o) = (n.dot(directions.wi), n.dot(directions.wo));
        match self.shading {
            ShadingModel::Tan => 1.0 / o.max(LEAST_COSINE),
            ShadingModel::Han => i.max(0.0),
            ShadingModel::Smith if i <= 0.0 || o <= 0.0 => 0.0,
            ShadingModel::Smith => {
                let width = self.width(roughness);
                self.lobe.masking(i, width) * self.lobe.masking(o, width) / (4.0 * o)
            }
            ShadingModel::Masked | ShadingModel::Shadowed if o <= 0.0 => 0.0,
            ShadingModel::Masked => 0.25 / self.visible_area(o, roughness),
            ShadingModel::Shadowed if i <= 0.0 => 0.0,
            ShadingModel::Shadowed => {
                let hidden_from_light = self.visible_area(i, roughness) / i - 1.0;
                0.25 / (self.visible_area(o, roughness) + o * hidden_from_light)
            }
        }
    }

    /// Projected area of the microfacets that make up a facet, towards a direction at this cosine to it.
    fn visible_area(&self, cosine: f64, roughness: SlopeVariance) -> f64 {
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        self.lobe.visible_area(cosine, sine * self.width(roughness).get().sqrt())
    }

    /// Light that one normal sends along the path, per unit of irradiance.
    #[must_use]
    pub fn facet(&self, n: DVec3, params: &SurfaceParams, directions: &Directions) -> DVec3 {
        if let Some(channels) = self.channels() {
            let of = |c: usize| channels[c].facet(n, params, directions)[c];
            return DVec3::new(of(0), of(1), of(2));
        }
        let fresnel = self.shading.fresnel(params.specular, directions.u);
        let diffuse =
            self.shading.diffuse_share(fresnel) * params.diffuse * (n.dot(directions.wi).max(0.0) / PI);
        if !self.is_specular() {
            return params.diffuse * (n.dot(directions.wi).max(0.0) / PI);
        }
        let lobe = self.lobe.evaluate_widened(params.roughness, n.dot(directions.wh));
        if lobe == 0.0 {
            return diffuse;
        }
        diffuse
            + self.lobe.tint(directions.u) * fresnel * (lobe * self.factor(n, directions, params.roughness))
    }

    /// [`Self::facet`] without what factoring costs: a measured material reflects as it was measured. Where
    /// roughness widens it, only its lobe knows how.
    #[must_use]
    pub fn true_facet(&self, n: DVec3, params: &SurfaceParams, directions: &Directions) -> DVec3 {
        let itself = |m: &&Measured| m.is_itself() && params.roughness == SlopeVariance::ZERO;
        let Some(measured) = self.lobe.measured().filter(itself) else {
            return self.facet(n, params, directions);
        };
        let fresnel = self.shading.fresnel(params.specular, directions.u);
        let diffuse =
            self.shading.diffuse_share(fresnel) * params.diffuse * (n.dot(directions.wi).max(0.0) / PI);
        let (wi, wo) = directions.about(n);
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return diffuse;
        }
        let highlight = measured.reflectance(wi, wo) - measured.factors().diffuse / PI;
        diffuse + highlight * fresnel * self.factor(n, directions, params.roughness)
    }

    /// The BRDF of each channel, for a lobe whose channels differ by more than a colour.
    #[must_use]
    pub fn channels(&self) -> Option<[Self; 3]> {
        let measured = self.lobe.measured()?;
        Some([0, 1, 2].map(|c| Self { lobe: measured.channel(c).into(), shading: self.shading }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_their_formulas() {
        let n = DVec3::new(0.1, -0.2, 0.9).normalize();
        let directions =
            Directions::new(DVec3::new(0.5, 0.1, 0.8).normalize(), DVec3::new(-0.3, 0.2, 0.7).normalize())
                .unwrap();
        let params = SurfaceParams {
            diffuse: DVec3::splat(0.5),
            specular: DVec3::splat(0.04),
            roughness: SlopeVariance::ZERO,
        };
        let lobe = || "beckmann:0.3".parse::<AnyLobe>().unwrap();
        let d = lobe().evaluate(n.dot(directions.wh));
        let f = 0.04 + 0.96 * (1.0 - directions.u).powi(5);
        let (i, o) = (n.dot(directions.wi), n.dot(directions.wo));
        let of = |shading| Brdf { lobe: lobe(), shading }.facet(n, &params, &directions).x;
        let tan = f * d / o + (1.0 - f) * 0.5 * i / PI;
        let han = (0.04 * d + 0.5 / PI) * i;
        assert!((of(ShadingModel::Tan) - tan).abs() < 1e-14 && (of(ShadingModel::Han) - han).abs() < 1e-14);
        // At alpha 0.3 neither direction is steep enough for Walter's form to leave 1, which is then the
        // exact value to 4e-4.
        let smith = f * d / (4.0 * o) + (1.0 - f) * 0.5 * i / PI;
        assert!((of(ShadingModel::Smith) - smith).abs() < 1e-14);
    }

    #[test]
    fn nothing_is_reflected_below_the_horizon() {
        assert!(Directions::new(DVec3::new(0.8, 0.0, -0.6), DVec3::Z).is_none());
        assert!(Directions::new(DVec3::Z, DVec3::X).is_none());
    }
}
