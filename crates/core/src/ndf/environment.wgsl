// Shading a filtered texel under an environment: the parts that methods share. Twin of environment.rs.

// Environment, as a point of the surface sees it.
struct LocalEnvironment {
    // Rotation from the tangent frame to the environment's.
    rotation: mat3x3<f32>,
    // Unit vector to the eye, in the tangent frame.
    wo: vec3<f32>,
    // On a displaced surface, how slopes of the map lie on it.
    displaced: bool,
    stretch: mat2x2<f32>,
}

// Light of one lobe of normals, of mean direction `mu`.
fn lobe_light(mu: vec3<f32>, variance: f32, params: SurfaceParams, brdf: Brdf, local: LocalEnvironment) -> vec3<f32> {
    let printed = brdf.at_means == 1u;
    let spread = variance + params.roughness;
    let diffuse = params.diffuse / PI * environment_irradiance(local.rotation * mu, variance, printed);
    if !SPECULAR {
        return diffuse;
    }
    let cosine = dot(mu, local.wo);
    let reflected = split_sum(cosine, spread);
    var seen: vec3<f32>;
    if environment.technique == HARMONICS {
        seen = over_half_vectors(local.rotation * local.wo, local.rotation * mu, spread, printed);
        if printed {
            // Equation 26 alone, with what does not depend on the normal.
            let u = max(cosine, 0.0);
            return seen * lobe_tint(u) * fresnel(brdf.shading, params.specular, u)
                + reflected_diffuse_share(brdf.shading, reflected.rise, params.specular) * diffuse;
        }
        seen /= max(reflected.lobe, 1e-9);
    } else {
        let towards = reflected_towards(reflected, mu, local.wo);
        seen = environment_blurred(local.rotation * towards, blurred_level(brdf_width(brdf, spread), reflected.blur));
    }
    return seen * (params.specular * reflected.scale + reflected.bias)
        + reflected_diffuse_share(brdf.shading, reflected.rise, params.specular) * diffuse;
}
