// Directions and spherical harmonics. Twin of sphere.rs.

// Two axes that make an orthonormal frame with the unit vector `n` (Duff et al. 2017).
struct Axes {
    a: vec3<f32>,
    b: vec3<f32>,
}

fn frame(n: vec3<f32>) -> Axes {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return Axes(vec3<f32>(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3<f32>(b, s + n.y * n.y * a, -n.y));
}

// Factor of the associated Legendre recurrence in its normalised form.
fn sh_ratio(l: f32, m: f32) -> f32 {
    return sqrt((4.0 * l * l - 1.0) / (l * l - m * m));
}

// One step of the recurrences of real spherical harmonics in l, for one m: the harmonic less its factor of
// `power`.
struct Harmonic {
    value: f32,
    before: f32,
    // `sh_ratio` of this l and m.
    ratio: f32,
}

// The diagonal harmonic of m, l = m, from that of m - 1; any number will do for m = 0.
fn harmonic_diagonal(before: f32, m: u32) -> f32 {
    let mf = f32(m);
    return select(before * sqrt((2.0 * mf + 1.0) / (2.0 * mf)), sqrt(1.0 / (4.0 * PI)), m == 0u);
}

// The first harmonic of m, with the sqrt 2 of the real basis for m > 0.
fn first_harmonic(diagonal: f32, m: u32) -> Harmonic {
    return Harmonic(diagonal * select(1.0, sqrt(2.0), m > 0u), 0.0, 1.0);
}

// The harmonic of l + 1 from that of l, at a direction of this z.
fn next_harmonic(h: Harmonic, l: u32, m: u32, z: f32) -> Harmonic {
    let next = sh_ratio(f32(l) + 1.0, f32(m));
    return Harmonic(next * z * h.value - select(0.0, next / h.ratio, l > m) * h.before, h.value, next);
}

// (cos m phi, sin m phi) sin^m theta of m + 1 from that of m: Re, Im of (x + iy)^m.
fn next_power(power: vec2<f32>, w: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(power.x * w.x - power.y * w.y, power.x * w.y + power.y * w.x);
}
