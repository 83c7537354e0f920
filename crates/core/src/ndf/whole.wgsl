// Shading methods whose texels are one distribution. Twin of `reflect` in reflect.rs, for the forms `Whole`
// and `Slopes`.
//
// A method brings `Decoded`, `decode`, `mean_normal`, `effective` (around the half-vector) and
// `effective_diffuse`.

// Light that a texel sends along the path, per unit of irradiance.
fn reflect_texel(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    directions: Directions,
) -> vec3<f32> {
    var specular = 0.0;
    if SPECULAR {
        let mean = mean_normal(decoded);
        let short = clamp(length(mean), 1e-3, 1.0);
        let mu = direction_or_up(mean);
        let all = NormalLobe(mu, 1.0, (1.0 - short) / short);
        var n = mu;
        if brdf.at_means == 0u {
            n = responding_normal(all, mu, brdf_width(brdf, plain.roughness), directions.wh);
        }
        let lobe = effective(decoded, brdf, plain.roughness, directions.wh);
        specular = lobe * factor(brdf, n, directions, plain.roughness);
    }
    return combine(brdf, plain, directions, specular, effective_diffuse(decoded, brdf, directions.wi));
}
