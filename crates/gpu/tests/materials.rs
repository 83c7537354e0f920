//! Exported shaders for materials, on the device: a sharp lobe is the renderer's own light, and a wide one is
//! near the mean over its normals.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::f64::consts::{PI, TAU};

use common::device;
use glam::{DVec3, Vec3};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_gpu::Device;
use ndfmap_gpu::export::{CONVENTIONS, Convention, Export, Shading, TABLE};

/// A lobe of normals, a metal and a light.
#[derive(Clone, Copy, Debug)]
struct Probe {
    normal: DVec3,
    variance: f64,
    alpha: f64,
    f0: DVec3,
    wi: DVec3,
    wo: DVec3,
}

/// Entry that evaluates `ndf_shade` for a lobe of each probe.
const ENTRY: &str = "
@group(0) @binding(0) var<storage, read> input: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> output: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 64u;
    if i * 4u >= arrayLength(&input) {
        return;
    }
    let a = input[4u * i];
    let b = input[4u * i + 1u];
    var lobes: NdfLobes;
    lobes.lobe[0] = NdfLobe(a.xyz, 1.0, a.w, vec3<f32>(0.0), vec3<f32>(0.0));
    let material = NdfMaterial(vec3<f32>(0.0), input[4u * i + 3u].xyz, b.w);
    output[i] = vec4<f32>(ndf_shade(lobes, material, b.xyz, input[4u * i + 2u].xyz), ndf_room_level(sqrt(b.w), 8.0));
}
";

/// Light of each probe, by the exported shader, and the level of a cube of eight that its roughness reads.
fn shaded(device: &Device, convention: &Convention, probes: &[Probe]) -> Vec<(DVec3, f64)> {
    let method = "vmf:1".parse::<AnyMethod>().unwrap();
    let shading = Shading::Materials { convention, attributes: 0, from_level: 0 };
    let wgsl = TABLE.iter().find(|row| row.name == "wgsl").unwrap();
    let library = Export { method: &*method, shading, compact: None }.to(wgsl).unwrap();
    let input: Vec<[f32; 4]> = probes
        .iter()
        .flat_map(|p| {
            let four = |v: DVec3, w: f64| v.as_vec3().extend(w as f32).to_array();
            [four(p.normal, p.variance), four(p.wi, p.alpha), four(p.wo, 0.0), four(p.f0, 0.0)]
        })
        .collect();
    let bytes = (16 * probes.len()) as u64;
    let text = String::from_utf8(library).unwrap() + ENTRY;
    let output = device.compute(&text, bytemuck::cast_slice(&input), bytes, probes.len() as u32).unwrap();
    let lights: &[[f32; 4]] = bytemuck::cast_slice(&output);
    lights
        .iter()
        .map(|light| (Vec3::new(light[0], light[1], light[2]).as_dvec3(), f64::from(light[3])))
        .collect()
}

/// Unit vector at these angles from the surface's normal and around it.
fn at(polar: f64, azimuth: f64) -> DVec3 {
    DVec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
}

/// Directions of light and eye, widths and reflectances of many kinds.
fn probes(variances: &[f64]) -> Vec<Probe> {
    let mut probes = Vec::new();
    for variance in variances {
        for (k, alpha) in [0.04, 0.09, 0.25, 0.6].into_iter().enumerate() {
            for i in 0..12 {
                let i = f64::from(i);
                probes.push(Probe {
                    normal: at(0.1 * (i % 4.0), 1.3 * i),
                    variance: *variance,
                    alpha,
                    f0: DVec3::new(0.95, 0.3 + 0.1 * k as f64, 0.04),
                    wi: at(0.3 + 0.08 * i, 0.7 * i),
                    wo: at(0.35 + 0.06 * i, 0.7 * i + PI + 0.03 * i),
                });
            }
        }
    }
    probes
}

/// Scale and bias under even light, by Karis' polynomial (2014).
fn split_sum(roughness: f64, cosine: f64) -> (f64, f64) {
    let r =
        [-roughness + 1.0, -0.0275 * roughness + 0.0425, -0.572 * roughness + 1.04, 0.022 * roughness - 0.04];
    let a = (r[0] * r[0]).min((-9.28 * cosine).exp2()) * r[0] + r[1];
    (-1.04 * a + r[2], 1.04 * a + r[3])
}

