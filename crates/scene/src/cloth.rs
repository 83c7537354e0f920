//! Cloth that falls over a ball, after Han et al. 2007, figure 5. Simulated by positions, the same every
//! time.
//!
//! Position-based dynamics (Müller et al. 2007): particles fall, are pushed out of the ball, and a few sweeps
//! over the threads bring each back towards its length. Everything is in one order and one precision, so a
//! frame is a function of time.

use glam::{DVec2, DVec3, Vec3};

use super::mesh::grid_triangles;
use super::sphere::ball;
use super::{Camera, Material, Mesh, Object, Row, Scene, SceneOptions, Vertex, brdf, sun};
use ndfmap_core::brdf::{ShadingModel, SurfaceParams};
use ndfmap_core::units::SlopeVariance;

/// Cells on a side.
const CELLS: usize = 56;
/// Side of the cloth.
const SIDE: f64 = 2.6;
/// Radius of the ball, and how far cloth stays off it.
const BALL: f64 = 0.7;
const GAP: f64 = 0.02;
/// Height at which the cloth starts.
const START: f64 = 0.8;
/// Steps of the whole animation, of 1/120 s.
const STEPS: f64 = 180.0;
/// Sweeps over the threads in a step.
const SWEEPS: usize = 12;

/// Particles of the cloth after some steps, row by row.
fn fallen(steps: usize) -> Vec<DVec3> {
    let side = CELLS + 1;
    let cell = SIDE / CELLS as f64;
    let place = |i: usize| {
        let (x, z) = ((i % side) as f64 * cell - SIDE / 2.0, SIDE / 2.0 - (i / side) as f64 * cell);
        DVec3::new(x + 0.08, START, z + 0.05)
    };
    let mut now: Vec<DVec3> = (0..side * side).map(place).collect();
    let mut before = now.clone();
    // Threads, diagonals, and every second particle against folding: pairs with their length and how much
    // they give.
    let mut threads = Vec::new();
    for (di, dj, firm) in [(1, 0, 1.0), (0, 1, 1.0), (1, 1, 0.6), (2, 0, 0.15), (0, 2, 0.15)] {
        for j in 0..side - dj {
            for i in 0..side - di {
                let (a, b) = (j * side + i, (j + dj) * side + i + di);
                threads.push((a, b, now[a].distance(now[b]), firm));
                if di == 1 && dj == 1 {
                    let (a, b) = (j * side + i + 1, (j + 1) * side + i);
                    threads.push((a, b, now[a].distance(now[b]), firm));
                }
            }
        }
    }
    let step = 1.0 / 120.0;
    for _ in 0..steps {
        for (now, before) in now.iter_mut().zip(&mut before) {
            // Air takes one percent of the speed a step.
            let moved = *now + 0.99 * (*now - *before) + DVec3::NEG_Y * (9.81 * step * step);
            *before = std::mem::replace(now, moved);
        }
        for _ in 0..SWEEPS {
            for &(a, b, length, firm) in &threads {
                let apart = now[b] - now[a];
                let distance = apart.length().max(1e-9);
                let pull = apart * (0.5 * firm * (1.0 - length / distance));
                now[a] += pull;
                now[b] -= pull;
            }
            for (p, before) in now.iter_mut().zip(&before) {
                let out = p.length();
                if out < BALL + GAP {
                    // Out of the ball, and with friction along it.
                    *p *= (BALL + GAP) / out.max(1e-9);
                    let slid = (*p - *before).reject_from(p.normalize_or(DVec3::Y));
                    *p -= 0.5 * slid;
                }
                p.y = p.y.max(-1.1);
            }
        }
    }
    now
}

fn cloth(time: f64) -> Mesh {
    let side = CELLS + 1;
    let vertex = |(i, p): (usize, &DVec3)| {
        let uv = DVec2::new((i % side) as f64, (CELLS - i / side) as f64) / CELLS as f64;
        Vertex {
            position: p.as_vec3(),
            normal: Vec3::Y,
            tangent: Vec3::X.extend(1.0),
            uv: (uv * 4.0).as_vec2(),
        }
    };
    let places = fallen((time * STEPS).round() as usize);
    let mut mesh = Mesh {
        vertices: places.iter().enumerate().map(vertex).collect(),
        triangles: grid_triangles(CELLS, CELLS),
        stretches: Vec::new(),
    };
    // Tangents along the threads; `smooth` turns them into the surface.
    for i in 0..side * side {
        let (left, right) = (if i % side > 0 { i - 1 } else { i }, if i % side < CELLS { i + 1 } else { i });
        let along = mesh.vertices[right].position - mesh.vertices[left].position;
        mesh.vertices[i].tangent = along.extend(1.0);
    }
    mesh.smooth();
    mesh
}

pub(super) const ROW: Row = Row {
    name: "cloth",
    summary: "woven cloth draping over a ball",
    animation: "the cloth falls and settles",
    build: |staging: &SceneOptions| {
        let params = |diffuse: [f64; 3], specular: f64| SurfaceParams {
            diffuse: diffuse.into(),
            specular: DVec3::splat(specular),
            roughness: SlopeVariance::ZERO,
        };
        let material = |name: &str, map, params, lobe| Material {
            name: name.to_owned(),
            map,
            params,
            textures: None,
            displacement: None,
            brdf: brdf(ShadingModel::Han, lobe),
        };
        let under = Mesh::from_patch((64, 32), DVec2::ONE, |s, t| BALL * ball(s, t));
        Scene {
            camera: Camera::new([1.6, 1.5, 3.2], [0.0, -0.2, 0.0], 42.0),
            objects: vec![
                Object { mesh: cloth(staging.time).into(), material: 0 },
                Object { mesh: under.into(), material: 1 },
            ],
            materials: vec![
                material(
                    "cloth",
                    staging.first_map("weave"),
                    params([0.28, 0.05, 0.09], 0.08),
                    "blinn-phong:60",
                ),
                material("ball", staging.builtin("noise"), params([0.2, 0.2, 0.22], 0.03), "blinn-phong:40"),
            ],
            lights: vec![sun([-0.5, 0.9, 0.7], [2.6, 2.5, 2.4]), sun([0.9, 0.3, 0.2], [0.5, 0.55, 0.7])],
            environment: None,
            background: Vec3::new(0.02, 0.02, 0.025),
            exposure: 1.0,
        }
    },
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cloth_falls_keeps_its_threads_and_stays_outside_the_ball() {
        let places = fallen(STEPS as usize);
        let (cell, side) = (SIDE / CELLS as f64, CELLS + 1);
        assert!(places.iter().all(|p| p.is_finite() && p.length() > BALL));
        // A free fall of 1.5 s would be 11; what hangs from the ball is at most half a diagonal lower.
        let lowest = places.iter().map(|p| p.y).fold(f64::MAX, f64::min);
        assert!(lowest < -0.2, "{lowest}");
        let stretched =
            (0..side * side).filter(|i| i % side < CELLS).map(|i| places[i].distance(places[i + 1]) / cell);
        let worst = stretched.fold(0.0, f64::max);
        // A dozen sweeps leave some stretch where cloth hangs; a torn mesh would show tens.
        assert!(worst < 1.6, "{worst}");
        assert_eq!(places, fallen(STEPS as usize));
    }
}
