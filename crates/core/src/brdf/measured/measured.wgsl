// A measured lobe: a sum of kernels, and a colour. Twin of measured/mod.rs, which writes the numbers in; `base` is what it is widened by.

// True for a lobe around the half-vector.
const SPECULAR: bool = true;

// The lobe widened by a slope variance.
fn brdf_widen(base: f32, by: f32) -> f32 {
    return base + by;
}

// A von Mises-Fisher kernel of this variance, 1/kappa, at the cosine `u`.
fn kernel(variance: f32, u: f32) -> f32 {
    let kappa = 1.0 / variance;
    return kappa / (2.0 * PI * (1.0 - exp(-2.0 * kappa))) * exp(kappa * (min(u, 1.0) - 1.0));
}

// Slope variance on one axis: that of a Gaussian of the same height and light.
fn brdf_variance(base: f32) -> f32 {
    return OWN_VARIANCE + base;
}

// Smith's masking at cosine `u > 0`, of a lobe of this kind that is `width` wide.
fn brdf_masking(u: f32, width: f32) -> f32 {
    return beckmann_masking(u, width);
}

// Projected area of the facets that face a direction; Beckmann's.
fn brdf_visible_area(mean: f32, deviation: f32) -> f32 {
    return mean_of_positive_part(mean, deviation * deviation);
}

// Density of facets over slopes, at a slope of this squared length in units of the lobe's deviation: D u⁴ times its variance.
fn brdf_slope_profile(base: f32, square: f32) -> f32 {
    let u2 = 1.0 / (1.0 + brdf_variance(base) * square);
    return brdf_evaluate(base, sqrt(u2)) * u2 * u2 * brdf_variance(base);
}
