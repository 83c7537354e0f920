// A Gaussian of slopes from their moments: LEAN and LEADR. Twin of slopes.rs.

struct Decoded {
    // Mean slope.
    mean: vec2<f32>,
    // Covariance: xx, yy, xy.
    covariance: vec3<f32>,
}

fn decode(channels: ptr<function, Channels>) -> Decoded {
    let mean = (*channels)[0].yz;
    let second = (*channels)[1].xyz;
    // Rounding of the stored moments can leave a variance below zero or a correlation beyond one.
    let xx = max(second.x - mean.x * mean.x, 0.0);
    let yy = max(second.y - mean.y * mean.y, 0.0);
    let limit = sqrt(xx * yy);
    return Decoded(mean, vec3<f32>(xx, yy, clamp(second.z - mean.x * mean.y, -limit, limit)));
}

fn mean_normal(g: ptr<function, Decoded>) -> vec3<f32> {
    let n = normalize(vec3<f32>(-(*g).mean, 1.0));
    return n / (1.0 + 0.5 * ((*g).covariance.x + (*g).covariance.y));
}

fn effective(g: ptr<function, Decoded>, brdf: Brdf, roughness: f32, w: vec3<f32>) -> f32 {
    if w.z <= 0.0 {
        return 0.0;
    }
    let base = lobe_widen(brdf.base, roughness);
    let variance = lobe_variance(base);
    let widened = (*g).covariance + vec3<f32>(variance, variance, 0.0);
    return stretched(base, widened, -w.xy / w.z - (*g).mean) / (w.z * w.z * w.z);
}

// Positions (in deviations) and weights of 5-point Gauss-Hermite quadrature.
fn hermite(i: u32) -> vec2<f32> {
    let far = vec2<f32>(2.8569700138728, 0.0112574113277207);
    let near = vec2<f32>(1.3556261799743, 0.222075922005613);
    let signs = vec2<f32>(select(1.0, -1.0, i < 2u), 1.0);
    return select(select(near, far, i == 0u || i == 4u) * signs, vec2<f32>(0.0, 0.533333333333333), i == 2u);
}

fn effective_diffuse(g: ptr<function, Decoded>, brdf: Brdf, w: vec3<f32>) -> f32 {
    let c = (*g).covariance;
    let deviation = sqrt(c.x);
    let shear = select(0.0, c.z / deviation, deviation > 0.0);
    let rest = sqrt(max(c.y - shear * shear, 0.0));
    var sum = 0.0;
    for (var i = 0u; i < 5u; i++) {
        let a = hermite(i);
        for (var j = 0u; j < 5u; j++) {
            let b = hermite(j);
            let slope = (*g).mean + vec2<f32>(deviation * a.x, shear * a.x + rest * b.x);
            let n = vec3<f32>(-slope, 1.0) * inverseSqrt(1.0 + dot(slope, slope));
            sum += a.y * b.y * max(dot(w, n), 0.0);
        }
    }
    return sum;
}
