//! Weave: two families of round threads, over and under in turn. Four directions of normals at every scale of
//! a cloth.

use std::f64::consts::PI;

use super::{Row, aspect, height_field};

/// Threads across the map; even, so that over and under tile.
const THREADS: f64 = 24.0;

pub(super) const ROW: Row = Row {
    name: "weave",
    summary: "plain weave of round threads, four-lobed",
    build: |size| {
        // An even number of threads down the map too.
        let rows = (aspect(size) * THREADS / 2.0).round().max(1.0) * 2.0;
        let pitch = aspect(size) / rows;
        height_field(size, move |u, v| {
            let (x, y) = (u * THREADS, v / pitch);
            // Across a thread a low arc; along it a wave, down where it dives under the other family.
            let thread = |across: f64, along: f64| {
                let offset = across - across.floor() - 0.5;
                let phase = if across.floor().rem_euclid(2.0) < 1.0 { 0.0 } else { 1.0 };
                0.3 * (1.0 - 3.2 * offset * offset).max(0.0).sqrt()
                    + 0.16 * (PI * (along - 0.5 + phase)).cos()
            };
            thread(x, y).max(thread(y, x + 1.0)) / THREADS
        })
    },
};
