//! Crumpled foil: creases at all angles, flat facets between; it dulls with distance (Olano and North 1997).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Row, aspect, height_field};

/// Family of parallel folds: a triangle wave over whole wave numbers, which tiles.
struct Fold {
    u: f64,
    v: f64,
    phase: f64,
    amplitude: f64,
}

pub(super) const ROW: Row = Row {
    name: "foil",
    summary: "crumpled foil: flat facets between creases at all angles",
    build: |size| {
        let mut random = Pcg64Mcg::seed_from_u64(1997);
        let fold = |octave: usize| {
            let frequency = 2.0_f64.powf(1.0 + octave as f64 / 3.0);
            let angle = random.random_range(0.0..std::f64::consts::TAU);
            let (v, u) = angle.sin_cos();
            let (u, v) = ((u * frequency).round(), (v * frequency).round());
            let length = u.hypot(v).max(1.0);
            Fold { u, v, phase: random.random(), amplitude: 0.055 / length }
        };
        let folds: Vec<Fold> = (0..14).map(fold).collect();
        let aspect = aspect(size);
        height_field(size, move |u, v| {
            let v = v / aspect;
            // Each family bends the next one's folds, so that facets are not parallelograms.
            let (mut height, mut bend) = (0.0, 0.0);
            for f in &folds {
                let t = f.u * u + f.v * v + f.phase + bend;
                let wave = 2.0 * (t - t.floor() - 0.5).abs() - 0.5;
                height += f.amplitude * wave;
                bend = 0.35 * wave;
            }
            height
        })
    },
};
