// A lobe's own profile, stretched by a covariance of slopes. Twin of `stretched` in slopes.rs.

// Density of slopes at `d` from the mean, for a lobe whose own width is already in the `covariance` (xx, yy,
// xy).
fn stretched(base: f32, covariance: vec3<f32>, d: vec2<f32>) -> f32 {
    let square = mahalanobis(covariance, d);
    // Per map area: the profile counts facet area, which is 1/u as much.
    return lobe_slope_profile(base, square) * sqrt(1.0 + lobe_variance(base) * square) * inverseSqrt(determinant_of(covariance));
}

// The determinant of a covariance.
fn determinant_of(covariance: vec3<f32>) -> f32 {
    return max(covariance.x * covariance.y - covariance.z * covariance.z, 1e-30);
}

// Squared length of a slope in units of its deviations.
fn mahalanobis(covariance: vec3<f32>, d: vec2<f32>) -> f32 {
    let m = covariance.y * d.x * d.x - 2.0 * covariance.z * d.x * d.y + covariance.x * d.y * d.y;
    return max(m / determinant_of(covariance), 0.0);
}
