//! Reflection of light that is the same from everywhere, by a lobe: the half of shading that does not depend
//! on the environment.
//!
//! Karis 2013 parts the integral over an environment in two: the mean radiance that a lobe sees, and the
//! share of a white sky that it reflects. Here the second comes from our own shading under lights, for any
//! lobe and model: it is the integral, over all directions of the light, of `reflect` (`ndf/reflect.rs`) for
//! one lobe of normals, factors at the normals that answer included. It is kept in a table over the cosine
//! between the lobe's mean and the eye, and over the spread of its normals.
//!
//! The directions that the light comes from matter too. Half of a wide lobe seen at a grazing angle is below
//! the horizon of the normals that answer, so the rest comes from above the mirror direction, and from a
//! narrower range. The table has both, from the mean of the light's directions, so that the look-up in a
//! blurred cube has the same mean: else a bright window behind a sphere shines through its rim.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use crate::brdf::{Brdf, Directions, Lobe, Microfacets, ShadingModel};
use crate::light::environment::HALF_VECTOR_ORDER;
use crate::sphere::gauss_legendre;
use crate::units::SlopeVariance;

/// Entries of the table on each axis: cosines from 0 to 1, and spreads from 0 to 1, evenly in their root.
pub const ENTRIES: usize = 16;

/// Least cosine that the table is made for.
const LEAST_COSINE: f64 = 1e-3;

/// Light of a white sky that a lobe reflects.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reflected {
    /// Part that the specular colour multiplies, with the lobe's own colour in it.
    pub scale: DVec3,
    /// Part that does not depend on the specular colour.
    pub bias: f64,
    /// The lobe alone, without factor or colour: the weight by which [`Self`]'s light is averaged.
    pub lobe: f64,
    /// The mean of Fresnel's rise over the diffuse part.
    pub rise: f64,
    /// Sine of the angle between the lobe's mean and the mean direction of the light, over that of the mirror
    /// direction.
    pub tilt: f64,
    /// Perceptual roughness of the blur that takes light from as wide a range, over that of the lobe itself.
    pub blur: f64,
}

impl Reflected {
    fn mix(self, other: Self, part: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * part;
        Self {
            scale: self.scale.lerp(other.scale, part),
            bias: mix(self.bias, other.bias),
            lobe: mix(self.lobe, other.lobe),
            rise: mix(self.rise, other.rise),
            tilt: mix(self.tilt, other.tilt),
            blur: mix(self.blur, other.blur),
        }
    }

    /// The direction to look a blurred cube up in, for a lobe of mean `mu`.
    #[must_use]
    pub fn towards(&self, mu: DVec3, wo: DVec3) -> DVec3 {
        // The part of the mirror direction that lies in the lobe's plane.
        let across = (mu * mu.dot(wo) - wo) * self.tilt;
        across + mu * (1.0 - across.length_squared()).max(0.0).sqrt()
    }
}

/// The table of a material's lobe and model.
#[derive(Clone, Debug)]
pub struct SplitSum {
    /// Entries for one spread after the other, each for every cosine.
    entries: Vec<Reflected>,
    /// Zonal coefficients of the lobe, to the order that half-vectors have.
    pub zonal: [f64; HALF_VECTOR_ORDER + 1],
    /// Microfacets that blur the cubes for its highlights.
    pub microfacets: Microfacets,
    /// Facets of the lobe, per unit of map: the integral of its profile over slopes.
    pub facets: f64,
    /// Tables of each channel, for a lobe whose channels differ by more than a colour.
    channels: Option<Box<[SplitSum; 3]>>,
}

impl SplitSum {
    /// Works the table out.
    #[must_use]
    pub fn new(brdf: &Brdf) -> Self {
        let coefficients = brdf.lobe.zonal(HALF_VECTOR_ORDER);
        let entry = |i: usize| {
            let spread = ((i / ENTRIES) as f64 / (ENTRIES - 1) as f64).powi(2);
            let cosine = ((i % ENTRIES) as f64 / (ENTRIES - 1) as f64).max(LEAST_COSINE);
            reflected(brdf, cosine, SlopeVariance::clamped(spread))
        };
        Self {
            entries: (0..ENTRIES * ENTRIES).into_par_iter().map(entry).collect(),
            zonal: std::array::from_fn(|l| coefficients[l]),
            microfacets: brdf.lobe.microfacets(),
            facets: facets(&*brdf.lobe),
            channels: brdf.channels().map(|channels| Box::new(channels.each_ref().map(Self::new))),
        }
    }

