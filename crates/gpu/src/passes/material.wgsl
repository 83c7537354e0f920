// Material, as the passes that shade know it, the same for all its pixels.

struct Material {
    plain: SurfaceParams,
    // Texels of the finest level.
    texels: vec2<f32>,
    // Colours in `params`: 0 none, 1 albedo and roughness, 2 specular colour as well.
    mapped: u32,
    // Axes that repeat: 1 the first, 2 the second.
    repeat: u32,
    brdf: Brdf,
}
