// Tessellation: points and triangles of patches, and heights. Twin of `expand` in tessellation.rs.

// A triangle of the base mesh and how it is cut; as `Patch`.
struct Patch {
    triangle: u32,
    // Segments on a side of its grid.
    segments: u32,
    // Segments that its edges show.
    first_edge: u32,
    second_edge: u32,
    third_edge: u32,
    // Points and triangles in the patches before.
    first_point: u32,
    first_triangle: u32,
}

// Nearest point of an edge of `segments` that shows fewer.
fn moved(k: u32, segments: u32, edge: u32) -> u32 {
    let ratio = segments / edge;
    return (k + ratio / 2u) / ratio * ratio;
}

// Weights of a patch's corners at a point of its grid: row `r` from the first corner on, and `c` along it.
fn weights(patch_: Patch, r: u32, c: u32) -> vec3<f32> {
    let n = patch_.segments;
    var w = vec3<u32>(n - r, r - c, c);
    if c == 0u {
        let k = moved(r, n, patch_.first_edge);
        w = vec3<u32>(n - k, k, 0u);
    } else if c == r {
        let k = moved(r, n, patch_.third_edge);
        w = vec3<u32>(n - k, 0u, k);
    } else if r == n {
        let k = moved(c, n, patch_.second_edge);
        w = vec3<u32>(0u, n - k, k);
    }
    return vec3<f32>(w) / f32(n);
}

// Row and column of a point of a grid from its number.
fn point_of(i: u32) -> vec2<u32> {
    var row = u32((sqrt(8.0 * f32(i) + 1.0) - 1.0) / 2.0);
    if (row + 1u) * (row + 2u) / 2u <= i {
        row += 1u;
    }
    if row * (row + 1u) / 2u > i {
        row -= 1u;
    }
    return vec2<u32>(row, i - row * (row + 1u) / 2u);
}

// The corners of a grid's triangle, as numbers of points.
fn corners_of(i: u32) -> vec3<u32> {
    var row = u32(sqrt(f32(i)));
    if (row + 1u) * (row + 1u) <= i {
        row += 1u;
    }
    if row * row > i {
        row -= 1u;
    }
    let k = i - row * row;
    let above = row * (row + 1u) / 2u + k / 2u;
    let below = (row + 1u) * (row + 2u) / 2u + k / 2u;
    return select(vec3<u32>(above, below + 1u, above + 1u), vec3<u32>(above, below, below + 1u), k % 2u == 0u);
}
