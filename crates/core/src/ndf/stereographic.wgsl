// A Gaussian on the plane, projected to the full sphere from the pole below (Olano and North 1997). Twin of
// stereographic.rs.

struct Decoded {
    // Mean on the plane.
    mean: vec2<f32>,
    // Covariance: xx, yy, xy.
    covariance: vec3<f32>,
    // Mean normal.
    normal: vec3<f32>,
}

fn decode(channels: ptr<function, Channels>) -> Decoded {
    let a = (*channels)[0];
    let b = (*channels)[1];
    let s = a.xy;
    let squares = max(a.zw - s * s, vec2<f32>(0.0));
    return Decoded(s, vec3<f32>(squares, b.x - s.x * s.y), b.yzw);
}

fn mean_normal(g: ptr<function, Decoded>) -> vec3<f32> {
    return (*g).normal;
}

fn effective(g: ptr<function, Decoded>, brdf: Brdf, roughness: f32, w: vec3<f32>) -> f32 {
    var table = brdf.table;
    let energy = tabulated(&table, vec2<f32>(brdf.roughness, brdf.span), 0u, roughness, 0.0);
    let floor = 0.25 * lobe_variance(lobe_widen(brdf.base, roughness));
    let c = (*g).covariance + vec3<f32>(floor, floor, 0.0);
    let determinant = max(c.x * c.y - c.z * c.z, floor * floor);
    let d = w.xy / max(1.0 + w.z, 1e-9) - (*g).mean;
    let far = (c.y * d.x * d.x - 2.0 * c.z * d.x * d.y + c.x * d.y * d.y) / determinant;
    return energy / (2.0 * PI * sqrt(determinant)) * exp(-0.5 * max(far, 0.0));
}

fn effective_diffuse(g: ptr<function, Decoded>, brdf: Brdf, w: vec3<f32>) -> f32 {
    return max(dot(w, (*g).normal), 0.0);
}
