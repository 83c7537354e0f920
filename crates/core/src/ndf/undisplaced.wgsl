// For methods that know nothing of displacement: a displaced surface is shaded as one that is not.

fn reflect_displaced(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    directions: Directions,
    by: mat2x2<f32>,
) -> vec3<f32> {
    return reflect_texel(channels, decoded, plain, brdf, directions);
}
