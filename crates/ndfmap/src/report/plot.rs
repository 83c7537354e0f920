//! Plot of the error by level for every method.

use ndfmap_core::grid::Size;

use crate::compare::Comparison;
use crate::draw::{Axis, Line, Plot};

/// Least floor of a plot, below all that half floats can hold of an error.
const LEAST: f64 = 1e-9;

/// Plot of the error by level, a line a method.
#[must_use]
pub fn error_plot(comparison: &Comparison) -> Plot {
    let errors = || comparison.rows.iter().flat_map(|row| &row.levels).map(|level| level.error);
    // Below every error but those that are 0, which lie on the axis.
    let least = errors().filter(|error| *error > 0.0).fold(0.01, f64::min);
    let floor = 10.0_f64.powf((least.log10() - 0.2).floor()).max(LEAST);
    let line = |row: &crate::compare::Row| Line {
        name: row.method.clone(),
        points: row.levels.iter().map(|l| [l.level as f64, l.error]).collect(),
        dashed: false,
    };
    Plot {
        size: Size { width: 900, height: 480 },
        x: Axis {
            label: "level (0 is the map itself)".to_owned(),
            range: [-0.2, (comparison.sizes.len() - 1) as f64 + 0.2],
            logarithmic: false,
        },
        y: Axis {
            label: "relative L2 error".to_owned(),
            range: [floor, errors().fold(1.0, f64::max) * 1.5],
            logarithmic: true,
        },
        lines: comparison.rows.iter().map(line).collect(),
    }
}
