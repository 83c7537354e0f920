// A fragment shader around `ndf_shade`, for languages that want one.

@group(0) @binding(0) var ndf_map: texture_2d_array<f32>;
@group(0) @binding(1) var ndf_sampler: sampler;

@fragment
fn main(
    @location(0) uv: vec2<f32>,
    @location(1) wi: vec3<f32>,
    @location(2) wo: vec3<f32>,
    @location(3) diffuse: vec3<f32>,
    @location(4) specular: vec3<f32>,
) -> @location(0) vec4<f32> {
    let place = NdfPlace(normalize(wi), normalize(wo), diffuse, specular);
    return vec4<f32>(ndf_shade(ndf_map, ndf_sampler, uv, place), 1.0);
}
