// Marks pixels with an outline in them: where the pixels around do not continue the pixel's own surface. Twin
// of `outline` in the CPU renderer.

@group(0) @binding(0) var places: texture_2d<f32>;
@group(0) @binding(1) var faces: texture_2d<f32>;
@group(0) @binding(2) var mask: texture_storage_2d<r32uint, write>;

fn differs(a: vec2<i32>, b: vec2<i32>) -> bool {
    let size = vec2<i32>(textureDimensions(places));
    if any(b < vec2<i32>(0)) || any(b >= size) {
        return false;
    }
    let here = textureLoad(places, a, 0);
    let there = textureLoad(places, b, 0);
    if here.w != there.w {
        return true;
    }
    // Object 0 is the background.
    if here.w == 0.0 {
        return false;
    }
    let face = textureLoad(faces, a, 0);
    // Off the plane of the face by more than a twentieth of the distance, or turned by more than 60 degrees.
    let off = abs(dot(there.xyz - here.xyz, face.xyz)) > 0.05 * face.w;
    return off || dot(face.xyz, textureLoad(faces, b, 0).xyz) < 0.5;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(places);
    let i = id.x + id.y * ROW;
    if i >= size.x * size.y {
        return;
    }
    let at = vec2<i32>(vec2<u32>(i % size.x, i / size.x));
    let x = vec2<i32>(1, 0);
    let y = vec2<i32>(0, 1);
    let found = differs(at, at - x) || differs(at, at + x) || differs(at, at - y) || differs(at, at + y);
    textureStore(mask, at, vec4<u32>(select(0u, 1u, found)));
}
