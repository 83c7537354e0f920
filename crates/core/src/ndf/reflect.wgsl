// Shading a filtered texel: the parts that all methods share. Twin of reflect.rs.

// A texel's channels: the method's LAYERS, then, for LOBES that carry them, ATTRIBUTES times as many of
// colours.
alias Channels = array<vec4<f32>, ALL_LAYERS>;

// A lobe ready to be shaded: the BRDF widened by `variance`, around `mean`.
struct NormalLobe {
    // Mean direction; for planar lobes (x, y, 0).
    mean: vec3<f32>,
    // Share of the texel.
    weight: f32,
    // Spread on one axis, a slope variance.
    variance: f32,
}

// The direction of `v`; (0,0,1) when it has none.
fn direction_or_up(v: vec3<f32>) -> vec3<f32> {
    let square = dot(v, v);
    return select(vec3<f32>(0.0, 0.0, 1.0), v * inverseSqrt(max(square, 1e-30)), square > 1e-30);
}

// Mean direction of a lobe's normals that send light along the half-vector: those of the product of two
// Gaussians.
fn responding_normal(lobe: NormalLobe, mu: vec3<f32>, base: f32, wh: vec3<f32>) -> vec3<f32> {
    let v = mu * base + wh * lobe.variance;
    let square = dot(v, v);
    return select(mu, v * inverseSqrt(max(square, 1e-30)), square > 1e-30);
}

// Puts colours on the specular and the diffuse part.
fn combine(brdf: Brdf, params: SurfaceParams, directions: Directions, specular: f32, diffuse: f32) -> vec3<f32> {
    let lambert = params.diffuse * (max(diffuse, 0.0) / PI);
    if !SPECULAR {
        return lambert;
    }
    let f = fresnel(brdf.shading, params.specular, directions.u);
    return lobe_tint(directions.u) * f * max(specular, 0.0) + diffuse_share(brdf.shading, f) * lambert;
}

// Light that a texel sends along the path, per unit of irradiance: `reflect_texel`, for a lobe whose channels
// differ by more than a colour once a channel.
fn reflect_channels(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    directions: Directions,
) -> vec3<f32> {
    var light = reflect_texel(channels, decoded, plain, brdf, directions);
    for (var c = 1u; c < CHANNELS; c++) {
        turn_to_channel(c);
        light[c] = reflect_texel(channels, decoded, plain, brdf, directions)[c];
    }
    turn_to_channel(0u);
    return light;
}

// Surface parameters of a lobe: those it carries, or `plain` where lobes carry none.
fn params_of(channels: ptr<function, Channels>, lobe: u32, plain: SurfaceParams) -> SurfaceParams {
    var params = plain;
    if ATTRIBUTES > 0u {
        // A lobe's attributes are stored times its weight.
        let share = 1.0 / max((*channels)[lobe * LAYERS_EACH].x, 1e-30);
        let first = (*channels)[min(LAYERS + lobe, ALL_LAYERS - 1u)] * share;
        params.diffuse = first.xyz;
        params.roughness = max(first.w, 0.0);
        if ATTRIBUTES > 1u {
            params.specular = (*channels)[min(LAYERS + LOBES + lobe, ALL_LAYERS - 1u)].xyz * share;
        }
    }
    return params;
}
