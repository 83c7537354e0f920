// Shading methods whose texels are one distribution, under an environment: as one lobe. Twin of `reflect` in
// environment.rs, for those.

// Light that a texel sends to the eye.
fn reflect_environment(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    local: LocalEnvironment,
) -> vec3<f32> {
    let mean = mean_normal(decoded);
    let short = clamp(length(mean), 1e-3, 1.0);
    return lobe_light(direction_or_up(mean), (1.0 - short) / short, plain, brdf, local);
}
