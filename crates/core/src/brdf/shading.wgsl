// Shading models, how a surface answers a light: a lobe, what multiplies it, and a diffuse part. Twin of
// shading.rs.

const PI: f32 = 3.14159265358979;

// Models, as numbered by `ShadingModel::index`.
const TAN: u32 = 0u;
const HAN: u32 = 1u;
const SMITH: u32 = 2u;
const MASKED: u32 = 3u;
const SHADOWED: u32 = 4u;

// Least n·wo that Tan et al.'s model divides by.
const LEAST_COSINE: f32 = 0.05;

// A path from light to eye, in the tangent frame.
struct Directions {
    // Unit vector to the light.
    wi: vec3<f32>,
    // Unit vector to the eye.
    wo: vec3<f32>,
    // Half-vector.
    wh: vec3<f32>,
    // wi · wh.
    u: f32,
}

// Surface parameters of a place: its material, apart from its normals.
struct SurfaceParams {
    // Diffuse albedo, linear RGB.
    diffuse: vec3<f32>,
    // Slope variance that widens the lobe here.
    roughness: f32,
    // Reflectance at normal incidence; linear RGB.
    specular: vec3<f32>,
}

alias Table = array<vec4<f32>, 3 * TABLE * CHANNELS>;

// A lobe in a shading model: everything about a material that does not change over its surface.
struct Brdf {
    // The lobe's own number; see its file.
    base: f32,
    // TAN, HAN, SMITH, MASKED or SHADOWED.
    shading: u32,
    // 1: factors are taken at the lobes' means, as the papers print it.
    at_means: u32,
    // Least roughness that `table` is made for, and the span from it to the most.
    roughness: f32,
    span: f32,
    // The method's numbers for the lobe, channel by channel, entry by entry, three of these each: at eleven
    // roughnesses, and for the diffuse lobe.
    table: Table,
}

// Entry of the table at any roughness, mixed from those at the two roughnesses around it. The table's
// roughnesses are equal steps of the root. Each entry is first carried on to this roughness, as heat spreads
// on a sphere, at the rate `decay`. `range` is the least roughness and the span. (The table comes by pointer:
// copying it for every entry would take most of the time.)
fn tabulated(table: ptr<function, Table>, range: vec2<f32>, entry: u32, roughness: f32, decay: f32) -> f32 {
    let first = 3u * (shaded_channel() * TABLE + entry);
    if range.y <= 0.0 {
        return (*table)[first].x;
    }
    let t = 10.0 * sqrt(clamp((roughness - range.x) / range.y, 0.0, 1.0));
    let k = min(u32(t), 9u);
    let i = k + 1u;
    let at = range.x + range.y * vec2<f32>(f32(k * k), f32(i * i)) / 100.0;
    let carried = exp(decay * (at - roughness));
    let below = (*table)[first + k / 4u][k % 4u] * carried.x;
    let above = (*table)[first + i / 4u][i % 4u] * carried.y;
    return mix(below, above, t - f32(k));
}

// An entry of the diffuse lobe's table.
fn tabulated_diffuse(table: ptr<function, Table>, entry: u32) -> f32 {
    return (*table)[3u * entry + 2u].w;
}

// The path between two unit vectors. Only where both are above the surface (z > 0) is anything reflected.
fn directions_between(wi: vec3<f32>, wo: vec3<f32>) -> Directions {
    let wh = normalize(wi + wo);
    return Directions(wi, wo, wh, dot(wi, wh));
}

// The Fresnel term: Schlick's; for Han et al. the colour itself.
fn fresnel(shading: u32, specular: vec3<f32>, u: f32) -> vec3<f32> {
    if shading == HAN {
        return specular;
    }
    let x = clamp(1.0 - u, 0.0, 1.0);
    let x2 = x * x;
    return specular + (1.0 - specular) * (x2 * x2 * x);
}

// Share that is left for the diffuse part.
fn diffuse_share(shading: u32, fresnel: vec3<f32>) -> vec3<f32> {
    return select(1.0 - fresnel, vec3<f32>(1.0), shading == HAN);
}

// Slope variance of the lobe at a place.
fn brdf_width(brdf: Brdf, roughness: f32) -> f32 {
    return lobe_variance(brdf.base) + roughness;
}

// Projected area of the microfacets that make up a facet, towards a direction at this cosine to it.
fn visible_area(width: f32, cosine: f32) -> f32 {
    return lobe_visible_area(cosine, sqrt(max(1.0 - cosine * cosine, 0.0) * width));
}

// The factor c at a normal, for the lobe at this roughness.
fn factor(brdf: Brdf, n: vec3<f32>, directions: Directions, roughness: f32) -> f32 {
    let i = dot(n, directions.wi);
    let o = dot(n, directions.wo);
    if brdf.shading == TAN {
        return 1.0 / max(o, LEAST_COSINE);
    }
    if brdf.shading == HAN {
        return max(i, 0.0);
    }
    if o <= 0.0 || (i <= 0.0 && brdf.shading != MASKED) {
        return 0.0;
    }
    let width = brdf_width(brdf, roughness);
    if brdf.shading == MASKED {
        return 0.25 / visible_area(width, o);
    }
    if brdf.shading == SHADOWED {
        let hidden_from_light = visible_area(width, i) / i - 1.0;
        return 0.25 / (visible_area(width, o) + o * hidden_from_light);
    }
    return lobe_masking(i, width) * lobe_masking(o, width) / (4.0 * o);
}

// Highlight of one normal without Fresnel's term, right in the channel that is shaded.
fn facet_channel(brdf: Brdf, n: vec3<f32>, roughness: f32, directions: Directions) -> vec3<f32> {
    let lobe = lobe_evaluate(lobe_widen(brdf.base, roughness), dot(n, directions.wh));
    return lobe_tint(directions.u) * (lobe * factor(brdf, n, directions, roughness));
}

// Light that one normal sends along the path, per unit of irradiance.
fn facet(brdf: Brdf, n: vec3<f32>, params: SurfaceParams, directions: Directions) -> vec3<f32> {
    let lambert = params.diffuse * (max(dot(n, directions.wi), 0.0) / PI);
    if !SPECULAR {
        return lambert;
    }
    let f = fresnel(brdf.shading, params.specular, directions.u);
    let diffuse = diffuse_share(brdf.shading, f) * lambert;
    var lobe = facet_channel(brdf, n, params.roughness, directions);
    for (var c = 1u; c < CHANNELS; c++) {
        turn_to_channel(c);
        lobe[c] = facet_channel(brdf, n, params.roughness, directions)[c];
    }
    turn_to_channel(0u);
    return diffuse + lobe * f;
}