    /// The table of one channel, 0 to 2: the same in all for most lobes.
    #[must_use]
    pub fn channel(&self, channel: usize) -> &Self {
        self.channels.as_ref().map_or(self, |channels| &channels[channel])
    }

    /// Light that normals of this spread reflect to an eye at this cosine to their mean.
    #[must_use]
    pub fn lookup(&self, cosine: f64, spread: SlopeVariance) -> Reflected {
        let last = (ENTRIES - 1) as f64;
        let (x, y) = (cosine.clamp(0.0, 1.0) * last, spread.get().clamp(0.0, 1.0).sqrt() * last);
        let (i, j) = ((x as usize).min(ENTRIES - 2), (y as usize).min(ENTRIES - 2));
        let row = |j: usize| {
            let at = j * ENTRIES + i;
            self.entries[at].mix(self.entries[at + 1], x - i as f64)
        };
        row(j).mix(row(j + 1), y - j as f64)
    }

    /// The table as shaders take it, two texels an entry: scale and bias; lobe, rise, tilt and blur. One row
    /// more holds the zonal coefficients from the left, and in its first texel, second, the facets. Channels
    /// that have tables of their own follow each other.
    #[must_use]
    pub fn texels(&self) -> Vec<[f32; 4]> {
        if let Some(channels) = &self.channels {
            return channels.iter().flat_map(Self::texels).collect();
        }
        let of = |e: &Reflected| {
            let [r, g, b] = e.scale.to_array();
            [[r, g, b, e.bias], [e.lobe, e.rise, e.tilt, e.blur]].map(|texel| texel.map(|v| v as f32))
        };
        let mut texels: Vec<[f32; 4]> = self.entries.iter().flat_map(of).collect();
        let zonal =
            |l: usize| [self.zonal.get(l).copied().unwrap_or(0.0) as f32, self.facets as f32, 0.0, 0.0];
        texels.extend((0..2 * ENTRIES).map(zonal));
        texels
    }
}

/// Integral of a lobe's profile over slopes, in its own deviations, out to sixty-four of them.
fn facets(lobe: &dyn Lobe) -> f64 {
    let (mut sum, mut from, mut to) = (0.0, 0.0, 1.0);
    while to <= 64.0 {
        for (node, weight) in gauss_legendre(16) {
            let t = from + (to - from) * (node + 1.0) / 2.0;
            sum += TAU * t * lobe.slope_profile(t * t) * weight * (to - from) / 2.0;
        }
        (from, to) = (to, 2.0 * to);
    }
    sum
}

/// Rings and spokes of half-vectors around the lobe's mean.
const RINGS: usize = 32;
const SPOKES: usize = 32;

