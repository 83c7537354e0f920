// The mean normal, renormalised. Twin of naive.rs.

const NORMALISED: bool = false;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    return NormalLobe(direction_or_up(sums.xyz), 1.0, 0.0);
}
