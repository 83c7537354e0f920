// Response of lobes on the sphere by the BRDF's zonal series (Han et al. 2007, equations 13 to 19). Twin of
// `series` in mixture.rs.

fn response(brdf: Brdf, lobe: NormalLobe, roughness: f32, w: vec3<f32>) -> f32 {
    var table = brdf.table;
    let range = vec2<f32>(brdf.roughness, brdf.span);
    let u = clamp(dot(w, lobe.mean), -1.0, 1.0);
    var sum = 0.0;
    // Legendre's polynomials of this order and the one before.
    var p = 1.0;
    var before = 0.0;
    for (var l = 0u; l < TABLE; l++) {
        let order = f32(l);
        let rho = tabulated(&table, range, l, roughness, 0.5 * order * (order + 1.0));
        sum += (2.0 * order + 1.0) / (4.0 * PI) * exp(-0.5 * order * order * lobe.variance) * rho * p;
        let next = ((2.0 * order + 1.0) * u * p - order * before) / (order + 1.0);
        before = p;
        p = next;
    }
    // Ringing below zero is clamped to zero.
    return max(sum, 0.0);
}

// Mean that diffuse light takes the cosine to.
fn lambert_mean(lobe: NormalLobe, mu: vec3<f32>) -> vec3<f32> {
    return mu;
}
