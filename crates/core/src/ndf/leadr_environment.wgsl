// A Gaussian of slopes under an environment: LEADR's grid. Twin of `of_slopes` in environment.rs.

// Weight of a slope, for facets that are distributed as those of a lobe are; Gaussian ones weigh as the grid says.
fn slope_profile_weight(base: f32, weight: f32, square: f32) -> f32 {
    if GAUSSIAN_FACETS {
        return weight;
    }
    return weight * brdf_slope_profile(base, square) * exp(0.5 * square);
}

// The level at which a facet that mirrors is looked up (Dupuy et al. 2013, section 3.5).
fn mirror_level(g: Decoded, step: f32, z: f32, u: f32) -> f32 {
    let jacobian = max(4.0 * u * z * z * z, 1e-30);
    let deviation = max(sqrt(max(g.covariance.x, g.covariance.y)), 1e-15);
    return 0.72 * log(jacobian) + GRID_LEVEL + log2(step * deviation * environment.size.x);
}

// What a facet shows, of normal `n` that faces the eye.
fn mirrored(g: Decoded, n: vec3<f32>, step: f32, plain: Finish, reflection: Reflection, around: Around) -> vec3<f32> {
    let u = dot(n, around.wo);
    let wi = 2.0 * u * n - around.wo;
    let radiance = environment_radiance(around.turn * wi, mirror_level(g, step, n.z, u));
    return radiance * brdf_tint(u) * fresnel(reflection.model, plain.specular, u);
}

// Facets of a displaced surface: by what the eye sees of each, over what it sees in all.
fn mirrors_of_relief(g: Decoded, plain: Finish, reflection: Reflection, around: Around) -> vec3<f32> {
    let wo = around.wo;
    var seen = 0.0;
    var total = 0.0;
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let weight = slope_profile_weight(reflection.base, point.z, dot(point.xy, point.xy));
        total += weight;
        seen += weight * max(dot(leaning(g, point.xy), wo), 0.0);
    }
    let artificial = artificial_normal(g, wo);
    seen += ARTIFICIAL_WEIGHT * artificial.w;
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i <= GRID * GRID; i++) {
        var n = artificial.xyz;
        var weight = ARTIFICIAL_WEIGHT * artificial.w;
        var step = GRID_STEP;
        if i < GRID * GRID {
            let point = slope_point(i);
            let v = leaning(g, point.xy);
            weight = slope_profile_weight(reflection.base, point.z, dot(point.xy, point.xy)) * max(dot(v, wo), 0.0);
            n = v * inverseSqrt(dot(v, v));
            step = point.w;
        }
        if weight <= 0.0 || dot(n, wo) <= 0.0 {
            continue;
        }
        var hidden = 0.0;
        if reflection.model == SHADOWED {
            let wi = 2.0 * dot(n, wo) * n - wo;
            let area = projected_area(g, wi);
            if area <= 0.0 {
                continue;
            }
            hidden = max(projected_area(g, wo), 0.0) * lambda(g, wi, area) * total;
        }
        sum += mirrored(g, n, step, plain, reflection, around) * (weight / (seen + hidden));
    }
    return sum;
}

// Facets of a normal map; `narrow` is the Gaussian without the lobe's own width.
fn mirrors_of_map(g: Decoded, narrow: Decoded, plain: Finish, reflection: Reflection, around: Around) -> vec3<f32> {
    let wo = around.wo;
    let base = lobe_width(reflection, plain.gloss);
    let mean = normalize(vec3<f32>(-g.mean, 1.0));
    let short = clamp(1.0 / (1.0 + 0.5 * (narrow.covariance.x + narrow.covariance.y)), 1e-3, 1.0);
    let whole = Shaded(mean, 1.0, (1.0 - short) / short);
    var total = 0.0;
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let square = dot(point.xy, point.xy);
        let weight = slope_profile_weight(reflection.base, point.z, square);
        total += weight;
        let n = normalize(leaning(g, point.xy));
        let u = dot(n, wo);
        if u <= 0.0 {
            continue;
        }
        let way = Way(2.0 * u * n - wo, wo, n, u);
        let answers = answering(whole, mean, base, n);
        let share = weight * sqrt(1.0 + base * square) * 4.0 * u * factor(reflection, answers, way, plain.gloss);
        sum += share * mirrored(g, n, point.w, plain, reflection, around);
    }
    return sum * (split_sum_texel(0u, SPLIT_SUM_ENTRIES).y / total);
}

// Light that a texel sends to the eye.
fn reflect_surround(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: Finish,
    reflection: Reflection,
    around: Around,
) -> vec3<f32> {
    var g = *decoded;
    if around.relief {
        g = stretched_by(g, around.stretch);
    }
    var lit = vec3<f32>(0.0);
    var seen = 0.0;
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let v = leaning(g, point.xy);
        let weight = point.z * select(1.0, max(dot(v, around.wo), 0.0), around.relief);
        seen += weight;
        lit += weight * environment_irradiance(around.turn * (v * inverseSqrt(dot(v, v))), 0.0, false);
    }
    if around.relief {
        let artificial = artificial_normal(g, around.wo);
        let weight = ARTIFICIAL_WEIGHT * artificial.w;
        seen += weight;
        lit += weight * environment_irradiance(around.turn * artificial.xyz, 0.0, false);
    }
    let diffuse = plain.diffuse / PI * lit / seen;
    if !SPECULAR {
        return diffuse;
    }
    let mean = normalize(vec3<f32>(-g.mean, 1.0));
    let rise = split_sum(dot(mean, around.wo), 0.0).rise;
    let share = reflected_diffuse_share(reflection.model, rise, plain.specular);
    let width = lobe_width(reflection, plain.gloss);
    let wide = Decoded(g.mean, g.covariance + vec3<f32>(width, width, 0.0));
    if around.relief {
        return share * diffuse + mirrors_of_relief(wide, plain, reflection, around);
    }
    return share * diffuse + mirrors_of_map(wide, g, plain, reflection, around);
}
