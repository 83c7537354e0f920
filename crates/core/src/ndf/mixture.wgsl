// Shading methods whose texels are sums of isotropic lobes. Twin of `reflect` in reflect.rs, for the form
// `Lobes`.
//
// A method brings `decode_lobe` (LAYERS_EACH layers to a lobe, from its first, of weight 0 where it says
// nothing), `response`, `lambert_mean`, and NORMALISED.

alias Decoded = array<NormalLobe, LOBES>;

// The lobes that a texel's channels stand for.
fn decode(channels: ptr<function, Channels>) -> Decoded {
    var lobes: Decoded;
    var total = 0.0;
    for (var j = 0u; j < LOBES; j++) {
        lobes[j] = decode_lobe(channels, j * LAYERS_EACH);
        total += lobes[j].weight;
    }
    if NORMALISED {
        let share = select(0.0, 1.0 / total, total > 0.0);
        for (var j = 0u; j < LOBES; j++) {
            lobes[j].weight *= share;
        }
    }
    return lobes;
}

// The unit direction of a lobe's mean; a planar mean, whose z is 0, is lifted to the sphere.
fn direction(lobe: NormalLobe) -> vec3<f32> {
    let m = lobe.mean;
    let z = select(m.z, sqrt(max(1.0 - m.x * m.x - m.y * m.y, 0.0)), m.z == 0.0);
    return direction_or_up(vec3<f32>(m.xy, z));
}

// Light that a texel sends along the path, per unit of irradiance.
fn reflect_texel(
    channels: ptr<function, Channels>,
    lobes: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    directions: Directions,
) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var j = 0u; j < LOBES; j++) {
        let lobe = (*lobes)[j];
        if lobe.weight == 0.0 {
            continue;
        }
        let params = params_of(channels, j, plain);
        let mu = direction(lobe);
        var specular = 0.0;
        if SPECULAR {
            let f = response(brdf, lobe, params.roughness, directions.wh);
            if f > 0.0 {
                var n = mu;
                if brdf.at_means == 0u {
                    n = responding_normal(lobe, mu, brdf_width(brdf, params.roughness), directions.wh);
                }
                specular = f * factor(brdf, n, directions, params.roughness);
            }
        }
        // The papers take the cosine at the mean.
        let spread = select(lobe.variance, 0.0, brdf.at_means == 1u);
        let diffuse = lambert_evaluate(spread, dot(directions.wi, lambert_mean(lobe, mu)));
        sum += lobe.weight * combine(brdf, params, directions, specular, diffuse);
    }
    return sum;
}
