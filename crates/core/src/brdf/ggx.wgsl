// GGX (Trowbridge-Reitz): D(u) = alpha² / (pi ((alpha²-1) u² + 1)²). Twin of ggx.rs; `base` is alpha².

// True for a lobe around the half-vector.
const SPECULAR: bool = true;

// The lobe widened by a slope variance, by Beckmann's rule: alpha'² = alpha² + 2 v.
fn lobe_widen(base: f32, by: f32) -> f32 {
    return base + 2.0 * by;
}

// D(u), u the cosine between normal and half-vector.
fn lobe_evaluate(base: f32, u: f32) -> f32 {
    if u <= 0.0 {
        return 0.0;
    }
    // 1 - u² + alpha² u²: the printed (alpha²-1) u² + 1 without its cancellation.
    let u2 = min(u * u, 1.0);
    let d = (1.0 - u2) + base * u2;
    return base / (PI * d * d);
}

// Slope variance on one axis, as Beckmann's.
fn lobe_variance(base: f32) -> f32 {
    return base / 2.0;
}

// Smith's masking at cosine `u > 0`, of a lobe of this kind that is `width` wide (Walter et al. 2007,
// equation 34).
fn lobe_masking(u: f32, width: f32) -> f32 {
    let tan_squared = max((1.0 - u * u) / (u * u), 0.0);
    return 2.0 / (1.0 + sqrt(1.0 + 2.0 * width * tan_squared));
}

// Projected area of the facets that face a direction: equation 34 read as an area.
fn lobe_visible_area(mean: f32, deviation: f32) -> f32 {
    let spread = 2.0 * deviation * deviation;
    let root = sqrt(mean * mean + spread);
    // For a negative mean, in the form whose two terms do not cancel.
    if mean < 0.0 {
        return 0.5 * spread / (root - mean);
    }
    return 0.5 * (mean + root);
}

// Density of facets over slopes, at a slope of this squared length in units of the lobe's deviation: D u⁴
// times its variance.
fn lobe_slope_profile(base: f32, square: f32) -> f32 {
    let root = 1.0 + 0.5 * square;
    return 1.0 / (2.0 * PI * root * root);
}
