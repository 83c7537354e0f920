//! A horned lizard of our own making on sand, several maps on it, its skin drying: after Han et al. 2007,
//! figure 8.

use glam::{DVec2, DVec3, Vec3};

use super::desert::rolling;
use super::sphere::ball;
use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, brdf, sun};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// Catmull-Rom through `points`, at t from 0 to 1.
fn spline(points: &[(DVec3, f64)], t: f64) -> (DVec3, f64) {
    let last = points.len() - 1;
    let at = t.clamp(0.0, 1.0) * last as f64;
    let i = (at as usize).min(last - 1);
    let u = at - i as f64;
    let p = |k: isize| points[(i as isize + k).clamp(0, last as isize) as usize];
    let (a, b, c, d) = (p(-1), p(0), p(1), p(2));
    let mix = |a: f64, b: f64, c: f64, d: f64| {
        b + 0.5 * u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a)))
    };
    let place = DVec3::new(
        mix(a.0.x, b.0.x, c.0.x, d.0.x),
        mix(a.0.y, b.0.y, c.0.y, d.0.y),
        mix(a.0.z, b.0.z, c.0.z, d.0.z),
    );
    (place, mix(a.1, b.1, c.1, d.1).max(0.004))
}

/// Body from the tip of the tail to the nose: places and radii.
const BODY: [([f64; 3], f64); 12] = [
    ([-2.7, 0.1, 0.75], 0.01),
    ([-2.2, 0.14, 0.5], 0.07),
    ([-1.7, 0.22, 0.15], 0.12),
    ([-1.2, 0.33, -0.05], 0.19),
    ([-0.7, 0.47, -0.06], 0.3),
    ([-0.2, 0.52, 0.0], 0.38),
    ([0.3, 0.53, 0.05], 0.37),
    ([0.75, 0.58, 0.06], 0.27),
    ([1.1, 0.68, 0.02], 0.2),
    ([1.42, 0.74, -0.04], 0.25),
    ([1.72, 0.68, -0.1], 0.17),
    ([1.92, 0.63, -0.13], 0.02),
];

/// Leg on its side of the body (z = 1 or -1): hip, knee, ankle, toe.
fn leg(hip: f64, side: f64) -> Vec<(DVec3, f64)> {
    let at = |x: f64, y: f64, z: f64, r: f64| (DVec3::new(hip + x, y, side * z), r);
    vec![
        at(0.0, 0.5, 0.15, 0.14),
        at(-0.1, 0.5, 0.42, 0.13),
        at(-0.02, 0.32, 0.62, 0.09),
        at(0.1, 0.08, 0.6, 0.07),
        at(0.28, 0.03, 0.64, 0.05),
        at(0.36, 0.02, 0.66, 0.01),
    ]
}

fn objects() -> Vec<Object> {
    let tube = |points: &[(DVec3, f64)], cells, tiles, material| {
        let mesh = Mesh::from_tube(cells, tiles, |t| spline(points, t));
        Object { mesh: mesh.into(), material }
    };
    let body = BODY.map(|(p, r)| (DVec3::from(p), r));
    let mut objects = vec![tube(&body, (64, 192), DVec2::new(1.0, 2.5), 0)];
    for (hip, side) in [(0.6, 1.0), (0.6, -1.0), (-0.75, 1.0), (-0.75, -1.0)] {
        objects.push(tube(&leg(hip, side), (24, 48), DVec2::new(0.5, 1.0), 0));
    }
    // A crest of spikes along the back, and two horns.
    let horn = |root: DVec3, directions: DVec3, length: f64, width: f64| {
        let points = [
            (root - 0.3 * directions * length, width),
            (root + 0.4 * directions * length, 0.6 * width),
            (root + directions * length, 0.004),
        ];
        tube(&points, (16, 16), DVec2::new(0.25, 0.5), 1)
    };
    for i in 0..14 {
        let t = 0.2 + 0.045 * f64::from(i);
        let (middle, radius) = spline(&body, t);
        let directions = DVec3::new(-0.5, 1.0, 0.0).normalize();
        objects.push(horn(middle + DVec3::Y * radius, directions, 0.14 + 0.25 * radius, 0.045));
    }
    for side in [1.0, -1.0] {
        objects.push(horn(
            DVec3::new(1.36, 0.92, -0.03 + 0.13 * side),
            DVec3::new(-0.7, 0.8, 0.35 * side).normalize(),
            0.4,
            0.06,
        ));
        let eye = DVec3::new(1.58, 0.83, -0.07 + 0.15 * side);
        let mesh = Mesh::from_patch((24, 12), DVec2::splat(0.1), |s, t| eye + 0.055 * ball(s, t));
        objects.push(Object { mesh: mesh.into(), material: 2 });
    }
    let ground = Mesh::from_patch((96, 96), DVec2::splat(10.0), |s, t| {
        let (x, z) = ((s - 0.5) * 24.0, (0.5 - t) * 24.0);
        // Level under the feet.
        let level = 1.0 - (-(x * x + z * z) / 6.0).exp();
        DVec3::new(x, level * rolling(x, z, 0.25), z)
    });
    objects.push(Object { mesh: ground.into(), material: 3 });
    objects
}

pub(super) const ROW: Row = Row {
    name: "creature",
    summary: "a horned lizard on sand, four materials",
    animation: "its wet skin dries: the highlights widen and fade",
    build: |staging: &SceneOptions| {
        let material = |name: &str, map, params, lobe: &str| Material {
            name: name.to_owned(),
            map,
            params,
            textures: None,
            displacement: None,
            brdf: brdf(ShadingModel::Han, lobe),
        };
        let params = |diffuse: [f64; 3], specular: f64, roughness: f64| SurfaceParams {
            diffuse: diffuse.into(),
            specular: DVec3::splat(specular),
            roughness: SlopeVariance::clamped(roughness),
        };
        let dry = staging.time;
        let skin = params(
            [0.12 + 0.08 * dry, 0.2 + 0.1 * dry, 0.07 + 0.06 * dry],
            0.09 - 0.06 * dry,
            0.06 * dry * dry,
        );
        Scene {
            camera: Camera::new([3.0, 1.9, 5.6], [-0.15, 0.35, 0.0], 36.0),
            objects: objects(),
            materials: vec![
                material("skin", staging.first_map("armour"), skin, "blinn-phong:120"),
                material(
                    "horn",
                    staging.builtin("ripples"),
                    params([0.45, 0.36, 0.24], 0.06, 0.0),
                    "blinn-phong:60",
                ),
                material(
                    "eye",
                    staging.builtin("foil"),
                    params([0.02, 0.015, 0.01], 0.1, 0.0),
                    "blinn-phong:400",
                ),
                material(
                    "sand",
                    staging.builtin("dunes"),
                    params([0.62, 0.45, 0.27], 0.015, 0.0),
                    "blinn-phong:20",
                ),
            ],
            lights: vec![sun([0.5, 0.9, 0.75], [2.6, 2.45, 2.2]), sun([-0.7, 0.45, 0.25], [0.6, 0.75, 1.0])],
            environment: None,
            background: Vec3::new(0.3, 0.42, 0.58),
            exposure: 1.0,
        }
    },
};
