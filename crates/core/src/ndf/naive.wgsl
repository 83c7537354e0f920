// The mean normal, renormalised. Twin of naive.rs.

const NORMALISED: bool = false;

fn decode_lobe(sums: vec4<f32>) -> NormalLobe {
    return NormalLobe(direction_or_up(sums.xyz), 1.0, 0.0);
}
