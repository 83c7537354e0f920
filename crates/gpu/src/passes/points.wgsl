// Works out the points of displaced meshes: one invocation for each.

@group(0) @binding(2) var<storage, read> base_vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> base_corners: array<u32>;
@group(0) @binding(4) var<storage, read> heights: array<f32>;
@group(0) @binding(5) var<storage, read_write> vertices: array<Vertex>;

// The two texels beside a place on an axis, and the share of the second.
fn beside(t: f32, n: u32, repeat: bool) -> vec3<f32> {
    let at = t * f32(n) - 0.5;
    let first = floor(at);
    let last = f32(n) - 1.0;
    if repeat {
        var low = first - f32(n) * floor(first / f32(n));
        // Division may be off by its last digit.
        low = select(low, low - f32(n), low > last);
        low = select(low, low + f32(n), low < 0.0);
        return vec3<f32>(low, select(low + 1.0, 0.0, low + 1.0 > last), at - first);
    }
    return vec3<f32>(clamp(first, 0.0, last), clamp(first + 1.0, 0.0, last), at - first);
}

// A bilinear look-up on a level that begins at `offset`.
fn bilinear(uv: vec2<f32>, size: vec2<u32>, offset: u32) -> f32 {
    let x = beside(uv.x, size.x, (cut.repeat & 1u) != 0u);
    let y = beside(uv.y, size.y, (cut.repeat & 2u) != 0u);
    let rows = vec2<u32>(y.xy) * size.x + offset;
    let columns = vec2<u32>(x.xy);
    let above = mix(heights[rows.x + columns.x], heights[rows.x + columns.y], x.z);
    let below = mix(heights[rows.y + columns.x], heights[rows.y + columns.y], x.z);
    return mix(above, below, y.z);
}

// World height at a place of the map, of the level that a length of `over` in the world asks for. Twin of
// `Displacement::height`.
fn height(uv: vec2<f32>, over: f32) -> f32 {
    let texel = cut.texture_width / f32(cut.texels.x);
    let lod = min(log2(max(over / texel, 1.0)), f32(cut.levels - 1u));
    let level = u32(lod);
    var offset = 0u;
    var size = cut.texels;
    for (var k = 0u; k < level; k++) {
        offset += size.x * size.y;
        size = max(size / 2u, vec2<u32>(1u));
    }
    let fine = bilinear(uv, size, offset);
    if level + 1u >= cut.levels {
        return fine * cut.depth;
    }
    let coarse = bilinear(uv, max(size / 2u, vec2<u32>(1u)), offset + size.x * size.y);
    return mix(fine, coarse, lod - f32(level)) * cut.depth;
}

// The direction of `v`, or `other` where `v` has none.
fn unit_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let square = dot(v, v);
    return select(other, v * inverseSqrt(max(square, 1e-30)), square > 1e-30);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x + id.y * ROW;
    if i >= cut.points {
        return;
    }
    let patch_ = patch_with(i, true);
    let at = point_of(i - patch_.first_point);
    let w = weights(patch_, at.x, at.y);
    let a = base_vertices[base_corners[3u * patch_.triangle]];
    let b = base_vertices[base_corners[3u * patch_.triangle + 1u]];
    let c = base_vertices[base_corners[3u * patch_.triangle + 2u]];
    let place = a.position_u * w.x + b.position_u * w.y + c.position_u * w.z;
    let across = a.normal_v * w.x + b.normal_v * w.y + c.normal_v * w.z;
    let normal = unit_or(across.xyz, a.normal_v.xyz);
    let uv = vec2<f32>(place.w, across.w);
    let position = place.xyz + normal * height(uv, cut.width * distance(place.xyz, cut.eye));
    let tangent = a.tangent.xyz * w.x + b.tangent.xyz * w.y + c.tangent.xyz * w.z;
    vertices[cut.first_point + i] = Vertex(
        vec4<f32>(position, uv.x),
        vec4<f32>(normal, uv.y),
        vec4<f32>(unit_or(tangent, a.tangent.xyz), a.tangent.w),
        a.stretch * w.x + b.stretch * w.y + c.stretch * w.z,
    );
}
