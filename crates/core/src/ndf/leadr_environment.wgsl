// A Gaussian of slopes under an environment: LEADR's grid. Twin of `of_slopes` in environment.rs.

// Weight of a slope, for facets distributed as a lobe's: Gaussian ones weigh as the grid says.
fn slope_profile_weight(base: f32, weight: f32, square: f32) -> f32 {
    if GAUSSIAN_FACETS {
        return weight;
    }
    return weight * lobe_slope_profile(base, square) * exp(0.5 * square);
}

// The level at which a facet that mirrors is looked up (Dupuy et al. 2013, section 3.5).
fn mirror_level(g: Decoded, step: f32, z: f32, u: f32) -> f32 {
    let jacobian = max(4.0 * u * z * z * z, 1e-30);
    let deviation = max(sqrt(max(g.covariance.x, g.covariance.y)), 1e-15);
    return 0.72 * log(jacobian) + GRID_LEVEL + log2(step * deviation * environment.size.x);
}

// Light that a facet shows, whose normal `n` faces the eye.
fn mirrored(g: Decoded, n: vec3<f32>, step: f32, plain: SurfaceParams, brdf: Brdf, local: LocalEnvironment) -> vec3<f32> {
    let u = dot(n, local.wo);
    let wi = 2.0 * u * n - local.wo;
    let radiance = environment_radiance(local.rotation * wi, mirror_level(g, step, n.z, u));
    return radiance * lobe_tint(u) * fresnel(brdf.shading, plain.specular, u);
}

// Light of a displaced surface: each facet weighs by what the eye sees of it, over what it sees in all.
fn mirrors_of_displaced(g: Decoded, plain: SurfaceParams, brdf: Brdf, local: LocalEnvironment) -> vec3<f32> {
    let wo = local.wo;
    var seen = 0.0;
    var total = 0.0;
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let weight = slope_profile_weight(brdf.base, point.z, dot(point.xy, point.xy));
        total += weight;
        seen += weight * max(dot(slope_normal(g, point.xy), wo), 0.0);
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
            let v = slope_normal(g, point.xy);
            weight = slope_profile_weight(brdf.base, point.z, dot(point.xy, point.xy)) * max(dot(v, wo), 0.0);
            n = v * inverseSqrt(dot(v, v));
            step = point.w;
        }
        if weight <= 0.0 || dot(n, wo) <= 0.0 {
            continue;
        }
        var hidden = 0.0;
        if brdf.shading == SHADOWED {
            let wi = 2.0 * dot(n, wo) * n - wo;
            let area = projected_area(g, wi);
            if area <= 0.0 {
                continue;
            }
            hidden = max(projected_area(g, wo), 0.0) * lambda(g, wi, area) * total;
        }
        sum += mirrored(g, n, step, plain, brdf, local) * (weight / (seen + hidden));
    }
    return sum;
}

// Light of a normal map; `narrow` is the Gaussian without the lobe's own width.
fn mirrors_of_map(g: Decoded, narrow: Decoded, plain: SurfaceParams, brdf: Brdf, local: LocalEnvironment) -> vec3<f32> {
    let wo = local.wo;
    let base = brdf_width(brdf, plain.roughness);
    let mean = normalize(vec3<f32>(-g.mean, 1.0));
    let short = clamp(1.0 / (1.0 + 0.5 * (narrow.covariance.x + narrow.covariance.y)), 1e-3, 1.0);
    let whole = NormalLobe(mean, 1.0, (1.0 - short) / short);
    var total = 0.0;
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let square = dot(point.xy, point.xy);
        let weight = slope_profile_weight(brdf.base, point.z, square);
        total += weight;
        let n = normalize(slope_normal(g, point.xy));
        let u = dot(n, wo);
        if u <= 0.0 {
            continue;
        }
        let directions = Directions(2.0 * u * n - wo, wo, n, u);
        let answers = responding_normal(whole, mean, base, n);
        let share = weight * sqrt(1.0 + base * square) * 4.0 * u * factor(brdf, answers, directions, plain.roughness);
        sum += share * mirrored(g, n, point.w, plain, brdf, local);
    }
    return sum * (split_sum_texel(0u, SPLIT_SUM_ENTRIES).y / total);
}

