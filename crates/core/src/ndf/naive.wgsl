// The mean normal, renormalised, or SHORT as filtering leaves it. Twin of naive.rs.

const NORMALISED: bool = false;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    if SHORT {
        return NormalLobe(sums.xyz, 1.0, 0.0);
    }
    return NormalLobe(direction_or_up(sums.xyz), 1.0, 0.0);
}

// Response: the BRDF's lobe of the product with the mean, as if that were a normal.
fn response(brdf: Brdf, lobe: NormalLobe, roughness: f32, w: vec3<f32>) -> f32 {
    return lobe_evaluate(lobe_widen(brdf.base, roughness), dot(w, lobe.mean));
}

// Mean that diffuse light takes the product with.
fn lambert_mean(lobe: NormalLobe, mu: vec3<f32>) -> vec3<f32> {
    return select(mu, lobe.mean, SHORT);
}
