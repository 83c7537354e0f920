// The default lit material of Unreal: Smith's masking without its roots, Fresnel up to 50 times the
// reflectance.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return max(alpha, 0.0004);
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    let masked = incident * (seen * (1.0 - alpha) + alpha);
    let shadowed = seen * (incident * (1.0 - alpha) + alpha);
    return 0.5 / max(masked + shadowed, 1e-6);
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return ndf_schlick(f0, saturate(50.0 * f0.y), u);
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}

// The roughest level is the last but one; each finer one is 2 to the power of 5/6 less rough.
fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return clamp(levels - 2.0 + 1.2 * log2(max(roughness, 0.001)), 0.0, levels - 1.0);
}
