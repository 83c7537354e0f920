// A measured lobe: a sum of kernels, and a colour. Twin of measured/mod.rs, which writes the numbers in;
// `base` is the slope variance that widens it.

// True for a lobe around the half-vector.
const SPECULAR: bool = true;

// The lobe widened by a slope variance.
fn lobe_widen(base: f32, by: f32) -> f32 {
    return base + by;
}

// A von Mises-Fisher kernel of this variance, 1/kappa, at the cosine `u`.
fn kernel(variance: f32, u: f32) -> f32 {
    let kappa = 1.0 / variance;
    return kappa / (2.0 * PI * (1.0 - exp(-2.0 * kappa))) * exp(kappa * (min(u, 1.0) - 1.0));
}

// Slope variance on one axis: that of a Gaussian of the same height and light.
fn lobe_variance(base: f32) -> f32 {
    return OWN_VARIANCE + base;
}
