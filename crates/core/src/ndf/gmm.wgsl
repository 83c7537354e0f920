// Isotropic Gaussians in the plane of n.xy: alpha, alpha mu, alpha (2 sigma² + |mu|²) (Tan et al. 2005). Twin
// of gmm.rs.

const NORMALISED: bool = true;

// Share of a texel's weight below which a lobe says nothing.
const DEAD: f32 = 1e-5;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    let alpha = sums.x;
    if !(alpha > DEAD) {
        return NormalLobe(vec3<f32>(0.0), 0.0, 0.0);
    }
    let xy = sums.yz / alpha;
    let second = max(sums.w / alpha - dot(xy, xy), 0.0);
    // Damaged files aside, means lie in the unit disk.
    let held = clamp(xy, vec2<f32>(-1.5), vec2<f32>(1.5));
    return NormalLobe(vec3<f32>(held, 0.0), alpha, select(second / 2.0, second, PRINTED));
}

// Cosine w · n of a normal as far from `w` as the two are in the plane; below the horizon nothing is
// reflected.
fn cosine(w: vec3<f32>, mu: vec3<f32>) -> f32 {
    if w.z <= 0.0 {
        return -1.0;
    }
    let d = w.xy - mu.xy;
    return sqrt(max(1.0 - dot(d, d), 0.0));
}
