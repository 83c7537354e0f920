// Response of lobes on the sphere: the BRDF's lobe, widened, of the cosine to the mean. Twin of
// `Response::Sphere` in mixture.rs.

fn response(brdf: Brdf, lobe: NormalLobe, roughness: f32, w: vec3<f32>) -> f32 {
    return lobe_evaluate(lobe_widen(brdf.base, lobe.variance + roughness), dot(w, lobe.mean));
}

// Mean that diffuse light takes the cosine to.
fn lambert_mean(lobe: NormalLobe, mu: vec3<f32>) -> vec3<f32> {
    return mu;
}
