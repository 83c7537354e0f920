// Draws a scene through a baked map: look up, decode, shade. One entry point for each way to look up.

@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var map: texture_2d_array<f32>;
@group(1) @binding(2) var params_map: texture_2d_array<f32>;
@group(1) @binding(3) var linear: sampler;

// Surface parameters of a place, where lobes do not carry their own.
fn material_params(diffuse_roughness: vec4<f32>, specular: vec4<f32>) -> SurfaceParams {
    var params = material.plain;
    if material.mapped > 0u {
        params.diffuse = diffuse_roughness.xyz;
        params.roughness = max(diffuse_roughness.w, 0.0);
    }
    if material.mapped > 1u {
        params.specular = specular.xyz;
    }
    return params;
}

// Radiance of a texel under all lights.
fn shade(place: Place, channels: ptr<function, Channels>, plain: SurfaceParams) -> vec3<f32> {
    var light = shade_channel(place, channels, plain);
    for (var c = 1u; c < CHANNELS; c++) {
        turn_to_channel(c);
        light[c] = shade_channel(place, channels, plain)[c];
    }
    turn_to_channel(0u);
    return light;
}

// That radiance; of a lobe whose channels differ by more than a colour, right in the one that is shaded.
fn shade_channel(place: Place, channels: ptr<function, Channels>, plain: SurfaceParams) -> vec3<f32> {
    var decoded = decode(channels);
    var sum = vec3<f32>(0.0);
    // A displaced facet may face lights and eyes that its base turns its back on.
    let displaced = KNOWS_DISPLACEMENT && place.displaced;
    if place.wo.z <= 0.0 && !displaced {
        return sum;
    }
    for (var i = 0u; i < view.lights; i++) {
        let light = seen_from(place, i);
        let across = light.wi + place.wo;
        // A light opposite the eye has no half-vector.
        if dot(across, across) < 1e-12 {
            continue;
        }
        let directions = directions_between(light.wi, place.wo);
        if displaced {
            let light_of = reflect_displaced(channels, &decoded, plain, material.brdf, directions, place.stretch);
            sum += light.irradiance * light_of;
        } else if light.wi.z > 0.0 || light.from_below {
            sum += light.irradiance * reflect_texel(channels, &decoded, plain, material.brdf, directions);
        }
    }
    if environment.technique > 0u {
        let around = LocalEnvironment(environment.rotation * place.frame, place.wo, displaced, place.stretch);
        sum += reflect_environment(channels, &decoded, plain, material.brdf, around);
    }
    return sum;
}

fn taps_of(place: Place) -> Taps {
    let filtering = Filtering(view.max_taps, view.parts, view.lod_bias, textureNumLevels(map));
    return taps(PixelFootprint(place.uv, place.duv_dx, place.duv_dy), material.texels, filtering);
}

// Colours, filtered by the taps.
fn filtered_params(around: Taps) -> SurfaceParams {
    var colours = array<vec4<f32>, 2>();
    let share = 1.0 / f32(around.columns * around.rows);
    for (var k = 0u; k < min(material.mapped, 2u); k++) {
        for (var i = 0u; i < around.columns * around.rows; i++) {
            colours[k] += share * trilinear(params_map, linear, tap(around, i), k, around.lod);
        }
    }
    return material_params(colours[0], colours[1]);
}

// A colour that the target can hold: half floats would turn the light of a sharp lobe into infinity.
fn held(colour: vec3<f32>) -> vec4<f32> {
    return vec4<f32>(min(colour, vec3<f32>(view.brightest)), 1.0);
}

// Our own taps: the same on every device.
@fragment
fn filtered(in: Varying) -> @location(0) vec4<f32> {
    if masked_out(in.pixel) {
        return vec4<f32>(0.0);
    }
    let place = place_of(in, KNOWS_DISPLACEMENT);
    let around = taps_of(place);
    var channels = Channels();
    let count = around.columns * around.rows;
    for (var i = 0u; i < count; i++) {
        let uv = tap(around, i);
        for (var layer = 0u; layer < ALL_LAYERS; layer++) {
            channels[layer] += trilinear(map, linear, uv, layer, around.lod);
        }
    }
    for (var layer = 0u; layer < ALL_LAYERS; layer++) {
        channels[layer] /= f32(count);
    }
    return held(shade(place, &channels, filtered_params(around)));
}

// The sampler's own choice of levels and taps.
@fragment
fn sampled(in: Varying) -> @location(0) vec4<f32> {
    if masked_out(in.pixel) {
        return vec4<f32>(0.0);
    }
    let place = place_of(in, KNOWS_DISPLACEMENT);
    var channels = Channels();
    for (var layer = 0u; layer < ALL_LAYERS; layer++) {
        channels[layer] = textureSampleGrad(map, linear, place.uv, layer, place.duv_dx, place.duv_dy);
    }
    var colours = array<vec4<f32>, 2>();
    for (var k = 0u; k < min(material.mapped, 2u); k++) {
        colours[k] = textureSampleGrad(params_map, linear, place.uv, k, place.duv_dx, place.duv_dy);
    }
    return held(shade(place, &channels, material_params(colours[0], colours[1])));
}

// Every texel that the filter reads is shaded by itself: for channels that must not be mixed, and lobes that
// are not aligned.
@fragment
fn neighbours(in: Varying) -> @location(0) vec4<f32> {
    if masked_out(in.pixel) {
        return vec4<f32>(0.0);
    }
    let place = place_of(in, KNOWS_DISPLACEMENT);
    let around = taps_of(place);
    let plain = filtered_params(around);
    let repeat = vec2<bool>((material.repeat & 1u) != 0u, (material.repeat & 2u) != 0u);
    let count = around.columns * around.rows;
    var sum = vec3<f32>(0.0);
    var channels: Channels;
    for (var i = 0u; i < count; i++) {
        let uv = tap(around, i);
        for (var k = 0u; k < 8u; k++) {
            let n = neighbour(map, uv, around.lod, repeat, k);
            if n.weight > 0.0 {
                for (var layer = 0u; layer < ALL_LAYERS; layer++) {
                    channels[layer] = textureLoad(map, n.texel, layer, n.level);
                }
                sum += n.weight * shade(place, &channels, plain);
            }
        }
    }
    return held(sum / f32(count));
}
