// Real spherical harmonics up to ORDER (Han et al. 2007, section 5). Twin of sh.rs and of `spherical_harmonics` in sphere.rs.

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
    // (cos m phi, sin m phi) sin^m theta = Re, Im of (x + iy)^m.
    var power = vec2<f32>(1.0, 0.0);
    var diagonal = sqrt(1.0 / (4.0 * PI));
    for (var m = 0u; m <= ORDER; m++) {
        let mf = f32(m);
        if m > 0u {
            diagonal *= sqrt((2.0 * mf + 1.0) / (2.0 * mf));
        }
        var before = 0.0;
        var now = diagonal * select(1.0, sqrt(2.0), m > 0u);
        var ratio = 1.0;
        for (var l = m; l <= ORDER; l++) {
            let i = l * l + l;
            let lf = f32(l);
            var g = coefficient(gamma, i + m) * power.x;
            if m > 0u {
                g += coefficient(gamma, i - m) * power.y;
            }
            sum += (*rho)[l] * now * g;
            let next = sh_ratio(lf + 1.0, mf);
            let after = next * w.z * now - select(0.0, next / ratio, l > m) * before;
            before = now;
            now = after;
            ratio = next;
        }
        power = vec2<f32>(power.x * w.x - power.y * w.y, power.x * w.y + power.y * w.x);
    }
    // What rings below zero is held there.
    return max(sum, 0.0);
}

fn effective(gamma: ptr<function, Decoded>, reflection: Reflection, gloss: f32, w: vec3<f32>) -> f32 {
    var table = reflection.table;
    var rho: array<f32, TABLE>;
    for (var l = 0u; l <= ORDER; l++) {
        rho[l] = tabulated(&table, vec2<f32>(reflection.gloss, reflection.span), l, gloss, 0.5 * f32(l * (l + 1u)));
    }
    return series(gamma, &rho, w);
}

fn effective_diffuse(gamma: ptr<function, Decoded>, reflection: Reflection, w: vec3<f32>) -> f32 {
    var table = reflection.table;
    var rho: array<f32, TABLE>;
    for (var l = 0u; l <= ORDER; l++) {
        rho[l] = tabulated_diffuse(&table, l);
    }
    return series(gamma, &rho, w);
}
