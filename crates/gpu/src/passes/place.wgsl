// Draws for each pixel the place and object that it sees, their face and distance. Outlines are found in
// these.

struct Surface {
    @location(0) place: vec4<f32>,
    @location(1) face: vec4<f32>,
}

@fragment
fn place(in: Varying) -> Surface {
    let triangle = triangles[in.triangle];
    let ray = view.corner + view.right * in.pixel.x + view.down * in.pixel.y;
    let face = select(1.0, -1.0, dot(triangle.face.xyz, ray) > 0.0) * triangle.face.xyz;
    let distance = length(in.position - view.eye);
    return Surface(vec4<f32>(in.position, triangle.face.w), vec4<f32>(face, distance));
}
