// The BRDF's argument for lobes on the sphere. Twin of `cosine` in mixture.rs.

fn cosine(w: vec3<f32>, mu: vec3<f32>) -> f32 {
    return dot(w, mu);
}