fn reflected(brdf: &Brdf, cosine: f64, spread: SlopeVariance) -> Reflected {
    let wo = DVec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let mut sum = Reflected { rise: rise(wo), tilt: 1.0, blur: 1.0, ..Reflected::default() };
    if !brdf.is_specular() {
        return sum;
    }
    let base = brdf.width(SlopeVariance::ZERO);
    // Half-vectors as GGX facets have them: it has weight wherever a lobe of this width has some.
    let alpha_squared = 2.0 * base.widen(spread).get();
    let share = |ring: usize| (ring as f64 + 0.5) / RINGS as f64;
    let (mut towards, mut all) = (DVec3::ZERO, 0.0);
    for ring in 0..RINGS {
        // A warp of the shares to both ends, so that peak and tail have rings of their own: 3t² - 2t³, with
        // its slope.
        let t = share(ring);
        let (warped, slope) = (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t));
        let tan_squared = Microfacets::Ggx.quantile(alpha_squared, warped);
        let z = (1.0 + tan_squared).sqrt().recip();
        let density = Microfacets::Ggx.d_of_tangent(alpha_squared, tan_squared) * z;
        let solid_angle = slope / (density * (RINGS * SPOKES) as f64);
        let r = (1.0 - z * z).max(0.0).sqrt();
        // Both sides of the plane of incidence are alike.
        for spoke in 0..SPOKES {
            let (y, x) = (TAU * (spoke as f64 + 0.5) / SPOKES as f64).sin_cos();
            let wh = DVec3::new(r * x, r * y, z);
            let u = wh.dot(wo);
            if u <= 0.0 {
                continue;
            }
            let directions = Directions { wi: 2.0 * u * wh - wo, wo, wh, u };
            // The light's directions fill 4 u times the solid angle.
            let lobe = brdf.lobe.evaluate_widened(spread, z) * 4.0 * u * solid_angle;
            let n = (DVec3::Z * base.get() + wh * spread.get()).try_normalize().unwrap_or(DVec3::Z);
            let answered = lobe * brdf.factor(n, &directions, SlopeVariance::ZERO);
            let tint = brdf.lobe.tint(u);
            let dark = brdf.shading.fresnel(DVec3::ZERO, u).x;
            sum.lobe += lobe;
            sum.scale += tint * (answered * (brdf.shading.fresnel(DVec3::ONE, u).x - dark));
            sum.bias += answered * dark;
            towards += directions.wi * answered;
            all += answered;
        }
    }
    if all > 0.0 {
        let microfacets = brdf.lobe.microfacets();
        let mean = towards / all;
        sum.tilt = if wo.x > 1e-6 { -mean.x / (mean.length() * wo.x) } else { 1.0 };
        sum.blur =
            microfacets.roughness_of(mean.length()) / Microfacets::roughness(base.widen(spread)).max(1e-6);
    }
    sum
}

/// Mean of Schlick's `(1 - u)^5` over the light of a diffuse facet that faces up.
fn rise(wo: DVec3) -> f64 {
    let mut sum = 0.0;
    for (node, weight) in gauss_legendre(16) {
        let theta = FRAC_PI_2 * (node + 1.0) / 2.0;
        let (sin, cos) = theta.sin_cos();
        for spoke in 0..16 {
            let (y, x) = (TAU * (f64::from(spoke) + 0.5) / 16.0).sin_cos();
            let wi = DVec3::new(sin * x, sin * y, cos);
            let u = ((1.0 + wi.dot(wo)) / 2.0).max(0.0).sqrt();
            sum += (1.0 - u).powi(5) * cos * sin * weight * FRAC_PI_2 / 2.0 * TAU / 16.0;
        }
    }
    sum / PI
}

