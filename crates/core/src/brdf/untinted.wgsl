// The colour of a lobe that has none of its own. Twin of `tint` in mod.rs.

// White, whatever u = wi·wh.
fn lobe_tint(u: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}
