// Normalised Blinn-Phong: f(u) = (s+1)/(2 pi) u^s. Twin of blinn_phong.rs; `base` is the exponent s.

// True for a lobe around the half-vector.
const SPECULAR: bool = true;

// The lobe widened by a slope variance: s' = s / (1 + s v).
fn lobe_widen(base: f32, by: f32) -> f32 {
    return max(base / (1.0 + base * by), 1e-3);
}

// Natural logarithm, to a few 1e-8 of itself, or of 1 if that is more. A device's own may be off by 5e-7, and
// an exponent of 50 turns that into 2e-5.
//
// x = 2^e m with m from 1/2 to 1, and ln m = 2 atanh((m-1)/(m+1)), whose series is off by 1e-9 after eight
// terms.
fn logarithm(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let e = f32(i32(bits >> 23u) - 126);
    let m = bitcast<f32>((bits & 0x7fffffu) | 0x3f000000u);
    let z = (m - 1.0) / (m + 1.0);
    let z2 = z * z;
    let series = 1.0 + z2 * (1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0 + z2 * (1.0 / 11.0
        + z2 * (1.0 / 13.0 + z2 / 15.0))))));
    return 2.0 * z * series + e * 0.69314718;
}

// f(u), u the cosine between normal and half-vector.
fn lobe_evaluate(base: f32, u: f32) -> f32 {
    // Below this the power is nothing for any exponent but the least, and numbers this small have no binary
    // exponent to take apart.
    if u <= 1e-30 {
        return 0.0;
    }
    return (base + 1.0) / (2.0 * PI) * exp(base * logarithm(u));
}

// Slope variance on one axis.
fn lobe_variance(base: f32) -> f32 {
    return 1.0 / base;
}
