// The look-up of methods whose channels must not be mixed: it shades each of the eight texels around and
// mixes their light. The map repeats; the sampler is not used. Call it where all pixels of a quad do (it
// takes derivatives).

fn ndf_shade(map: texture_2d_array<f32>, map_sampler: sampler, uv: vec2<f32>, place: NdfPlace) -> vec3<f32> {
    let levels = level_count(textureDimensions(map));
    let pixel = PixelFootprint(uv, dpdx(uv), dpdy(uv));
    let lod = taps(pixel, vec2<f32>(textureDimensions(map)), Filtering(1u, 1u, 0.0, levels)).lod;
    var sum = vec3<f32>(0.0);
    var channels: Channels;
    for (var i = 0u; i < 8u; i++) {
        let n = neighbour(map, uv, lod, vec2<bool>(true), i);
        if n.weight > 0.0 {
            for (var layer = 0u; layer < ALL_LAYERS; layer++) {
                channels[layer] = textureLoad(map, n.texel, layer, n.level);
            }
            sum += n.weight * ndf_shade_channels(&channels, place);
        }
    }
    return sum;
}
