// A function of direction on the six faces of a cube, at several widths. Twin of cube.rs.

// A place on a face: s to the right, t down, both from -1 to 1.
struct CubePlace {
    face: u32,
    at: vec2<f32>,
}

// Face that a direction goes through, and the place on it.
fn cube_place(w: vec3<f32>) -> CubePlace {
    let a = abs(w);
    if a.x >= a.y && a.x >= a.z {
        if w.x > 0.0 {
            return CubePlace(0u, vec2<f32>(-w.z, -w.y) / a.x);
        }
        return CubePlace(1u, vec2<f32>(w.z, -w.y) / a.x);
    }
    if a.y >= a.z {
        if w.y > 0.0 {
            return CubePlace(2u, vec2<f32>(w.x, w.z) / a.y);
        }
        return CubePlace(3u, vec2<f32>(w.x, -w.z) / a.y);
    }
    if w.z > 0.0 {
        return CubePlace(4u, vec2<f32>(w.x, -w.y) / a.z);
    }
    return CubePlace(5u, vec2<f32>(-w.x, -w.y) / a.z);
}

// The function at a place of a level, mixed from the four texels around it. The level has `side` texels on a
// side, and its outermost texels lie on the face's edges.
fn cube_bilinear(cube: texture_2d_array<f32>, linear: sampler, place: CubePlace, level: f32, side: f32) -> vec3<f32> {
    let uv = ((place.at + 1.0) * 0.5 * (side - 1.0) + 0.5) / side;
    return textureSampleLevel(cube, linear, uv, place.face, level).xyz;
}

// The function in a direction, mixed between two levels; `lod` is held to the levels that exist. `size` has
// the texels on a side of the finest level, and the number of levels.
fn cube_lookup(cube: texture_2d_array<f32>, linear: sampler, w: vec3<f32>, lod: f32, size: vec2<f32>) -> vec3<f32> {
    let held = clamp(lod, 0.0, size.y - 1.0);
    let level = floor(held);
    let place = cube_place(w);
    let below = cube_bilinear(cube, linear, place, level, size.x * exp2(-level));
    if held == level {
        return below;
    }
    return mix(below, cube_bilinear(cube, linear, place, level + 1.0, size.x * exp2(-level - 1.0)), held - level);
}
