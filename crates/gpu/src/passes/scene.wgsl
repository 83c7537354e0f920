// Common part of the passes that draw: the camera, the lights, the triangles, and the surface under a pixel.
//
// Vertices are pulled from storage, so that a fragment knows its whole triangle: its face, and how the place
// on the map moves in its plane. The twin is `Geometry` of the CPU renderer: both must see alike.

struct View {
    // Clip space from a place relative to the eye.
    clip: mat4x4<f32>,
    // Origin of the rays, like all places relative to the scene's middle.
    eye: vec3<f32>,
    // Number of lights.
    lights: u32,
    // The ray through a place (x, y) in the picture is corner + x right + y down.
    corner: vec3<f32>,
    // Width of the area that is shaded, in pixels.
    width: f32,
    right: vec3<f32>,
    seed: u32,
    down: vec3<f32>,
    // 1 to draw only where `mask` is not 0.
    masked: u32,
    // The filter, as `Filtering` has it.
    max_taps: u32,
    parts: u32,
    lod_bias: f32,
    // The most light that the target can hold.
    brightest: f32,
}

struct Light {
    // Unit vector to the light (w = 0), or its position (w = 1).
    place: vec4<f32>,
    // Irradiance on a plane that faces it, or radiant intensity. w = 1: of an environment, whose light
    // normals see from below the base surface, too.
    power: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> lights: array<Light>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> corners: array<u32>;
@group(0) @binding(4) var<storage, read> triangles: array<Triangle>;

@group(0) @binding(5) var mask: texture_2d<u32>;

// True where nothing is to be drawn.
fn masked_out(pixel: vec4<f32>) -> bool {
    return view.masked == 1u && textureLoad(mask, vec2<i32>(pixel.xy), 0).x == 0u;
}

struct Varying {
    @builtin(position) pixel: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) tangent: vec3<f32>,
    @location(3) uv: vec2<f32>,
    @location(4) @interpolate(flat) bitangent_sign: f32,
    @location(5) @interpolate(flat) triangle: u32,
    @location(6) stretch: vec4<f32>,
}

@vertex
fn project(@builtin(vertex_index) i: u32) -> Varying {
    let v = vertices[corners[i]];
    let first = vertices[corners[i - i % 3u]];
    let clip = view.clip * vec4<f32>(v.position_u.xyz - view.eye, 1.0);
    let uv = vec2<f32>(v.position_u.w, v.normal_v.w);
    return Varying(clip, v.position_u.xyz, v.normal_v.xyz, v.tangent.xyz, uv, first.tangent.w, i / 3u, v.stretch);
}

// Surface under a pixel.
struct Place {
    position: vec3<f32>,
    // Tangent, bitangent, normal as columns; the normal faces the eye.
    frame: mat3x3<f32>,
    // Unit vector to the eye, in that frame.
    wo: vec3<f32>,
    uv: vec2<f32>,
    // Change of uv to the next pixel on the right, and below.
    duv_dx: vec2<f32>,
    duv_dy: vec2<f32>,
    // True on a displaced mesh; `stretch` then takes slopes of the map to the frame.
    displaced: bool,
    stretch: mat2x2<f32>,
}

// Least cosine between a place's normal and the eye.
const LEAST_FACING: f32 = 1e-3;

fn reject(v: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    return v - n * dot(v, n);
}

// Change of the place as the pixel moves by `step` (Igehy 1999).
fn differential(step: vec3<f32>, ray: vec3<f32>, face: vec3<f32>, distance: f32) -> vec3<f32> {
    let along = dot(ray, face);
    let held = select(along, 1e-9, abs(along) < 1e-9);
    return distance * inverseSqrt(dot(ray, ray)) * (step - ray * (dot(step, face) / held));
}

// `unbent`: displaced facets are shaded where the base mesh turns its back, too.
fn place_of(in: Varying, unbent: bool) -> Place {
    let triangle = triangles[in.triangle];
    let ray = view.corner + view.right * in.pixel.x + view.down * in.pixel.y;
    let direction = normalize(ray);
    let side = select(1.0, -1.0, dot(triangle.face.xyz, direction) > 0.0);
    var normal = normalize(in.normal) * side;
    // An interpolated normal that has turned away from the eye is bent back until it just faces it.
    let facing = -dot(normal, direction);
    let displaced = triangle.grad_u.w == 1.0;
    if facing < LEAST_FACING && !(unbent && displaced) {
        normal = normalize(normal - direction * (LEAST_FACING - facing));
    }
    let across = reject(in.tangent, normal);
    var tangent = normalize(across);
    if dot(across, across) < 1e-12 {
        tangent = normalize(reject(select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(normal.x) > 0.5), normal));
    }
    let axes = mat3x3<f32>(tangent, cross(normal, tangent) * in.bitangent_sign, normal);
    let distance = length(in.position - view.eye);
    let dx = differential(view.right, ray, triangle.face.xyz, distance) * view.width;
    let dy = differential(view.down, ray, triangle.face.xyz, distance) * view.width;
    return Place(
        in.position,
        axes,
        -direction * axes,
        in.uv,
        vec2<f32>(dot(triangle.grad_u.xyz, dx), dot(triangle.grad_v.xyz, dx)),
        vec2<f32>(dot(triangle.grad_u.xyz, dy), dot(triangle.grad_v.xyz, dy)),
        displaced,
        // Seen from behind, bumps are hollows, along the turned frame.
        mat2x2<f32>(side * in.stretch.x, in.stretch.y, side * in.stretch.z, in.stretch.w),
    );
}

// A light as a place sees it: unit vector to it in the tangent frame, and its irradiance.
struct IncidentLight {
    wi: vec3<f32>,
    irradiance: vec3<f32>,
    from_below: bool,
}

fn seen_from(place: Place, i: u32) -> IncidentLight {
    let light = lights[i];
    if light.place.w == 0.0 {
        return IncidentLight(light.place.xyz * place.frame, light.power.xyz, light.power.w == 1.0);
    }
    let to_light = light.place.xyz - place.position;
    let square = max(dot(to_light, to_light), 1e-12);
    return IncidentLight(to_light * inverseSqrt(square) * place.frame, light.power.xyz / square, false);
}
