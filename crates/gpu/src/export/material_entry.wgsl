// A call of every function for materials, which tells naga that none is to be left out. Nobody draws with it.

@group(0) @binding(0) var ndf_map: texture_2d_array<f32>;
@group(0) @binding(1) var ndf_sampler: sampler;
@group(0) @binding(2) var ndf_room: texture_cube<f32>;
@group(0) @binding(3) var ndf_room_sampler: sampler;

@fragment
fn main(
    @location(0) uv: vec2<f32>,
    @location(1) wi: vec3<f32>,
    @location(2) wo: vec3<f32>,
    @location(3) diffuse: vec3<f32>,
    @location(4) specular: vec3<f32>,
    @location(5) alpha: f32,
) -> @location(0) vec4<f32> {
    let lobes = ndf_decode_lobes(ndf_map, ndf_sampler, uv);
    let material = NdfMaterial(diffuse, specular, alpha);
    let frame = NdfFrame(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(0.0, 0.0, 1.0));
    let eye = normalize(wo);
    let share = ndf_share(dpdx(uv), dpdy(uv), 1.0, 16.0);
    let light = ndf_shade(lobes, material, normalize(wi), eye)
        + ndf_shade_environment(lobes, material, eye, frame, ndf_room, ndf_room_sampler, 8.0);
    return vec4<f32>(share * light, ndf_normal(lobes).z);
}
