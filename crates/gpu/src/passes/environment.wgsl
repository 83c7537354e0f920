// Bindings that the drawing pass brings to an environment's shading: its uniform, its cubes, and its tables.

@group(0) @binding(6) var<uniform> environment: Environment;
@group(0) @binding(7) var radiance_cube: texture_2d_array<f32>;
@group(0) @binding(8) var half_vectors: texture_2d<f32>;
@group(0) @binding(9) var cube_linear: sampler;

// The material's: reflectance under a white sky, and the cubes that facets like its own have blurred.
@group(1) @binding(4) var split_sums: texture_2d<f32>;
@group(1) @binding(5) var blurred_cube: texture_2d_array<f32>;

fn environment_radiance(w: vec3<f32>, lod: f32) -> vec3<f32> {
    return environment.scale * cube_lookup(radiance_cube, cube_linear, w, lod, environment.size);
}

fn environment_blurred(w: vec3<f32>, lod: f32) -> vec3<f32> {
    return environment.scale * cube_lookup(blurred_cube, cube_linear, w, lod, environment.size);
}

fn half_vector_coefficient(view: u32, i: u32) -> vec3<f32> {
    return textureLoad(half_vectors, vec2<u32>(i, view), 0).xyz;
}

fn split_sum_texel(x: u32, y: u32) -> vec4<f32> {
    return textureLoad(split_sums, vec2<u32>(x, y + shaded_channel() * (SPLIT_SUM_ENTRIES + 1u)), 0);
}
