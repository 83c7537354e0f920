// The light of one lamp at a place.

fn ndf_shade(map: texture_2d_array<f32>, map_sampler: sampler, uv: vec2<f32>, place: NdfPlace) -> vec3<f32> {
    var channels = channels_at(map, map_sampler, uv);
    return ndf_shade_channels(&channels, place);
}
