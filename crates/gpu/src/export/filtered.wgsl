// The look-up of methods whose channels may be mixed: the sampler's own, so set it to linear filtering on all
// three axes, and to anisotropic filtering where the device has it. Call it where all pixels of a quad do
// (it takes derivatives).

fn channels_at(map: texture_2d_array<f32>, map_sampler: sampler, uv: vec2<f32>) -> Channels {
    var channels: Channels;
    for (var layer = 0u; layer < ALL_LAYERS; layer++) {
        channels[layer] = textureSample(map, map_sampler, uv, layer);
    }
    return channels;
}
