// Shading methods whose texels are sums of isotropic lobes, under an environment. Twin of `reflect` in
// environment.rs, for those.

// Light that a texel sends to the eye.
fn reflect_environment(
    channels: ptr<function, Channels>,
    lobes: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    local: LocalEnvironment,
) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var j = 0u; j < LOBES; j++) {
        let lobe = (*lobes)[j];
        if lobe.weight != 0.0 {
            sum += lobe.weight * lobe_light(direction(lobe), lobe.variance, params_of(channels, j, plain), brdf, local);
        }
    }
    return sum;
}