// Directions of a sky that facets shadow.
const BEAMS: u32 = 32u;

// The golden section of a turn.
const GOLDEN_TURN: f32 = 0.38196601;

// Direction k of an even lattice over the sphere.
fn beam(k: u32) -> vec3<f32> {
    let z = 1.0 - f32(2u * k + 1u) / f32(BEAMS);
    return vec3<f32>(sqrt(max(1.0 - z * z, 0.0)) * circle_point(GOLDEN_TURN * f32(k)), z);
}

// Sky over facets that hide each other from it: radiance of each beam, and the part that they let through.
struct OpenSky {
    beams: array<vec4<f32>, BEAMS>,
}

// That sky over a Gaussian of slopes, of which the eye sees `seen`, in units in which slopes weigh one.
fn open_sky(g: Decoded, seen: f32, local: LocalEnvironment) -> OpenSky {
    // A texel of this level has a beam's solid angle.
    let lod = log2(environment.size.x * sqrt(6.0 / f32(BEAMS)));
    let area = max(projected_area(g, local.wo), 0.0);
    var sky: OpenSky;
    for (var k = 0u; k < BEAMS; k++) {
        let wi = beam(k);
        let towards = projected_area(g, wi);
        var through = 0.0;
        if towards > 0.0 {
            through = seen / (seen + area * lambda(g, wi, towards));
        }
        sky.beams[k] = vec4<f32>(environment_radiance(local.rotation * wi, lod), through);
    }
    return sky;
}

// Share of the open sky's light that reaches a facet of this normal.
fn open_share(sky: ptr<function, OpenSky>, n: vec3<f32>) -> vec3<f32> {
    var through = vec3<f32>(0.0);
    var all = vec3<f32>(0.0);
    for (var k = 0u; k < BEAMS; k++) {
        let received = (*sky).beams[k].xyz * max(dot(n, beam(k)), 0.0);
        all += received;
        through += received * (*sky).beams[k].w;
    }
    return through / max(all, vec3<f32>(1e-30));
}

// Light that a texel sends to the eye.
fn reflect_environment(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    local: LocalEnvironment,
) -> vec3<f32> {
    var g = *decoded;
    if local.displaced {
        g = stretched_by(g, local.stretch);
    }
    var seen = 0.0;
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let v = slope_normal(g, point.xy);
        seen += point.z * select(1.0, max(dot(v, local.wo), 0.0), local.displaced);
    }
    let artificial = artificial_normal(g, local.wo);
    if local.displaced {
        seen += ARTIFICIAL_WEIGHT * artificial.w;
    }
    let shadowed = local.displaced && brdf.shading == SHADOWED;
    var sky: OpenSky;
    if shadowed {
        sky = open_sky(g, seen, local);
    }
    var lit = vec3<f32>(0.0);
    for (var i = 0u; i <= GRID * GRID; i++) {
        var n = artificial.xyz;
        var weight = select(0.0, ARTIFICIAL_WEIGHT * artificial.w, local.displaced);
        if i < GRID * GRID {
            let point = slope_point(i);
            let v = slope_normal(g, point.xy);
            weight = point.z * select(1.0, max(dot(v, local.wo), 0.0), local.displaced);
            n = v * inverseSqrt(dot(v, v));
        }
        if weight <= 0.0 {
            continue;
        }
        var share = vec3<f32>(1.0);
        if shadowed {
            share = open_share(&sky, n);
        }
        lit += weight * share * environment_irradiance(local.rotation * n, 0.0, false);
    }
    let diffuse = plain.diffuse / PI * lit / seen;
    if !SPECULAR {
        return diffuse;
    }
    let mean = normalize(vec3<f32>(-g.mean, 1.0));
    let rise = split_sum(dot(mean, local.wo), 0.0).rise;
    let share = reflected_diffuse_share(brdf.shading, rise, plain.specular);
    let width = brdf_width(brdf, plain.roughness);
    let wide = Decoded(g.mean, g.covariance + vec3<f32>(width, width, 0.0));
    if local.displaced {
        return share * diffuse + mirrors_of_displaced(wide, plain, brdf, local);
    }
    return share * diffuse + mirrors_of_map(wide, g, plain, brdf, local);
}
