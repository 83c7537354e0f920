// The standard material of Godot 4: masking by Hammon's mean of two products, Fresnel up to 16.5 times the
// reflectance.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return max(alpha, 0.001);
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    return 0.5 / max(mix(2.0 * incident * seen, incident + seen, alpha), 1e-6);
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return ndf_schlick(f0, saturate(dot(f0, vec3<f32>(16.5))), u);
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}

fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return sqrt(roughness) * (levels - 1.0);
}
