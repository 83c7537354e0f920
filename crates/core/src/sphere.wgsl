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
