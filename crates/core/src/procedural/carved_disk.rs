//! Carved disk: engraved rings and petals on a round plate, after Tan et al. 2005, figures 4 and 6.

use std::f64::consts::TAU;

use super::{Row, aspect, height_field};

/// A groove of unit depth where `t` (in periods) passes a whole number, `width` of a period wide.
fn groove(t: f64, width: f64) -> f64 {
    let distance = (t - t.round()).abs() / width;
    if distance < 1.0 { -0.5 * (1.0 + (0.5 * TAU * distance).cos()) } else { 0.0 }
}

pub(super) const ROW: Row = Row {
    name: "carved-disk",
    summary: "a round plate engraved with rings and petals",
    build: |size| {
        let aspect = aspect(size);
        height_field(size, move |u, v| {
            let (x, y) = (2.0 * u - 1.0, 2.0 * (v / aspect).fract() - 1.0);
            let (r, angle) = (x.hypot(y), y.atan2(x) / TAU);
            if r > 0.95 {
                return 0.0;
            }
            let rings = groove(r * 6.0, 0.12) + 0.35 * groove(r * 24.0, 0.3);
            let petals = groove(angle * 24.0 + 2.5 * r, 0.22);
            let rosette = groove(r * 4.0 - 0.25 * (TAU * 8.0 * angle).cos(), 0.12);
            let rim = ((0.95 - r) / 0.03).min(1.0);
            rim * (0.0025 * rings + 0.004 * petals * (r * 3.0).min(1.0) + 0.005 * rosette)
        })
    },
};
