// Torrance-Sparrow as Han et al. use it: f = exp(-beta²/(4 sigma²)) / (4 pi sigma²), beta the angle to the
// half-vector. Twin of torrance_sparrow.rs; `base` is sigma².

// True for a lobe around the half-vector.
const SPECULAR: bool = true;

// The lobe widened by a slope variance: sigma'² = sigma² + v/2.
fn lobe_widen(base: f32, by: f32) -> f32 {
    return base + by / 2.0;
}

// The square of the angle whose cosine is `u`, 0 <= u <= 1. The language's own `acos` promises few digits,
// and none near 1.
//
// From a quarter of the angle, b, sin²b = t: b² = asin²(sqrt t) = 1/2 sum (4t)^n / (n² binomial(2n, n)), t <
// 0.15, where eight terms leave an error of 1e-8.
fn squared_angle(u: f32) -> f32 {
    let half = (1.0 - u) / 2.0;
    let t = half / (2.0 * (1.0 + sqrt(1.0 - half)));
    let series = 1.0 + t * (1.0 / 3.0 + t * (8.0 / 45.0 + t * (4.0 / 35.0 + t * (128.0 / 1575.0
        + t * (128.0 / 2079.0 + t * (1024.0 / 21021.0 + t * (256.0 / 6435.0)))))));
    return 16.0 * t * series;
}

// f(u), u the cosine between normal and half-vector.
fn lobe_evaluate(base: f32, u: f32) -> f32 {
    if u <= 0.0 {
        return 0.0;
    }
    return exp(-squared_angle(min(u, 1.0)) / (4.0 * base)) / (4.0 * PI * base);
}

// Slope variance on one axis.
fn lobe_variance(base: f32) -> f32 {
    return 2.0 * base;
}
