// Colour of a lobe without one of its own. Twin of `tint` in lobe.rs.

// White, whatever u = wi·wh.
fn lobe_tint(u: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}
