// Adds a picture to sums: sums = keep sums + add picture.

struct Weights {
    keep: f32,
    add: f32,
    // 1 to add only where `mask` is not 0.
    masked: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> weights: Weights;
@group(0) @binding(1) var picture: texture_2d<f32>;
@group(0) @binding(2) var mask: texture_2d<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(picture);
    let i = id.x + id.y * ROW;
    if i >= size.x * size.y {
        return;
    }
    let at = vec2<u32>(i % size.x, i / size.x);
    if weights.masked == 1u && textureLoad(mask, at, 0).x == 0u {
        return;
    }
    // Sums that are not kept are not read either: they may be NaN.
    let before = select(weights.keep * sums[i], vec4<f32>(0.0), weights.keep == 0.0);
    sums[i] = before + weights.add * textureLoad(picture, at, 0);
}
