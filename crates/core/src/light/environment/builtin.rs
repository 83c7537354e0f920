//! Built-in environments, to look at and to test with, without a file.

use glam::{DVec3, Vec3};

use super::Environment;
use crate::grid::{Grid, Size};

/// A row of [`TABLE`].
pub struct Row {
    /// Name on the command line, after `builtin:`.
    pub name: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Radiance from a direction.
    radiance: fn(DVec3) -> DVec3,
}

/// Every built-in environment.
pub static TABLE: &[Row] = &[
    Row { name: "white", summary: "1 from everywhere: a furnace", radiance: |_| DVec3::ONE },
    Row { name: "sky", summary: "a clear sky over sand, with a sun 100 000 times as bright", radiance: sky },
    Row { name: "studio", summary: "a dark room with two lamps and a window", radiance: studio },
];

/// The row of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Row> {
    TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name))
}

impl Row {
    /// The picture, 512 × 256.
    #[must_use]
    pub fn build(&self) -> Environment {
        let size = Size { width: 512, height: 256 };
        let blank = Environment { radiance: Grid::from_fn(size, |_, _| Vec3::ZERO) };
        let at =
            |x: usize, y: usize| (self.radiance)(blank.direction(x as f64 + 0.5, y as f64 + 0.5)).as_vec3();
        Environment { radiance: Grid::from_fn(size, at) }
    }
}

/// True within so many degrees of a direction.
fn within(w: DVec3, of: [f64; 3], degrees: f64) -> bool {
    w.dot(DVec3::from(of).normalize()) > degrees.to_radians().cos()
}

/// As bright as the scenes' own lights: white paper that faces the sun sends back 1.
fn sky(w: DVec3) -> DVec3 {
    if within(w, [0.5, 0.55, 0.7], 0.6) {
        return DVec3::new(1.0, 0.93, 0.8) * 8e3;
    }
    if w.y <= 0.0 {
        return DVec3::new(0.064, 0.052, 0.036) * (1.0 + 0.3 * w.y);
    }
    DVec3::new(0.15, 0.164, 0.19).lerp(DVec3::new(0.024, 0.05, 0.12), w.y.sqrt())
}

fn studio(w: DVec3) -> DVec3 {
    if within(w, [0.8, 0.5, 0.6], 9.0) {
        return DVec3::new(1.0, 0.95, 0.85) * 40.0;
    }
    if within(w, [-0.9, 0.3, 0.2], 5.0) {
        return DVec3::new(0.7, 0.85, 1.0) * 60.0;
    }
    // The window: a rectangle overhead and behind, in four panes.
    let (s, t) = (w.x / w.y, w.z / w.y);
    if w.y > 0.3 && s.abs() < 0.7 && (-1.1..-0.1).contains(&t) && s.abs() > 0.05 && (t + 0.6).abs() > 0.05 {
        return DVec3::new(2.2, 2.4, 2.6);
    }
    DVec3::splat(0.05 + 0.04 * w.y)
}

#[cfg(test)]
mod tests {
    use super::super::{Environment, without_suns};
    use super::*;

    #[test]
    fn all_are_radiance_and_one_has_a_sun() {
        for row in TABLE {
            let built = row.build();
            Environment::new(built.picture().clone()).unwrap();
            let (_, suns) = without_suns(&built);
            assert_eq!(suns.lights.len(), usize::from(row.name == "sky"), "{}", row.name);
        }
    }
}
