// A measured lobe: in each channel a sum of kernels, and a colour. Twin of measured/mod.rs, which writes the
// numbers in; `base` is the slope variance that widens it.

// Channels that differ by more than a colour: each is shaded by itself.
const CHANNELS: u32 = 3u;

// The channel that is being shaded.
var<private> channel: u32;

fn turn_to_channel(next: u32) {
    channel = next;
}

fn shaded_channel() -> u32 {
    return channel;
}

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
    return own_variance() + base;
}

// f(u), u the cosine between normal and half-vector, widened by `base`.
fn lobe_evaluate(base: f32, u: f32) -> f32 {
    if u <= 0.0 {
        return 0.0;
    }
    return kernels(base, u);
}

// g, of u = wi·wh: the same number in every channel.
fn lobe_tint(u: f32) -> vec3<f32> {
    let held = clamp(u, LEAST_DIFFERENCE, 1.0);
    return vec3<f32>(tint_polynomial(1.0 - held) / (held * held));
}