/// Mirrored light of a renderer by one normal, as its own shader has it.
fn sharp(name: &str, p: &Probe, n: DVec3) -> DVec3 {
    let h = (p.wi + p.wo).normalize();
    let (incident, seen) = (n.dot(p.wi).clamp(0.0, 1.0), n.dot(p.wo).clamp(1e-4, 1.0));
    // Babylon adds to the width that a material has.
    let a = if name == "babylon" { p.alpha + 0.0005 } else { p.alpha };
    let (c, u) = (n.dot(h).clamp(0.0, 1.0), p.wo.dot(h).clamp(0.0, 1.0));
    let d = a * a / (PI * (c * c * (a * a - 1.0) + 1.0).powi(2));
    let smith = || {
        let g = |x: f64, y: f64| x * (y * y * (1.0 - a * a) + a * a).sqrt();
        0.5 / (g(incident, seen) + g(seen, incident))
    };
    let schlick = |f90: f64| p.f0 + (DVec3::splat(f90) - p.f0) * (1.0 - u).powi(5);
    let passed_on = || {
        let (scale, bias) = split_sum(a.sqrt(), seen);
        1.0 + p.f0 * (1.0 / (scale + bias) - 1.0)
    };
    let (v, f) = match name {
        "plain" => (smith(), schlick(1.0)),
        "three" => {
            let rest = (2.0_f64).powf((-5.55473 * u - 6.98316) * u);
            (smith(), (p.f0 * (1.0 - rest) + rest) * passed_on())
        }
        "babylon" => (smith(), schlick(1.0) * passed_on()),
        "bevy" => (smith(), schlick((16.5 * p.f0.element_sum()).min(1.0)) * passed_on()),
        "godot" => {
            let v = 0.5 / ((1.0 - a) * 2.0 * incident * seen + a * (incident + seen));
            (v, schlick((16.5 * p.f0.element_sum()).min(1.0)))
        }
        "unity" => (0.25 / ((u * u).max(0.1) * (a + 0.5)), p.f0),
        "unreal" => {
            let g = |x: f64, y: f64| x * (y * (1.0 - a) + a);
            (0.5 / (g(incident, seen) + g(seen, incident)), schlick((50.0 * p.f0.y).min(1.0)))
        }
        other => panic!("`{other}` has no formula here"),
    };
    incident * d * v * f
}

/// Level of a cube of eight, of which a roughness is looked up.
fn room_level(name: &str, roughness: f64) -> f64 {
    let level = match name {
        "plain" | "bevy" => 7.0 * roughness,
        "three" => 7.0 * roughness * (2.0 - roughness),
        "babylon" => 0.8 * (128.0 * roughness * roughness).log2(),
        "godot" => 7.0 * roughness.sqrt(),
        "unity" => 7.0 * roughness * (1.7 - 0.7 * roughness),
        "unreal" => 6.0 + 1.2 * roughness.log2(),
        other => panic!("`{other}` has no level here"),
    };
    level.clamp(0.0, 7.0)
}

#[test]
fn a_sharp_lobe_is_the_renderers_own_light() {
    let Some(device) = device() else { return };
    let probes = probes(&[0.0]);
    for convention in CONVENTIONS {
        let lights = shaded(&device, convention, &probes);
        for (probe, (light, level)) in probes.iter().zip(lights) {
            let read = room_level(convention.name, probe.alpha.sqrt());
            assert!((level - read).abs() < 1e-4, "{}: level {level} for {read}", convention.name);
            let due = sharp(convention.name, probe, probe.normal);
            // Single floats; a GGX of alpha 0.04 magnifies the error of a cosine, 1e-7, some 1e3 times.
            let off = (light - due).abs().max_element();
            assert!(
                off <= 2e-4 * due.max_element().max(1.0),
                "{} {probe:?}: {light} for {due}",
                convention.name
            );
        }
    }
}

