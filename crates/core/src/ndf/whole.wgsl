// Shading methods whose texels are one distribution. Twin of `reflect` in reflect.rs, for those without `isotropic`.
//
// A method brings `Decoded`, `decode`, `mean_normal`, `effective` (around the half-vector) and `effective_diffuse`.

// Light that a texel sends along the way, per unit of irradiance.
fn reflect_texel(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: Finish,
    reflection: Reflection,
    way: Way,
) -> vec3<f32> {
    var specular = 0.0;
    if SPECULAR {
        let mean = mean_normal(decoded);
        let short = clamp(length(mean), 1e-3, 1.0);
        let mu = direction_or_up(mean);
        let all = Shaded(mu, 1.0, (1.0 - short) / short);
        var n = mu;
        if reflection.at_means == 0u {
            n = answering(all, mu, lobe_width(reflection, plain.gloss), way.wh);
        }
        let lobe = effective(decoded, reflection, plain.gloss, way.wh);
        specular = lobe * factor(reflection, n, way, plain.gloss);
    }
    return together(reflection, plain, way, specular, effective_diffuse(decoded, reflection, way.wi));
}
