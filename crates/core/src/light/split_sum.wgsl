// Reflection of light that is the same from everywhere, by a lobe. Twin of split_sum.rs.

// Entries of the table on each axis. The row below them has the lobe's zonal coefficients, and in its first
// texel the lobe's facets.
const SPLIT_SUM_ENTRIES: u32 = 16u;

struct Reflected {
    // Part that the specular colour multiplies.
    scale: vec3<f32>,
    // Part that does not depend on the specular colour.
    bias: f32,
    // The lobe alone.
    lobe: f32,
    // The mean of Fresnel's rise over the diffuse part.
    rise: f32,
    // Sine of the angle between the lobe's mean and the mean direction of the light, over that of the mirror
    // direction.
    tilt: f32,
    // Perceptual roughness of the blur that takes light from as wide a range, over that of the lobe itself.
    blur: f32,
}

// Light that normals of this spread reflect to an eye at this cosine to their mean.
fn split_sum(cosine: f32, spread: f32) -> Reflected {
    let last = f32(SPLIT_SUM_ENTRIES - 1u);
    let x = clamp(cosine, 0.0, 1.0) * last;
    let y = sqrt(clamp(spread, 0.0, 1.0)) * last;
    let i = min(u32(x), SPLIT_SUM_ENTRIES - 2u);
    let j = min(u32(y), SPLIT_SUM_ENTRIES - 2u);
    let part = vec2<f32>(x - f32(i), y - f32(j));
    let a = mix(mix(split_sum_texel(2u * i, j), split_sum_texel(2u * i + 2u, j), part.x),
        mix(split_sum_texel(2u * i, j + 1u), split_sum_texel(2u * i + 2u, j + 1u), part.x), part.y);
    let b = mix(mix(split_sum_texel(2u * i + 1u, j), split_sum_texel(2u * i + 3u, j), part.x),
        mix(split_sum_texel(2u * i + 1u, j + 1u), split_sum_texel(2u * i + 3u, j + 1u), part.x), part.y);
    return Reflected(a.xyz, a.w, b.x, b.y, b.z, b.w);
}

// The direction to look a blurred cube up in, for a lobe of mean `mu`.
fn reflected_towards(reflected: Reflected, mu: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    // The part of the mirror direction that lies in the lobe's plane.
    let across = (mu * dot(mu, wo) - wo) * reflected.tilt;
    return across + mu * sqrt(max(1.0 - dot(across, across), 0.0));
}

// Share that is left for the diffuse part of a material of this specular colour.
fn reflected_diffuse_share(shading: u32, rise: f32, specular: vec3<f32>) -> vec3<f32> {
    return select(1.0 - specular - (1.0 - specular) * rise, vec3<f32>(1.0), shading == HAN);
}
