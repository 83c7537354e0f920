// Shading a filtered texel under an environment, what methods share. Twin of environment.rs.

// What surrounds a place.
struct Around {
    // From the tangent frame to the environment's.
    turn: mat3x3<f32>,
    // To the eye, in the tangent frame.
    wo: vec3<f32>,
    // On a displaced surface, how slopes of the map lie on it.
    relief: bool,
    stretch: mat2x2<f32>,
}

// Light of one lobe of normals, of mean direction `mu`.
fn lobe_light(mu: vec3<f32>, variance: f32, finish: Finish, reflection: Reflection, around: Around) -> vec3<f32> {
    let printed = reflection.at_means == 1u;
    let spread = variance + finish.gloss;
    let diffuse = finish.diffuse / PI * environment_irradiance(around.turn * mu, variance, printed);
    if !SPECULAR {
        return diffuse;
    }
    let cosine = dot(mu, around.wo);
    let reflected = split_sum(cosine, spread);
    var seen: vec3<f32>;
    if environment.technique == HARMONICS {
        seen = over_half_vectors(around.turn * around.wo, around.turn * mu, spread, printed) / max(reflected.lobe, 1e-9);
    } else {
        let towards = reflected_towards(reflected, mu, around.wo);
        seen = environment_blurred(around.turn * towards, blurred_level(lobe_width(reflection, spread), reflected.blur));
    }
    return seen * (finish.specular * reflected.scale + reflected.bias)
        + reflected_diffuse_share(reflection.model, reflected.rise, finish.specular) * diffuse;
}