impl Reflected {
    /// Share that is left for the diffuse part of a material of this specular colour.
    #[must_use]
    pub fn diffuse_share(&self, shading: ShadingModel, specular: DVec3) -> DVec3 {
        match shading {
            ShadingModel::Han => DVec3::ONE,
            _ => DVec3::ONE - specular - (DVec3::ONE - specular) * self.rise,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::brdf::AnyLobe;

    fn table(lobe: &str, shading: ShadingModel) -> SplitSum {
        SplitSum::new(&Brdf { lobe: lobe.parse::<AnyLobe>().unwrap(), shading })
    }

    #[test]
    fn a_smooth_mirror_reflects_all_and_a_rough_one_less() {
        // Without Fresnel (specular 1), microfacets under masking alone send back all that they see, 1,
        // except light from below, which the normal's own hemisphere cuts off: none at alpha 0.05 seen
        // straight on.
        let masked = table("ggx:0.05", ShadingModel::Masked);
        let straight = masked.lookup(1.0, SlopeVariance::ZERO);
        assert!((straight.scale.x + straight.bias - 1.0).abs() < 0.01, "{straight:?}");
        // Walter et al.'s single scattering of GGX at alpha 1, seen straight on: 0.45 (Heitz et al. 2016 show
        // the loss, figure 3, as over half).
        let rough = table("ggx:1", ShadingModel::Smith).lookup(1.0, SlopeVariance::ZERO);
        assert!(rough.scale.x + rough.bias < 0.75, "{rough:?}");
        assert!(rough.scale.x + rough.bias > 0.3, "{rough:?}");
    }

    #[test]
    fn tables_are_the_integral() {
        // Against plain quadrature of shading over the light's directions.
        for (lobe, shading) in [
            ("blinn-phong:20", ShadingModel::Han),
            ("beckmann:0.4", ShadingModel::Smith),
            ("ggx:0.3", ShadingModel::Shadowed),
            ("ggx:0.5", ShadingModel::Tan),
        ] {
            let brdf = Brdf { lobe: lobe.parse::<AnyLobe>().unwrap(), shading };
            let spread = SlopeVariance::clamped((3.0_f64 / 15.0).powi(2));
            let cosine = 12.0 / 15.0;
            let got = SplitSum::new(&brdf).lookup(cosine, spread);
            let wo = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
            let base = brdf.width(SlopeVariance::ZERO);
            let (mut scale, mut bias, mut lobe_sum, mut towards) = (0.0, 0.0, 0.0, DVec3::ZERO);
            for (z, weight) in gauss_legendre(400) {
                for k in 0..400 {
                    let (y, x) = (TAU * f64::from(k) / 400.0).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let Some(directions) = Directions::between(DVec3::new(r * x, r * y, z), wo) else {
                        continue;
                    };
                    let lobe = brdf.lobe.evaluate_widened(spread, directions.wh.z) * weight * TAU / 400.0;
                    let n = (DVec3::Z * base.get() + directions.wh * spread.get()).normalize();
                    let answered = lobe * brdf.factor(n, &directions, SlopeVariance::ZERO);
                    let dark = brdf.shading.fresnel(DVec3::ZERO, directions.u).x;
                    lobe_sum += lobe;
                    scale += answered * (brdf.shading.fresnel(DVec3::ONE, directions.u).x - dark);
                    bias += answered * dark;
                    towards += answered * directions.wi;
                }
            }
            // Thirty-two rings of a smooth function, cut at the horizon of half-vectors.
            assert!((got.lobe / lobe_sum - 1.0).abs() < 0.005, "{lobe}: {} {lobe_sum}", got.lobe);
            assert!((got.scale.x / scale - 1.0).abs() < 0.01, "{lobe}: {} {scale}", got.scale.x);
            assert!((got.bias - bias).abs() < 0.01 * scale, "{lobe}: {} {bias}", got.bias);
            // Direction that the light comes from, by the same rings: a cosine that is 1 % off at 60 degrees
            // is half a degree, and roughness is a root.
            let mean = towards / (scale + bias);
            let angle = got.towards(DVec3::Z, wo).angle_between(mean).to_degrees();
            assert!(angle < 0.5, "{lobe}: {angle} degrees");
            let width = Microfacets::roughness(base.widen(spread));
            let blur = brdf.lobe.microfacets().roughness_of(mean.length()) / width;
            assert!((got.blur / blur - 1.0).abs() < 0.01, "{lobe}: {} {blur}", got.blur);
        }
    }

    #[test]
    fn a_narrow_lobe_sees_the_mirror_direction_and_a_wide_one_seen_flatly_what_is_above() {
        let narrow = table("beckmann:0.02", ShadingModel::Han);
        let wide = table("beckmann:0.6", ShadingModel::Han);
        for cosine in [0.2, 0.6, 1.0] {
            let straight = narrow.lookup(cosine, SlopeVariance::ZERO);
            // Mirrored, half-vectors are twice as wide, and across the plane of incidence as wide as the
            // cosine, so that the mean of both variances is (1 + cos²)/2 of what it is seen straight on: to
            // the fourth root, roughness. A lobe of 0.02 has one per cent more.
            let blur = ((1.0 + cosine * cosine) / 2.0_f64).powf(0.25);
            assert!((straight.tilt - 1.0).abs() < 0.01, "{straight:?}");
            assert!((straight.blur - blur).abs() < 0.01, "{straight:?} {blur}");
        }
        let flat = wide.lookup(0.1, SlopeVariance::ZERO);
        let wo = DVec3::new(0.99_f64.sqrt(), 0.0, 0.1);
        // The mirror direction is at 0.1; all that a normal faces, by its cosine, has its mean at 2/3. So
        // wide a lobe is nearer to that.
        assert!(flat.towards(DVec3::Z, wo).z > 0.4 && flat.blur < 1.0, "{flat:?}");
    }
}
