// The material PBR of Babylon.js 9, as it is without its options: light passed on between facets.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return alpha + 0.0005;
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    return ndf_smith(alpha, incident, seen);
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return ndf_schlick(f0, 1.0, u);
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return ndf_passed_on(f0, alpha, seen);
}

// `levels` of a cube whose faces are two to the power of one less wide.
fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return clamp(0.8 * log2(max(roughness * roughness * exp2(levels - 1.0), 1.0)), 0.0, levels - 1.0);
}
