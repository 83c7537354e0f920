//! A material as real-time engines shade it: glTF's, under a directional light.
//!
//! GGX with Smith's height-correlated visibility and Schlick's Fresnel term, and a Lambert part for what is
//! no metal (Khronos, glTF 2.0, appendix B; three.js's `BRDF_GGX`). Cosines are clamped at zero, where our
//! own models cut off, so a normal that turns from the eye still shines, as it does there.

use std::f64::consts::PI;

use glam::DVec3;

use crate::brdf::Directions;

/// Least perceptual roughness that three.js shades with.
pub const LEAST_ROUGHNESS: f64 = 0.0525;

/// Material of one colour, grey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EngineMaterial {
    /// Reflectance at normal incidence.
    pub specular: f64,
    /// Diffuse albedo; 0 for metals.
    pub diffuse: f64,
}

impl EngineMaterial {
    /// A white metal: its highlights are all that is seen.
    pub const METAL: Self = Self { specular: 1.0, diffuse: 0.0 };

    /// A dielectric of index 1.5 and a middle grey.
    pub const DIELECTRIC: Self = Self { specular: 0.04, diffuse: 0.2 };

    /// Light sent to the eye by a unit normal, for a light of irradiance 1 on a plane that faces it.
    #[must_use]
    pub fn shade(&self, normal: DVec3, roughness: f64, path: &Directions) -> f64 {
        let light = normal.dot(path.wi).clamp(0.0, 1.0);
        if light == 0.0 {
            return 0.0;
        }
        let eye = normal.dot(path.wo).clamp(0.0, 1.0);
        let half = normal.dot(path.wh).clamp(0.0, 1.0);
        let alpha = roughness.max(LEAST_ROUGHNESS).powi(2);
        let alpha_squared = alpha * alpha;
        let smith = |a: f64, b: f64| a * (alpha_squared + (1.0 - alpha_squared) * b * b).sqrt();
        let visibility = 0.5 / (smith(light, eye) + smith(eye, light)).max(1e-6);
        let denominator = half * half * (alpha_squared - 1.0) + 1.0;
        let density = alpha_squared / (PI * denominator * denominator);
        let fresnel = self.specular + (1.0 - self.specular) * (1.0 - path.u).clamp(0.0, 1.0).powi(5);
        light * (fresnel * visibility * density + (1.0 - fresnel) * self.diffuse / PI)
    }
}
