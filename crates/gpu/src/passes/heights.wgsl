// Common part of the passes that cut displaced meshes. Heights lie in a buffer, level after level.

struct Cut {
    // Position of the eye, relative to the scene's middle.
    eye: vec3<f32>,
    // World width that heights are taken at, at distance 1.
    width: f32,
    // Texels of the finest heights.
    texels: vec2<u32>,
    levels: u32,
    // Axes that repeat: 1 the first, 2 the second.
    repeat: u32,
    // World length of a height of one texture width.
    depth: f32,
    // Patches, points and triangles.
    patches: u32,
    points: u32,
    triangles: u32,
    // Points and triangles of the meshes before.
    first_point: u32,
    first_triangle: u32,
    // The object's number, from 1.
    object: u32,
    // World length of a texture width on the mesh.
    texture_width: f32,
}

@group(0) @binding(0) var<uniform> cut: Cut;
@group(0) @binding(1) var<storage, read> patches: array<Patch>;

// The patch that has the point, or the triangle, of this number.
fn patch_with(i: u32, of_points: bool) -> Patch {
    var low = 0u;
    var high = cut.patches;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if select(patches[middle].first_triangle, patches[middle].first_point, of_points) <= i {
            low = middle;
        } else {
            high = middle;
        }
    }
    return patches[low];
}
