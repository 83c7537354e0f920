// Beckmann: D(u) = exp(-tan²/alpha²) / (pi alpha² u⁴). Twin of beckmann.rs; `base` is alpha².

// True for a lobe around the half-vector.
const SPECULAR: bool = true;

// The lobe widened by a slope variance: alpha'² = alpha² + 2 v.
fn lobe_widen(base: f32, by: f32) -> f32 {
    return base + 2.0 * by;
}

// D(u), u the cosine between normal and half-vector.
fn lobe_evaluate(base: f32, u: f32) -> f32 {
    // Below, the exponential has underflowed for alpha up to 1, and u⁴ is about to underflow for any alpha.
    if u <= 1e-6 {
        return 0.0;
    }
    let u2 = min(u * u, 1.0);
    return exp(-(1.0 - u2) / (u2 * base)) / (PI * base * u2 * u2);
}

// Slope variance on one axis.
fn lobe_variance(base: f32) -> f32 {
    return base / 2.0;
}

// Density of facets over slopes, at a slope of this squared length in units of the lobe's deviation: D u⁴
// times its variance.
fn lobe_slope_profile(base: f32, square: f32) -> f32 {
    return exp(-0.5 * square) / (2.0 * PI);
}
