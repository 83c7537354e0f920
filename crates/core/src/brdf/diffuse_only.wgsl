// No highlight: a diffuse material is linked with this in place of a lobe around the half-vector.

// False: the lobe is around the light's direction, and is the diffuse part already.
const SPECULAR: bool = false;

fn lobe_widen(base: f32, by: f32) -> f32 {
    return base;
}

fn lobe_evaluate(base: f32, u: f32) -> f32 {
    return 0.0;
}

fn lobe_variance(base: f32) -> f32 {
    return 0.0;
}

fn lobe_masking(u: f32, width: f32) -> f32 {
    return 1.0;
}

// Visible area of diffuse facets, of Beckmann's form.
fn lobe_visible_area(mean: f32, deviation: f32) -> f32 {
    return mean_of_positive_part(mean, deviation * deviation);
}

fn lobe_slope_profile(base: f32, square: f32) -> f32 {
    return 0.0;
}
