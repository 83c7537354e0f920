// The standard material of Bevy 0.19: Fresnel up to 16.5 times the reflectance, light passed on between
// facets.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return max(alpha, 0.007921);
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    return ndf_smith(alpha, incident, seen);
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return ndf_schlick(f0, saturate(dot(f0, vec3<f32>(16.5))), u);
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return ndf_passed_on(f0, alpha, seen);
}

fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return roughness * (levels - 1.0);
}
