// LEADR: light that a displaced surface sends to the eye, when its slopes are a Gaussian. Twin of leadr.rs.
//
// Diffuse facets are averaged over GRID × GRID slopes: GRID_STEP deviations apart, or (GRID_DRAWN) drawn at
// random.

// Weight of the artificial normal that keeps silhouettes defined.
const ARTIFICIAL_WEIGHT: f32 = 1e-5;

// Turn of the artificial normal towards the eye: 1 would leave it edge-on.
const ARTIFICIAL_TURN: f32 = 1.01;

// Least that the eye sees of the artificial normal.
const LEAST_VISIBLE: f32 = 1e-6;

// The distribution after a linear map of slopes.
fn stretched_by(g: Decoded, by: mat2x2<f32>) -> Decoded {
    let c = g.covariance;
    let moved = by * mat2x2<f32>(c.x, c.z, c.z, c.y) * transpose(by);
    return Decoded(by * g.mean, vec3<f32>(moved[0].x, moved[1].y, moved[0].y));
}

// Projected area of the mean normal towards a direction.
fn projected_area(g: Decoded, w: vec3<f32>) -> f32 {
    return w.z - dot(g.mean, w.xy);
}

// Deviation of the projected area of single facets.
fn projected_deviation(g: Decoded, w: vec3<f32>) -> f32 {
    let c = g.covariance;
    return sqrt(max(c.x * w.x * w.x + c.y * w.y * w.y + 2.0 * c.z * w.x * w.y, 0.0));
}

// Smith's Lambda, exactly, where `area` is above zero.
fn lambda(g: Decoded, w: vec3<f32>, area: f32) -> f32 {
    return max(lobe_visible_area(area, projected_deviation(g, w)) / area - 1.0, 0.0);
}

// Smith's Lambda in Walter et al.'s rational form, with the paper's clamps.
fn lambda_rational(g: Decoded, w: vec3<f32>) -> f32 {
    let nu = clamp(projected_area(g, w) / (1.41421356 * projected_deviation(g, w)), 0.001, 1.599);
    return (1.0 - 1.259 * nu + 0.396 * nu * nu) / (3.535 * nu + 2.181 * nu * nu);
}

// D(n): area of facets per solid angle of their normals, with the lobe's own width in the covariance already.
fn facets(g: Decoded, base: f32, n: vec3<f32>) -> f32 {
    if n.z <= 0.0 {
        return 0.0;
    }
    let square = mahalanobis(g.covariance, -n.xy / n.z - g.mean);
    let z2 = n.z * n.z;
    return lobe_slope_profile(base, square) * inverseSqrt(determinant_of(g.covariance)) / (z2 * z2);
}

// Normal that the eye sees where it sees no other, and how much of it the eye sees.
fn artificial_normal(g: Decoded, wo: vec3<f32>) -> vec4<f32> {
    let mean = normalize(vec3<f32>(-g.mean, 1.0));
    let v = mean - wo * (ARTIFICIAL_TURN * dot(mean, wo));
    let square = dot(v, v);
    let n = select(wo, v * inverseSqrt(max(square, 1e-30)), square > 1e-30);
    return vec4<f32>(n, max(dot(n, wo), LEAST_VISIBLE));
}

// Hash of a number, as good as random (the permuted congruential generator of O'Neill 2014).
fn slope_hash(v: u32) -> u32 {
    let state = v * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Point of the unit circle after `turns` from its first axis: the sine and the cosine of the angle to the
// nearest axis by their series, to 2e-9, as a device's own may be off by 2^-11, and by
// anything beyond half a turn.
fn circle_point(turns: f32) -> vec2<f32> {
    let quarter = round(4.0 * turns);
    let a = 0.5 * PI * (4.0 * turns - quarter);
    let a2 = a * a;
    let s = a * (1.0 - a2 / 6.0 * (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0 * (1.0 - a2 / 72.0))));
    let c = 1.0 - a2 / 2.0 * (1.0 - a2 / 12.0 * (1.0 - a2 / 30.0 * (1.0 - a2 / 56.0 * (1.0 - a2 / 90.0))));
    let odd = (u32(quarter) & 1u) == 1u;
    let point = select(vec2<f32>(c, s), vec2<f32>(-s, c), odd);
    return select(point, -point, (u32(quarter) & 2u) == 2u);
}

