// Von Mises-Fisher lobes: alpha, alpha r (Han et al. 2007, section 6). Twin of vmf.rs.

const NORMALISED: bool = true;

// Share of a texel's weight below which a lobe says nothing.
const DEAD: f32 = 1e-5;

// Shortest |r| that has a direction.
const MIN_LENGTH: f32 = 1e-3;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    let alpha = sums.x;
    if !(alpha > DEAD) {
        return NormalLobe(vec3<f32>(0.0, 0.0, 1.0), 0.0, 0.0);
    }
    // About the pole, w = 1 - r.z, or as the paper has it.
    let w = select(sums.w, alpha - sums.w, ORIGIN) / alpha;
    let xy = sums.yz / alpha;
    // 1 - |r|² of r = (x, y, 1 - w).
    let short = clamp(w * (2.0 - w) - dot(xy, xy), 0.0, 1.0);
    let r = max(sqrt(1.0 - short), MIN_LENGTH);
    return NormalLobe(direction_or_up(vec3<f32>(xy, 1.0 - w)), alpha, short / (r * (3.0 - r * r)));
}
