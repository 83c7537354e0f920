// Lambert, perhaps widened by a lobe of normals. Twin of lambert.rs. Every shader has it, for the diffuse
// part.

// Complementary error function, to 1.2e-7 of itself: the Chebyshev fit of Press et al., "Numerical Recipes in
// C" (1992), 6.2.
fn erfc(x: f32) -> f32 {
    let z = abs(x);
    let t = 1.0 / (1.0 + 0.5 * z);
    let p = -1.26551223 + t * (1.00002368 + t * (0.37409196 + t * (0.09678418 + t * (-0.18628806
        + t * (0.27886807 + t * (-1.13520398 + t * (1.48851587 + t * (-0.82215223 + t * 0.17087277))))))));
    let tail = t * exp(p - z * z);
    return select(tail, 2.0 - tail, x < 0.0);
}

// Mean of max(X, 0) for Gaussian X of this mean and variance.
fn mean_of_positive_part(mean: f32, variance: f32) -> f32 {
    if variance <= 0.0 {
        return max(mean, 0.0);
    }
    let s = sqrt(variance);
    let t = mean / s;
    let density = exp(-0.5 * t * t) / sqrt(2.0 * PI);
    return mean * 0.5 * erfc(-t / sqrt(2.0)) + s * density;
}

// A_1 = coth kappa - 1/kappa: where the two are near each other, by its series, to 2e-9 at one half. (By
// `exp`: a device may be 1e-5 off with `tanh`.)
fn mean_cosine(kappa: f32) -> f32 {
    let k2 = kappa * kappa;
    if kappa < 0.5 {
        return kappa * (1.0 / 3.0 - k2 * (1.0 / 45.0 - k2 * (2.0 / 945.0 - k2 * (1.0 / 4725.0 - k2 * 2.0 / 93555.0))));
    }
    let e = exp(-2.0 * kappa);
    return (1.0 + e) / (1.0 - e) - 1.0 / kappa;
}

// Lambert's cosine u, averaged over a vMF lobe of normals of variance `v` around the normal that u belongs
// to.
fn lambert_evaluate(v: f32, u: f32) -> f32 {
    if v == 0.0 {
        return max(u, 0.0);
    }
    // kappa = 1/v: A_1 = coth kappa - v; E[(w·n)²] = (1 - 3 A_1 v) u² + A_1 v.
    let a1 = mean_cosine(1.0 / v);
    let mean = a1 * u;
    let second = (1.0 - 3.0 * a1 * v) * u * u + a1 * v;
    return mean_of_positive_part(mean, second - mean * mean);
}
