// Masking of facets whose slopes are Gaussian. Twin of the default methods of `Lobe` in lobe.rs: Beckmann's
// own, and that of lobes without a form of their own.

// Smith's `G1` at cosine `u > 0`, of a lobe that is `width` wide.
fn lobe_masking(u: f32, width: f32) -> f32 {
    return beckmann_masking(u, width);
}

// Projected area of the facets that face a direction.
fn lobe_visible_area(mean: f32, deviation: f32) -> f32 {
    return mean_of_positive_part(mean, deviation * deviation);
}
