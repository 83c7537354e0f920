// Smith's masking of facets for a Gaussian of slopes, in Walter et al.'s rational form (2007, equation 27).
// Twin of `masking` in beckmann.rs, which lobes without a form of their own share.

// Masking at cosine `u > 0` to the normal, of facets whose slopes have the variance `width`.
fn beckmann_masking(u: f32, width: f32) -> f32 {
    // a = 1/(alpha tan), alpha² = 2 v.
    let tan_squared = max((1.0 - u * u) / (u * u), 0.0);
    let inverse = 2.0 * width * tan_squared;
    // Where a is 1.6 or more nothing is masked.
    if inverse * 2.56 <= 1.0 {
        return 1.0;
    }
    let a = inverseSqrt(inverse);
    return (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a);
}
