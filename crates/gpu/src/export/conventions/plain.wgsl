// Smith's masking, Schlick's Fresnel up to 1, light reflected once: what papers call Cook-Torrance.

// Width of the GGX that a material is drawn with.
fn ndf_width(alpha: f32) -> f32 {
    return max(alpha, 0.001);
}

fn ndf_visibility(alpha: f32, incident: f32, seen: f32, u: f32) -> f32 {
    return ndf_smith(alpha, incident, seen);
}

fn ndf_tint(f0: vec3<f32>, u: f32) -> vec3<f32> {
    return ndf_schlick(f0, 1.0, u);
}

fn ndf_compensation(f0: vec3<f32>, alpha: f32, seen: f32) -> vec3<f32> {
    return vec3<f32>(1.0);
}

fn ndf_room_level(roughness: f32, levels: f32) -> f32 {
    return roughness * (levels - 1.0);
}
