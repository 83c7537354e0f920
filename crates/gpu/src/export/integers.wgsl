// The look-up of maps in integers, each channel in a range of its own: the sampler's own, so set it to linear
// filtering on all three axes, and to anisotropic filtering where the device has it. Call it where all pixels
// of a quad do (it takes derivatives).

fn channels_at(map: texture_2d_array<f32>, map_sampler: sampler, uv: vec2<f32>) -> Channels {
    var stored: array<vec4<f32>, STORED_LAYERS>;
    for (var layer = 0u; layer < STORED_LAYERS; layer++) {
        stored[layer] = textureSample(map, map_sampler, uv, layer);
    }
    return ndf_channels(stored);
}
