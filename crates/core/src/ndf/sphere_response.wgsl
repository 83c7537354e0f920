// Response of lobes on the sphere: the BRDF's lobe, widened, of the cosine to the mean. Twin of
// `Response::Sphere` in mixture.rs.

fn response(widened: f32, w: vec3<f32>, mu: vec3<f32>) -> f32 {
    return lobe_evaluate(widened, dot(w, mu));
}

// Mean that diffuse light takes the cosine to.
fn lambert_mean(lobe: NormalLobe, mu: vec3<f32>) -> vec3<f32> {
    return mu;
}
