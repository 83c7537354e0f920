// The filtered n.xy, z rebuilt. Twin of fixed.rs.

const NORMALISED: bool = false;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    let xy = sums.xy;
    return NormalLobe(direction_or_up(vec3<f32>(xy, sqrt(max(1.0 - dot(xy, xy), 0.0)))), 1.0, 0.0);
}
