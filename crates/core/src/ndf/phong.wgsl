// Phong peaks: weight, direction, exponent (Fournier 1992). Not to be mixed: shaded texel by texel. Twin of
// phong.rs.

const NORMALISED: bool = false;

// Weight below which a peak says nothing.
const DEAD: f32 = 1e-5;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    if !(sums.x > DEAD) {
        return NormalLobe(vec3<f32>(0.0, 0.0, 1.0), 0.0, 0.0);
    }
    let xy = sums.yz / max(length(sums.yz), 1.0);
    let mean = vec3<f32>(xy, sqrt(max(1.0 - dot(xy, xy), 0.0)));
    let variance = select(0.0, 1.0 / max(sums.w, 1e-2), sums.w < SHARPEST * 0.999);
    return NormalLobe(mean, sums.x, variance);
}
