//! Ripples: parallel waves. Highlights stretch across them (Olano and North 1997, figure 1).

use std::f64::consts::TAU;

use super::{Row, height_field};

pub(super) const ROW: Row = Row {
    name: "ripples",
    summary: "parallel sine waves of slope 0.4, strongly anisotropic",
    build: |size| {
        let waves = TAU * 16.0;
        height_field(size, move |u, _| 0.4 / waves * (waves * u).sin())
    },
};
