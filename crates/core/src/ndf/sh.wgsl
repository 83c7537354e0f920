// Real spherical harmonics up to ORDER (Han et al. 2007, section 5). Twin of sh.rs and of
// `spherical_harmonics` in sphere.rs.

alias Decoded = Channels;

fn decode(channels: ptr<function, Channels>) -> Decoded {
    return *channels;
}

fn coefficient(gamma: ptr<function, Decoded>, i: u32) -> f32 {
    return (*gamma)[i / 4u][i % 4u];
}

fn mean_normal(gamma: ptr<function, Decoded>) -> vec3<f32> {
    let y = (*gamma)[0];
    return vec3<f32>(y.w, y.y, y.z) * sqrt(4.0 * PI / 3.0);
}

// The series, for the zonal coefficients of a lobe.
fn series(gamma: ptr<function, Decoded>, rho: ptr<function, array<f32, TABLE>>, w: vec3<f32>) -> f32 {
    var sum = 0.0;
    var power = vec2<f32>(1.0, 0.0);
    var diagonal = 0.0;
    for (var m = 0u; m <= ORDER; m++) {
        diagonal = harmonic_diagonal(diagonal, m);
        var h = first_harmonic(diagonal, m);
        for (var l = m; l <= ORDER; l++) {
            let i = l * l + l;
            var g = coefficient(gamma, i + m) * power.x;
            if m > 0u {
                g += coefficient(gamma, i - m) * power.y;
            }
            sum += (*rho)[l] * h.value * g;
            h = next_harmonic(h, l, m, w.z);
        }
        power = next_power(power, w);
    }
    // Ringing below zero is clamped to zero.
    return max(sum, 0.0);
}

fn effective(gamma: ptr<function, Decoded>, brdf: Brdf, roughness: f32, w: vec3<f32>) -> f32 {
    var table = brdf.table;
    var rho: array<f32, TABLE>;
    for (var l = 0u; l <= ORDER; l++) {
        rho[l] = tabulated(&table, vec2<f32>(brdf.roughness, brdf.span), l, roughness, 0.5 * f32(l * (l + 1u)));
    }
    return series(gamma, &rho, w);
}

fn effective_diffuse(gamma: ptr<function, Decoded>, brdf: Brdf, w: vec3<f32>) -> f32 {
    var table = brdf.table;
    var rho: array<f32, TABLE>;
    for (var l = 0u; l <= ORDER; l++) {
        rho[l] = tabulated_diffuse(&table, l);
    }
    return series(gamma, &rho, w);
}
