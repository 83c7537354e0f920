// Vertices and triangles as they lie in buffers: written by the passes that cut meshes, or from the CPU, and
// read by those that draw.

struct Vertex {
    // Position relative to the scene's middle, and uv.x.
    position_u: vec4<f32>,
    // Unit normal, and uv.y.
    normal_v: vec4<f32>,
    // Unit tangent, and the sign of the bitangent.
    tangent: vec4<f32>,
    // With relief, how slopes of the map lie on the surface, by columns.
    stretch: vec4<f32>,
}

struct Triangle {
    // Unit normal, and the object.
    face: vec4<f32>,
    // How u and v change with the place; the first has a 1 on a mesh with relief.
    grad_u: vec4<f32>,
    grad_v: vec4<f32>,
}
