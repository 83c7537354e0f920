// Slope profile of a lobe that is not a function of slopes. Twin of `slope_profile` in lobe.rs.

// `P22` in units of the lobe's own deviation, at a slope of this squared length: D u⁴ times the variance.
fn lobe_slope_profile(base: f32, square: f32) -> f32 {
    let u2 = 1.0 / (1.0 + lobe_variance(base) * square);
    return lobe_evaluate(base, sqrt(u2)) * u2 * u2 * lobe_variance(base);
}
