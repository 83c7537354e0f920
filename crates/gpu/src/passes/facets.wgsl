// Works out the triangles of displaced meshes from their points: one invocation for each. Twin of
// `triangle` in geometry.rs.

@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read_write> corners: array<u32>;
@group(0) @binding(4) var<storage, read_write> triangles: array<Triangle>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x + id.y * ROW;
    if i >= cut.triangles {
        return;
    }
    let patch_ = patch_with(i, false);
    let t = corners_of(i - patch_.first_triangle) + cut.first_point + patch_.first_point;
    let at = cut.first_triangle + i;
    corners[3u * at] = t.x;
    corners[3u * at + 1u] = t.y;
    corners[3u * at + 2u] = t.z;
    let a = vertices[t.x];
    let b = vertices[t.y];
    let c = vertices[t.z];
    let p = b.position_u.xyz - a.position_u.xyz;
    let q = c.position_u.xyz - a.position_u.xyz;
    let du = vec2<f32>(b.position_u.w, c.position_u.w) - a.position_u.w;
    let dv = vec2<f32>(b.normal_v.w, c.normal_v.w) - a.normal_v.w;
    let normal = cross(p, q);
    let square = dot(normal, normal);
    if square <= 0.0 {
        // The points of an edge have moved together: the triangle is drawn nowhere.
        triangles[at] = Triangle(vec4<f32>(0.0, 1.0, 0.0, f32(cut.object)), vec4<f32>(0.0, 0.0, 0.0, 1.0), vec4<f32>(0.0));
        return;
    }
    // The weights of the second and third corner grow along these.
    let s = cross(q, normal) / square;
    let u = cross(normal, p) / square;
    triangles[at] = Triangle(
        vec4<f32>(normal * inverseSqrt(square), f32(cut.object)),
        vec4<f32>(s * du.x + u * du.y, 1.0),
        vec4<f32>(s * dv.x + u * dv.y, 0.0),
    );
}
