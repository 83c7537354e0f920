// Environment as shading looks it up. Twin of filtered.rs.
//
// A host brings `environment`, a uniform; `environment_radiance` and `environment_blurred`, the cubes, as
// functions of a direction and a level; `half_vector_coefficient`, of a view and an index; and
// `split_sum_texel`, of a column and a row.

// Techniques, as numbered by `Technique::index`; 0 is no environment.
const PREFILTERED: u32 = 1u;
const HARMONICS: u32 = 2u;

struct Environment {
    // Rotation from directions of the world to the environment's own.
    rotation: mat3x3<f32>,
    // Nine harmonics of its light, without small bright sources; in w of the first three, red, green and blue
    // of the least irradiance that a normal receives; in w of the fourth, the least variance of lobes over
    // half-vectors.
    irradiance: array<vec4<f32>, 9>,
    // Texels on a side of the cubes' finest level, and the number of levels.
    size: vec2<f32>,
    // Factor that multiplies the cubes' texels.
    scale: f32,
    // PREFILTERED, HARMONICS, or 0.
    technique: u32,
}

// Level of a blurred cube that is `times` as rough as a lobe; levels are even in perceptual roughness.
fn blurred_level(width: f32, times: f32) -> f32 {
    return min(times * min(sqrt(sqrt(2.0 * width)), 1.0), 1.0) * (environment.size.y - 1.0);
}
