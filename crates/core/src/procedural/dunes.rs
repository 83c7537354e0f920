//! Dunes: long waves, steep on the lee side, under fine ripples at a slant, after Tan et al. 2005, figure 1.

use std::f64::consts::TAU;

use super::{Row, aspect, height_field};

pub(super) const ROW: Row = Row {
    name: "dunes",
    summary: "asymmetric dunes under slanting ripples: two scales of relief",
    build: |size| {
        let aspect = aspect(size);
        height_field(size, move |u, v| {
            let v = v / aspect;
            // Bending the phase steepens one side; whole wave numbers tile.
            let phase = TAU * (3.0 * u + 0.25 * (TAU * v).sin() + v);
            let dune = 0.02 * (phase + 0.6 * phase.sin()).sin();
            let ripple = TAU * (24.0 * u - 36.0 * v + 1.5 * (TAU * (v + u)).sin() + 0.8 * phase.sin());
            dune + 0.0009 * (ripple + 0.4 * ripple.sin()).sin() * (1.0 + 0.6 * phase.cos())
        })
    },
};
