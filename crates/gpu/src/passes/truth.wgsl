// Draws the truth: each sample shades one texel of the finest level as it is. No method is in here; compare
// truth/mod.rs of the CPU renderer.

@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var normals: texture_2d<f32>;
@group(1) @binding(2) var params_map: texture_2d_array<f32>;

// Random number for each pixel and sample (the permuted congruential generator of O'Neill 2014, as a hash).
fn hash(v: u32) -> u32 {
    let state = v * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn random(pixel: vec2<f32>, k: u32) -> f32 {
    let bits = hash(hash(hash(u32(pixel.x) + 65536u * u32(pixel.y)) ^ view.seed) + k);
    return f32(bits >> 8u) / 16777216.0;
}

// A texel's coordinate on an axis of `n`, however far beyond the edges.
fn wrapped(t: f32, n: f32, repeat: bool) -> i32 {
    let at = floor(t);
    let held = select(clamp(at, 0.0, n - 1.0), at - n * floor(at / n), repeat);
    return i32(clamp(held, 0.0, n - 1.0));
}

@fragment
fn truth(in: Varying) -> @location(0) vec4<f32> {
    let place = place_of(in, false);
    // The mean over samples is the bilinear mix of the texels' light: each takes the texel under a point
    // displaced by up to half a texel either way.
    let displaced = vec2<f32>(random(in.pixel.xy, 0u), random(in.pixel.xy, 1u)) - 0.5;
    let at = place.uv * material.texels + displaced;
    let x = wrapped(at.x, material.texels.x, (material.repeat & 1u) != 0u);
    let y = wrapped(at.y, material.texels.y, (material.repeat & 2u) != 0u);
    let n = textureLoad(normals, vec2<i32>(x, y), 0).xyz;
    var params = material.plain;
    if material.mapped > 0u {
        let diffuse_roughness = textureLoad(params_map, vec2<i32>(x, y), 0, 0);
        params.diffuse = diffuse_roughness.xyz;
        params.roughness = max(diffuse_roughness.w, 0.0);
    }
    if material.mapped > 1u {
        params.specular = textureLoad(params_map, vec2<i32>(x, y), 1, 0).xyz;
    }
    var sum = vec3<f32>(0.0);
    if place.wo.z > 0.0 {
        for (var i = 0u; i < view.lights; i++) {
            let light = seen_from(place, i);
            if light.wi.z > 0.0 {
                let directions = directions_between(light.wi, place.wo);
                sum += light.irradiance * facet(material.brdf, n, params, directions);
            }
        }
    }
    return vec4<f32>(sum, 1.0);
}