// A slope of the grid: its place in deviations, its weight (all of them add up to one), and the side of the
// square that it stands for.
fn slope_point(i: u32) -> vec4<f32> {
    if GRID_DRAWN {
        let u = (f32(slope_hash(2u * i) >> 8u) + 0.5) / 16777216.0;
        let v = (f32(slope_hash(2u * i + 1u) >> 8u) + 0.5) / 16777216.0;
        let radius = sqrt(-2.0 * log(u));
        let share = 1.0 / f32(GRID * GRID);
        return vec4<f32>(radius * circle_point(v), share, sqrt(2.0 * PI / u * share));
    }
    let at = GRID_STEP * (vec2<f32>(f32(i / GRID), f32(i % GRID)) - 0.5 * f32(GRID - 1u));
    return vec4<f32>(at, GRID_WEIGHT * exp(-0.5 * dot(at, at)), GRID_STEP);
}

// The normal of a slope of the grid, over its z.
fn slope_normal(g: Decoded, at: vec2<f32>) -> vec3<f32> {
    let deviation = sqrt(g.covariance.x);
    let shear = select(0.0, g.covariance.z / deviation, deviation > 0.0);
    let rest = sqrt(max(g.covariance.y - shear * shear, 0.0));
    return vec3<f32>(-g.mean - vec2<f32>(deviation * at.x, shear * at.x + rest * at.y), 1.0);
}

// Area that shadows take: `a(wo) Lambda(wi)`; below zero where all is in shadow.
fn shadow(brdf: Brdf, g: Decoded, directions: Directions) -> f32 {
    if brdf.shading != SHADOWED {
        return 0.0;
    }
    let area = projected_area(g, directions.wi);
    if area <= 0.0 {
        return -1.0;
    }
    return max(projected_area(g, directions.wo), 0.0) * lambda(g, directions.wi, area);
}

// Light from specular facets. `spread` holds the lobe's own width already.
fn displaced_specular(brdf: Brdf, spread: Decoded, roughness: f32, directions: Directions) -> f32 {
    let lit = 0.25 * facets(spread, brdf.base, directions.wh);
    if brdf.at_means == 1u {
        var hidden = 1.0 + lambda_rational(spread, directions.wo);
        if brdf.shading == SHADOWED {
            hidden += lambda_rational(spread, directions.wi);
        }
        return lit / (projected_area(spread, directions.wo) * hidden);
    }
    let shadow = shadow(brdf, spread, directions);
    if shadow < 0.0 {
        return 0.0;
    }
    let artificial = artificial_normal(spread, directions.wo);
    let seen = ARTIFICIAL_WEIGHT * artificial.w;
    let lobe = lobe_evaluate(lobe_widen(brdf.base, roughness), dot(artificial.xyz, directions.wh));
    let facet = lobe * factor(brdf, artificial.xyz, directions, roughness);
    let area = lobe_visible_area(projected_area(spread, directions.wo), projected_deviation(spread, directions.wo));
    return (lit + seen * facet) / (area + seen + shadow);
}

// Light from diffuse facets, times pi over their albedo.
fn displaced_diffuse(brdf: Brdf, g: Decoded, directions: Directions) -> f32 {
    let shadow = shadow(brdf, g, directions);
    if shadow < 0.0 {
        return 0.0;
    }
    var lit = 0.0;
    var seen = 0.0;
    for (var i = 0u; i < GRID * GRID; i++) {
        let point = slope_point(i);
        let n = slope_normal(g, point.xy);
        let visible = point.z * max(dot(n, directions.wo), 0.0);
        seen += visible;
        lit += visible * max(dot(n, directions.wi), 0.0) * inverseSqrt(dot(n, n));
    }
    let artificial = artificial_normal(g, directions.wo);
    let visible = ARTIFICIAL_WEIGHT * artificial.w;
    return (lit + visible * max(dot(artificial.xyz, directions.wi), 0.0)) / (seen + visible + shadow);
}

// Light that a filtered texel of a displaced surface sends along the path, per unit of irradiance; `by` maps
// slopes of the map to those on the surface.
fn reflect_displaced(
    channels: ptr<function, Channels>,
    decoded: ptr<function, Decoded>,
    plain: SurfaceParams,
    brdf: Brdf,
    directions: Directions,
    by: mat2x2<f32>,
) -> vec3<f32> {
    let g = stretched_by(*decoded, by);
    var specular = 0.0;
    if SPECULAR {
        let width = brdf_width(brdf, plain.roughness);
        let spread = Decoded(g.mean, g.covariance + vec3<f32>(width, width, 0.0));
        specular = displaced_specular(brdf, spread, plain.roughness, directions);
    }
    return combine(brdf, plain, directions, specular, displaced_diffuse(brdf, g, directions));
}
