// Evaluates the twins at given inputs: `reflect_texel` as a whole, and the functions of a lobe one by one.

const HEAD: u32 = 7u;
const STRIDE: u32 = HEAD + 3u * TABLE * CHANNELS + ALL_LAYERS;

@group(0) @binding(0) var<storage, read> input: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> output: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i * STRIDE >= arrayLength(&input) {
        return;
    }
    let first = i * STRIDE;
    let a = input[first];
    let b = input[first + 1u];
    let c = input[first + 2u];
    var brdf = Brdf(a.x, u32(a.y), u32(a.z), a.w, c.w, Table());
    for (var k = 0u; k < 3u * TABLE * CHANNELS; k++) {
        brdf.table[k] = input[first + HEAD + k];
    }
    var channels: Channels;
    for (var k = 0u; k < ALL_LAYERS; k++) {
        channels[k] = input[first + HEAD + 3u * TABLE * CHANNELS + k];
    }
    let directions = directions_between(input[first + 3u].xyz, input[first + 4u].xyz);
    let plain = SurfaceParams(b.xyz, b.w, c.xyz);
    var decoded = decode(&channels);
    let light = reflect_channels(&channels, &decoded, plain, brdf, directions);
    output[3u * i] = vec4<f32>(light, facet(brdf, input[first + 5u].xyz, plain, directions).x);
    let widened = lobe_widen(a.x, b.w);
    output[3u * i + 1u] = vec4<f32>(
        lobe_evaluate(widened, input[first + 5u].z),
        lobe_variance(widened),
        lobe_masking(directions.wo.z, lobe_variance(widened)),
        lambert_evaluate(b.w, directions.wi.z),
    );
    // The same texel on a displaced surface, whose base turns its back on every other eye.
    let below = input[first + 3u].w;
    let wo = vec3<f32>(directions.wo.xy, below * directions.wo.z);
    let by = input[first + 6u];
    let seen_below = directions_between(directions.wi, wo);
    let stretch = mat2x2<f32>(by.xy, by.zw);
    var displaced = reflect_displaced(&channels, &decoded, plain, brdf, seen_below, stretch);
    for (var c = 1u; c < CHANNELS; c++) {
        turn_to_channel(c);
        displaced[c] = reflect_displaced(&channels, &decoded, plain, brdf, seen_below, stretch)[c];
    }
    turn_to_channel(0u);
    output[3u * i + 2u] = vec4<f32>(displaced, lobe_visible_area(wo.z, 0.3 + b.w));
}
