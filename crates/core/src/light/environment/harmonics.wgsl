// The irradiance of normals that stray, from an environment's first nine harmonics. Twin of harmonics.rs.

// Factors by which a von Mises-Fisher lobe of normals scales orders 1 and 2, its variance being 1/kappa.
fn zonal_of_normals(variance: f32) -> vec2<f32> {
    let v = max(variance, 1e-6);
    let kappa = 1.0 / v;
    let square = kappa * kappa;
    if kappa < 0.5 {
        let first = kappa * (1.0 / 3.0 - square * (1.0 / 45.0 - square * (2.0 / 945.0 - square / 4725.0)));
        return vec2<f32>(first, square * (1.0 / 15.0 - 2.0 * square / 315.0));
    }
    // 1/tanh, where exp has not yet gone out of range.
    let coth = select(1.0, (1.0 + exp(-2.0 * kappa)) / (1.0 - exp(-2.0 * kappa)), kappa < 20.0);
    let first = coth - v;
    return vec2<f32>(first, 1.0 - 3.0 * v * first);
}

// Irradiance of normals of this variance around a direction, in the environment's frame (Han et al. 2007,
// equation 25). No result is darker than the least that a normal receives. The constants are those of the
// harmonics: sqrt(1/4 pi), sqrt(3/4 pi), sqrt(15/4 pi), sqrt(5/16 pi).
fn environment_irradiance(n: vec3<f32>, variance: f32, printed: bool) -> vec3<f32> {
    var lambda = zonal_of_normals(variance);
    if printed {
        lambda = vec2<f32>(exp(-0.5 * variance), exp(-2.0 * variance));
    }
    let c = 0.48860251 * (environment.irradiance[1].xyz * n.y + environment.irradiance[2].xyz * n.z + environment.irradiance[3].xyz * n.x);
    let d = 1.09254843 * (environment.irradiance[4].xyz * (n.x * n.y) + environment.irradiance[5].xyz * (n.y * n.z) + environment.irradiance[7].xyz * (n.x * n.z))
        + 0.31539157 * environment.irradiance[6].xyz * (3.0 * n.z * n.z - 1.0)
        + 0.54627422 * environment.irradiance[8].xyz * (n.x * n.x - n.y * n.y);
    let sum = PI * 0.28209479 * environment.irradiance[0].xyz + (2.0 * PI / 3.0) * lambda.x * c + (PI / 4.0) * lambda.y * d;
    return max(sum, vec3<f32>(environment.irradiance[0].w, environment.irradiance[1].w, environment.irradiance[2].w));
}
