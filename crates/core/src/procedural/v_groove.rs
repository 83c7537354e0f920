//! V-groove: half the texels lean left, half lean right. Han et al. 2007, figure 1.
//!
//! Given as normals, not heights, so that exactly two directions occur and every answer has a closed form.

use glam::Vec2;

use super::Row;
use crate::grid::{Grid, Size};
use crate::surface::{NormalGrid, Wraps, normal_of_slope};

/// Slope of the flanks, plus and minus.
pub const GROOVE_SLOPE: f32 = 0.5;

/// Flanks across the map.
const FLANKS: usize = 16;

pub(super) const ROW: Row = Row {
    name: "v-groove",
    summary: "straight grooves with two flanks, the simplest two-lobed surface",
    build: |size: Size| {
        let normal = |x: usize, _| {
            let rising = (x * FLANKS / size.width).is_multiple_of(2);
            normal_of_slope(Vec2::new(if rising { GROOVE_SLOPE } else { -GROOVE_SLOPE }, 0.0))
        };
        Box::new(NormalGrid { normals: Grid::from_fn(size, normal), wraps: Wraps::default() })
    },
};