/// Entry that shades channels of one lobe with two attributes.
const CARRIED: &str = "
@group(0) @binding(0) var<storage, read> input: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> output: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    var channels = ndf_Channels(input[0], input[1], input[2]);
    let material = NdfMaterial(vec3<f32>(0.9), vec3<f32>(0.9), 0.25);
    let wi = normalize(vec3<f32>(0.3, 0.1, 1.0));
    output[id.x] = vec4<f32>(ndf_shade(ndf_lobes_of(&channels), material, wi, normalize(vec3<f32>(-0.2, 0.4, 1.0))), 0.0);
}
";

#[test]
fn lobes_bring_their_own_colours_and_the_material_its_width() {
    let Some(device) = device() else { return };
    let method = "vmf:1".parse::<AnyMethod>().unwrap();
    let shading = Shading::Materials { convention: &CONVENTIONS[0], attributes: 2, from_level: 0 };
    let wgsl = TABLE.iter().find(|row| row.name == "wgsl").unwrap();
    let library = Export { method: &*method, shading, compact: None }.to(wgsl).unwrap();
    // A lobe of weight a half and no width, whose attributes are stored times its weight; the fourth channel
    // of a picture of three is 1.
    let (matt, f0) = (DVec3::new(0.2, 0.4, 0.6), DVec3::new(0.3, 0.1, 0.5));
    let half = |v: DVec3| (0.5 * v).as_vec3().extend(0.5).to_array();
    let input = [[0.5, 0.0, 0.0, 0.0], half(matt), half(f0)];
    let text = String::from_utf8(library).unwrap() + CARRIED;
    let output = device.compute(&text, bytemuck::cast_slice(&input), 16, 1).unwrap();
    let light: &[[f32; 4]] = bytemuck::cast_slice(&output);
    let probe = Probe {
        normal: DVec3::Z,
        variance: 0.0,
        alpha: 0.25,
        f0,
        wi: DVec3::new(0.3, 0.1, 1.0).normalize(),
        wo: DVec3::new(-0.2, 0.4, 1.0).normalize(),
    };
    let due = sharp("plain", &probe, DVec3::Z) + matt * probe.wi.z / PI;
    let off = (Vec3::new(light[0][0], light[0][1], light[0][2]).as_dvec3() - due).abs().max_element();
    // Single floats.
    assert!(off < 1e-5, "{light:?} for {due}");
}

/// Mean light over a lobe's normals, of von Mises and Fisher, by a fine grid.
fn mean(name: &str, p: &Probe) -> DVec3 {
    let kappa = 1.0 / p.variance;
    let (x, y) = p.normal.any_orthonormal_pair();
    let (rings, around) = (240, 96);
    let mut sum = DVec3::ZERO;
    for i in 0..rings {
        // Equal shares of the lobe: its distribution over the cosine, inverted.
        let share = (f64::from(i) + 0.5) / f64::from(rings);
        let cosine = 1.0 + (share + (1.0 - share) * (-2.0 * kappa).exp()).ln() / kappa;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        for k in 0..around {
            let turn = TAU * (f64::from(k) + 0.5) / f64::from(around);
            sum += sharp(name, p, cosine * p.normal + sine * (turn.cos() * x + turn.sin() * y));
        }
    }
    sum / f64::from(rings * around)
}

#[test]
fn a_wide_lobe_is_near_the_mean_over_its_normals() {
    let Some(device) = device() else { return };
    for convention in CONVENTIONS {
        for variance in [0.003, 0.01, 0.03] {
            let probes = probes(&[variance]);
            let due: Vec<DVec3> = probes.iter().map(|probe| mean(convention.name, probe)).collect();
            let relative = |lights: Vec<DVec3>| {
                let off: f64 =
                    lights.iter().zip(&due).map(|(light, due)| (*light - *due).length_squared()).sum();
                (off / due.iter().map(|due| due.length_squared()).sum::<f64>()).sqrt()
            };
            let ours =
                relative(shaded(&device, convention, &probes).into_iter().map(|(light, _)| light).collect());
            let alone: Vec<DVec3> = probes.iter().map(|p| sharp(convention.name, p, p.normal)).collect();
            // Measured: 0.099 to 0.152, where the mean normal alone is off by 1.3 to 5.9.
            assert!(ours < 0.16, "{} {variance}: {ours}", convention.name);
            assert!(
                relative(alone) > 1.2,
                "{} {variance}: the lobes are too narrow to tell",
                convention.name
            );
        }
    }
}
