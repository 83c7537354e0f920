// Colour of a lobe without one of its own. Twin of `tint` in lobe.rs.

// All channels are shaded at once.
const CHANNELS: u32 = 1u;

fn turn_to_channel(next: u32) {}

fn shaded_channel() -> u32 {
    return 0u;
}

// White, whatever u = wi·wh.
fn lobe_tint(u: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}
