//! Armour: hemispherical scales in staggered rows, after Tan et al. 2005, figure 8.

use super::{Row, aspect, height_field};

/// Scales across the map.
const SCALES: f64 = 16.0;

pub(super) const ROW: Row = Row {
    name: "armour",
    summary: "overlapping hemispherical scales in staggered rows",
    build: |size| {
        // Rows half a scale apart; an even number of them, so that the stagger tiles.
        let rows = (aspect(size) * SCALES).round().max(1.0) * 2.0;
        let pitch = aspect(size) / rows;
        height_field(size, move |u, v| {
            let mut top = 0.0_f64;
            let here = (v / pitch).floor();
            for row in -2..=2 {
                let row = here + f64::from(row);
                let shift = if row.rem_euclid(2.0) < 1.0 { 0.0 } else { 0.5 };
                let dx = u * SCALES - shift;
                let dx = (dx - dx.round()) / SCALES;
                let dy = v - (row + 0.5) * pitch;
                // A sphere of radius 0.6 pitch of the scales, cut at 80 % of its radius: slopes to 1.3.
                let radius = 0.6 / SCALES;
                let d2 = (dx * dx + dy * dy) / (radius * radius);
                if d2 < 0.64 {
                    top = top.max(radius * ((1.0 - d2).sqrt() - 0.6));
                }
            }
            top
        })
    },
};
