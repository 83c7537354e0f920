// A single isotropic lobe from the length of the mean normal. Twin of toksvig.rs.

const NORMALISED: bool = false;

// Shortest mean normal that still widens.
const MIN_LENGTH: f32 = 1e-3;

fn decode_lobe(channels: ptr<function, Channels>, layer: u32) -> NormalLobe {
    let sums = (*channels)[layer];
    let short = clamp(length(sums.xyz), MIN_LENGTH, 1.0);
    return NormalLobe(direction_or_up(sums.xyz), 1.0, (1.0 - short) / short);
}
