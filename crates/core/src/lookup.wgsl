// Filtered look-ups of a map's layers. Twin of lookup.rs.
//
// Levels are mixed here, between two look-ups at whole levels: that is the same on every device, which a
// sampler's own choice and mix of levels is not.

// Footprint of a pixel: where it falls on the map, and how far it reaches.
struct PixelFootprint {
    // Centre of the pixel, 0..1 over the map, v down the rows.
    uv: vec2<f32>,
    // Change of `uv` to the next pixel on the right.
    duv_dx: vec2<f32>,
    // Change of `uv` to the next pixel below.
    duv_dy: vec2<f32>,
}

// Width of a filter, in taps and levels.
struct Filtering {
    // Taps along the longer axis of a pixel's reach, at most.
    max_taps: u32,
    // Parts that the reach is cut into on both axes.
    parts: u32,
    // Bias added to the level that the reach asks for.
    lod_bias: f32,
    // Number of levels.
    levels: u32,
}

// The taps that cover a pixel's reach, all of one weight.
struct Taps {
    uv: vec2<f32>,
    along: vec2<f32>,
    across: vec2<f32>,
    lod: f32,
    // Taps along the longer axis, and across it.
    columns: u32,
    rows: u32,
}

// The taps for a pixel on a map of `texels`.
fn taps(pixel: PixelFootprint, texels: vec2<f32>, filtering: Filtering) -> Taps {
    let dx = pixel.duv_dx * texels;
    let dy = pixel.duv_dy * texels;
    // Eigenvalues of J Jᵀ, whose ellipse is the image of the pixel's unit circle; their product is the square
    // of det J.
    let a = dx.x * dx.x + dy.x * dy.x;
    let b = dx.x * dx.y + dy.x * dy.y;
    let c = dx.y * dx.y + dy.y * dy.y;
    let half = (a - c) / 2.0;
    let spread = sqrt(half * half + b * b);
    let major = sqrt((a + c) / 2.0 + spread);
    let minor = abs(dx.x * dy.y - dx.y * dy.x) / max(major, 1e-20);
    // The longer axis has twice the angle whose cosine and sine are these: halved by square roots, the larger
    // first.
    var double_angle = vec2<f32>(1.0, 0.0);
    if spread > 0.0 {
        double_angle = vec2<f32>(half, b) / spread;
    }
    let larger = sqrt((1.0 + abs(double_angle.x)) / 2.0);
    let smaller = double_angle.y / (2.0 * larger);
    let axis = select(vec2<f32>(smaller, larger), vec2<f32>(larger, smaller), double_angle.x >= 0.0);
    let rows = max(filtering.parts, 1u);
    // A hundredth over is no reason for another tap: else a round pixel would have one or two by its last
    // digit.
    let wanted = min(ceil(major / max(minor, 1.0) - 0.01), 1e6);
    let columns = u32(clamp(wanted, 1.0, f32(max(filtering.max_taps, 1u)))) * rows;
    let lod = log2(max(max(major / f32(columns), minor / f32(rows)), 1.0)) + filtering.lod_bias;
    let along = axis * major / texels;
    let across = vec2<f32>(-axis.y, axis.x) * minor / texels;
    return Taps(pixel.uv, along, across, clamp(lod, 0.0, f32(filtering.levels - 1u)), columns, rows);
}

// Place of tap i.
fn tap(taps: Taps, i: u32) -> vec2<f32> {
    let s = (f32(i / taps.rows) + 0.5) / f32(taps.columns) - 0.5;
    let t = (f32(i % taps.rows) + 0.5) / f32(taps.rows) - 0.5;
    return taps.uv + taps.along * s + taps.across * t;
}

// A trilinear look-up of one layer.
fn trilinear(map: texture_2d_array<f32>, linear: sampler, uv: vec2<f32>, layer: u32, lod: f32) -> vec4<f32> {
    let level = floor(lod);
    let t = lod - level;
    let finer = textureSampleLevel(map, linear, uv, layer, level);
    if t == 0.0 {
        return finer;
    }
    return mix(finer, textureSampleLevel(map, linear, uv, layer, level + 1.0), t);
}

// The two texels beside a place on one axis of `n` texels, and the share of the second.
struct Pair {
    first: i32,
    second: i32,
    share: f32,
}

fn pair(t: f32, n: u32, repeat: bool) -> Pair {
    let count = i32(n);
    let at = t * f32(n) - 0.5;
    let low = floor(at);
    // Whole turns are taken off in floats, so that no place is too far away for whole numbers.
    let turns = select(0.0, floor(low / f32(n)), repeat);
    let first = i32(clamp(round(low - turns * f32(n)), -1.0, f32(n)));
    if repeat {
        return Pair((first + count) % count, (first + 1 + count) % count, at - low);
    }
    return Pair(clamp(first, 0, count - 1), clamp(first + 1, 0, count - 1), at - low);
}

// Levels of a map, which go down to one texel. (OpenGL ES 3.0 cannot be asked.)
fn level_count(finest: vec2<u32>) -> u32 {
    var levels = 1u;
    for (var side = max(finest.x, finest.y); side > 1u; side >>= 1u) {
        levels++;
    }
    return levels;
}

// Texel that a filter reads; shares sum to one.
struct Neighbour {
    texel: vec2<i32>,
    level: u32,
    weight: f32,
}

// Texel i of the eight that a trilinear filter mixes. At the coarsest level the last four have no share, and
// are not there.
fn neighbour(map: texture_2d_array<f32>, uv: vec2<f32>, lod: f32, repeat: vec2<bool>, i: u32) -> Neighbour {
    let coarser = i / 4u;
    let level = u32(floor(lod)) + coarser;
    let share = select(1.0 - fract(lod), fract(lod), coarser == 1u);
    // Where the level differs from pixel to pixel, lavapipe answers with the size of another pixel's level.
    let size = max(textureDimensions(map) >> vec2<u32>(level), vec2<u32>(1u));
    let x = pair(uv.x, size.x, repeat.x);
    let y = pair(uv.y, size.y, repeat.y);
    let right = (i & 1u) == 1u;
    let below = (i & 2u) == 2u;
    let texel = vec2<i32>(select(x.first, x.second, right), select(y.first, y.second, below));
    let weight = select(1.0 - x.share, x.share, right) * select(1.0 - y.share, y.share, below);
    return Neighbour(texel, level, weight * share);
}
