// The lit material of Unity's universal pipeline: masking and Fresnel in one fraction of the light's angle.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return max(alpha, 0.0078125);
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    return 0.25 / (max(u * u, 0.1) * (alpha + 0.5));
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return f0;
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}

// Seven levels, of which the roughest is the seventh.
fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return roughness * (1.7 - 0.7 * roughness) * (levels - 1.0);
}
