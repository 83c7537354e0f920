// Vertices and triangles as they lie in buffers. The passes that cut meshes, or the CPU, write them; those
// that draw read them.

struct Vertex {
    // Position relative to the scene's middle, and uv.x.
    position_u: vec4<f32>,
    // Unit normal, and uv.y.
    normal_v: vec4<f32>,
    // Unit tangent, and the sign of the bitangent.
    tangent: vec4<f32>,
    // Matrix that takes slopes of the map to the surface, by columns, on a displaced mesh.
    stretch: vec4<f32>,
}

struct Triangle {
    // Unit normal, and the object.
    face: vec4<f32>,
    // Gradients of u and v over places; the first has a 1 on a displaced mesh.
    grad_u: vec4<f32>,
    grad_v: vec4<f32>,
}
