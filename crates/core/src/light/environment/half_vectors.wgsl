// Light over half-vectors: Han et al. 2007, section 8, equation 26. Twin of half_vectors.rs.

const HALF_VECTOR_ORDER: u32 = 8u;

// Views on each axis of the grid.
const VIEWS: u32 = 16u;

// The four views around a direction, and the weight of each.
struct ViewsAround {
    views: vec4<u32>,
    weights: vec4<f32>,
}

fn views_around(wo: vec3<f32>) -> ViewsAround {
    let turn = atan2(wo.x, -wo.z) / (2.0 * PI);
    let around = (turn - floor(turn)) * f32(VIEWS);
    let down = acos(clamp(wo.y, -1.0, 1.0)) / PI * f32(VIEWS - 1u);
    let i = u32(around) % VIEWS;
    let j = min(u32(down), VIEWS - 2u);
    let next = (i + 1u) % VIEWS;
    let x = fract(around);
    let y = down - f32(j);
    let views = vec4<u32>(j * VIEWS + i, j * VIEWS + next, (j + 1u) * VIEWS + i, (j + 1u) * VIEWS + next);
    return ViewsAround(views, vec4<f32>((1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y));
}

// A coefficient, interpolated between views.
fn half_vector_between(around: ViewsAround, i: u32) -> vec3<f32> {
    return half_vector_coefficient(around.views.x, i) * around.weights.x
        + half_vector_coefficient(around.views.y, i) * around.weights.y
        + half_vector_coefficient(around.views.z, i) * around.weights.z
        + half_vector_coefficient(around.views.w, i) * around.weights.w;
}

// The series for a lobe of this spread around `mu`, for an eye in direction `wo`. Ringing below zero is
// clamped to zero.
fn over_half_vectors(wo: vec3<f32>, mu: vec3<f32>, spread: f32, printed: bool) -> vec3<f32> {
    let around = views_around(wo);
    let rate_of_last = 0.5 * f32(HALF_VECTOR_ORDER * (HALF_VECTOR_ORDER + 1u));
    let whole = split_sum_texel(0u, SPLIT_SUM_ENTRIES).x;
    let left = split_sum_texel(HALF_VECTOR_ORDER, SPLIT_SUM_ENTRIES).x / whole;
    let own = spread - log(max(left, 1e-30)) / rate_of_last;
    let widened = select(spread + max(environment.irradiance[3].w - own, 0.0), spread, printed);
    var sum = vec3<f32>(0.0);
    var power = vec2<f32>(1.0, 0.0);
    var diagonal = 0.0;
    for (var m = 0u; m <= HALF_VECTOR_ORDER; m++) {
        diagonal = harmonic_diagonal(diagonal, m);
        var h = first_harmonic(diagonal, m);
        for (var l = m; l <= HALF_VECTOR_ORDER; l++) {
            let i = l * l + l;
            let rate = f32(l * select(l + 1u, l, printed));
            let zonal = split_sum_texel(l, SPLIT_SUM_ENTRIES).x * exp(-0.5 * rate * widened);
            var c = half_vector_between(around, i + m) * power.x;
            if m > 0u {
                c += half_vector_between(around, i - m) * power.y;
            }
            sum += zonal * h.value * c;
            h = next_harmonic(h, l, m, mu.z);
        }
        power = next_power(power, mu);
    }
    return max(sum, vec3<f32>(0.0));
}
