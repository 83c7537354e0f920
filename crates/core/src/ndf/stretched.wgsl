// A lobe's own profile, stretched by a covariance of slopes. Twin of `stretched` in slopes.rs.

// Density of slopes at `d` from the mean, for a lobe whose own width is already in the `covariance` (xx, yy, xy).
fn stretched(base: f32, covariance: vec3<f32>, d: vec2<f32>) -> f32 {
    let s = stretch(base, covariance, d);
    return brdf_evaluate(base, s.x) * s.x * s.x * s.x * s.y;
}

// Where a slope `d` from the mean lies on the stretched profile: the cosine there, and how many times as many slopes are there.
fn stretch(base: f32, covariance: vec3<f32>, d: vec2<f32>) -> vec2<f32> {
    let determinant = max(covariance.x * covariance.y - covariance.z * covariance.z, 1e-30);
    let variance = brdf_variance(base);
    let m = covariance.y * d.x * d.x - 2.0 * covariance.z * d.x * d.y + covariance.x * d.y * d.y;
    return vec2<f32>(inverseSqrt(1.0 + variance * max(m / determinant, 0.0)), variance * inverseSqrt(determinant));
}
