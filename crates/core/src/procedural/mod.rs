//! Surfaces of our own making, so that everything runs without data. All tile.
//!
//! [`TABLE`] lists them; `builtin:NAME` names them on the command line. Coordinates are `(u, v)` in texture
//! widths, v down the rows; heights too are in texture widths, so a surface looks the same at every size.

mod armour;
mod carved_disk;
mod dunes;
mod foil;
mod noise;
mod noise_sphere;
mod ripples;
mod v_groove;
mod weave;

pub use noise::gaussian_noise;
pub use noise_sphere::{Grain, sphere_noise};
pub use v_groove::GROOVE_SLOPE;

use crate::grid::{Grid, Size};
use crate::surface::{HeightField, SlopeFilter, Surface, Wraps};

/// A row of [`TABLE`].
pub struct Row {
    /// Name on the command line, after `builtin:`.
    pub name: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Makes the surface at a size.
    pub build: fn(Size) -> Box<dyn Surface>,
}

/// Every built-in surface.
pub static TABLE: &[Row] = &[
    carved_disk::ROW,
    armour::ROW,
    dunes::ROW,
    v_groove::ROW,
    ripples::ROW,
    foil::ROW,
    noise::ROW,
    weave::ROW,
];

/// The row of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Row> {
    TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name))
}

/// A tiling height field sampled at the texels' centres.
fn height_field(size: Size, height: impl Fn(f64, f64) -> f64) -> Box<dyn Surface> {
    let width = size.width as f64;
    let at = |x: usize, y: usize| height((x as f64 + 0.5) / width, (y as f64 + 0.5) / width) as f32;
    Box::new(HeightField {
        heights: Grid::from_fn(size, at),
        wraps: Wraps::default(),
        filter: SlopeFilter::CentralDifference,
    })
}

/// Rows over columns: how often a pattern of period 1 in u must repeat in v to tile, at least once.
fn aspect(size: Size) -> f64 {
    size.height as f64 / size.width as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{SurfaceRow, integrability};

    #[test]
    fn all_are_unit_normals_at_every_size() {
        for row in TABLE {
            for (w, h) in [(1, 1), (1, 16), (33, 20), (64, 64)] {
                let surface = (row.build)(Size::new(w, h).unwrap());
                assert_eq!((surface.size().width, surface.size().height), (w, h));
                let mut texels = SurfaceRow::flat(w);
                for y in 0..h {
                    surface.read_row(y, &mut texels);
                    for i in 0..w {
                        let n = texels.normal(i);
                        assert!((n.length() - 1.0).abs() < 1e-5 && n.z > 0.0, "{} {w}×{h} {n}", row.name);
                    }
                }
            }
        }
    }

    #[test]
    fn all_are_gradients_with_y_up() {
        // The groove is no sampled height, and neither it nor the ripples vary along y.
        for row in TABLE.iter().filter(|row| !["v-groove", "ripples"].contains(&row.name)) {
            let surface = (row.build)(Size::new(256, 256).unwrap());
            assert!(integrability(&*surface) > 0.8, "{} {}", row.name, integrability(&*surface));
        }
    }
}
