// The physical material of three.js, r187: Fresnel by a Gaussian in place of a power, light passed on between
// facets.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return max(alpha, 0.002025);
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    return ndf_smith(alpha, incident, seen);
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return mix(f0, vec3<f32>(1.0), exp2((-5.55473 * u - 6.98316) * u));
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return ndf_passed_on(f0, alpha, seen);
}

fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return roughness * (2.0 - roughness) * (levels - 1.0);
}
