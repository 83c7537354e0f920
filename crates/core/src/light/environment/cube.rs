//! A function of direction on the six faces of a cube, at several widths. Twin: `cube.wgsl`.
//!
//! A face's outermost texels lie on the cube's edges: their middles are at -1 and 1, and neighbouring faces
//! have texels for the same directions there. So the plain bilinear mix within one face goes on without a
//! seam in the next, on every device and here alike. Faces are those of graphics interfaces: +x, -x, +y, -y,
//! +z, -z.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::Environment;

/// Texels on a side of the coarsest level.
pub(super) const LEAST_SIDE: usize = 4;

/// Texels on a side of the finest level, at most: 0.35 degrees each.
const MOST_SIDE: usize = 256;

/// Points over a texel, on each axis; the texel is their mean.
const POINTS: usize = 4;

/// A function on the sphere, level by level.
#[derive(Clone, Debug)]
pub struct Cube {
    /// Texels of each level, face by face, row by row.
    levels: Vec<Vec<Vec3>>,
    side: usize,
}

/// Direction, not of unit length, to a place on a face: `s` to the right, `t` down, both from -1 to 1 (and
/// beyond, to the sides).
#[must_use]
pub fn cube_direction(face: usize, s: f64, t: f64) -> DVec3 {
    match face {
        0 => DVec3::new(1.0, -t, -s),
        1 => DVec3::new(-1.0, -t, s),
        2 => DVec3::new(s, 1.0, t),
        3 => DVec3::new(s, -1.0, -t),
        4 => DVec3::new(s, -t, 1.0),
        _ => DVec3::new(-s, -t, -1.0),
    }
}

/// Face that a direction goes through, and the place on it.
pub(super) fn cube_place(w: DVec3) -> (usize, DVec2) {
    let a = w.abs();
    if a.x >= a.y && a.x >= a.z {
        if w.x > 0.0 { (0, DVec2::new(-w.z, -w.y) / a.x) } else { (1, DVec2::new(w.z, -w.y) / a.x) }
    } else if a.y >= a.z {
        if w.y > 0.0 { (2, DVec2::new(w.x, w.z) / a.y) } else { (3, DVec2::new(w.x, -w.z) / a.y) }
    } else if w.z > 0.0 {
        (4, DVec2::new(w.x, -w.y) / a.z)
    } else {
        (5, DVec2::new(-w.x, -w.y) / a.z)
    }
}

impl Cube {
    /// An environment on a cube: the finest level about as fine as the picture, and each coarser one the mean
    /// over a texel's solid angle.
    #[must_use]
    pub fn of(environment: &Environment) -> Self {
        let side = (environment.size().height / 2).next_power_of_two().clamp(4 * LEAST_SIDE, MOST_SIDE);
        let finest = joined(side, Self::level(side, |at| mean_around(side, at, |w| environment.radiance(w))));
        let mut cube = Self { levels: vec![finest], side };
        while cube.side_of(cube.levels.len() - 1) > LEAST_SIDE {
            let (above, side) = (cube.levels.len() - 1, cube.side_of(cube.levels.len()));
            let next = Self::level(side, |at| mean_around(side, at, |w| cube.bilinear(w, above)));
            cube.levels.push(joined(side, next));
        }
        cube
    }

    /// The cube with every level but the finest made anew, by a function of level and direction.
    pub(super) fn with_levels(&self, f: impl Fn(usize, DVec3) -> DVec3 + Sync) -> Self {
        let level = |l: usize| {
            let side = self.side_of(l);
            joined(side, Self::level(side, |(face, at)| f(l, cube_direction(face, at.x, at.y).normalize())))
        };
        let finest = self.levels[0].clone();
        let levels = std::iter::once(finest).chain((1..self.levels.len()).map(level)).collect();
        Self { levels, side: self.side }
    }

    fn level(side: usize, f: impl Fn((usize, DVec2)) -> DVec3 + Sync) -> Vec<Vec3> {
        let row = |i: usize| {
            let (face, y) = (i / side, i % side);
            let f = &f;
            (0..side).map(move |x| f((face, DVec2::new(place(x, side), place(y, side)))).as_vec3())
        };
        let rows: Vec<Vec<Vec3>> = (0..6 * side).into_par_iter().map(|i| row(i).collect()).collect();
        rows.concat()
    }

    /// Texels on a side of the finest level.
    #[must_use]
    pub fn side(&self) -> usize {
        self.side
    }

    fn side_of(&self, level: usize) -> usize {
        self.side >> level
    }

    /// Number of levels.
    #[must_use]
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// A level's texels, face by face, row by row.
    #[must_use]
    pub fn texels(&self, level: usize) -> &[Vec3] {
        &self.levels[level]
    }

    /// The function in a direction, mixed from the four texels around it.
    fn bilinear(&self, w: DVec3, level: usize) -> DVec3 {
        let side = self.side_of(level);
        let (face, at) = cube_place(w);
        let at = ((at + 1.0) / 2.0 * (side - 1) as f64).clamp(DVec2::ZERO, DVec2::splat((side - 1) as f64));
        let (x, y) = ((at.x as usize).min(side - 2), (at.y as usize).min(side - 2));
        let part = at - DVec2::new(x as f64, y as f64);
        let texel = |x: usize, y: usize| self.levels[level][(face * side + y) * side + x].as_dvec3();
        texel(x, y)
            .lerp(texel(x + 1, y), part.x)
            .lerp(texel(x, y + 1).lerp(texel(x + 1, y + 1), part.x), part.y)
    }

    /// The function in a direction, mixed between two levels; `lod` is held to the levels that exist.
    #[must_use]
    pub fn lookup(&self, w: DVec3, lod: f64) -> DVec3 {
        let lod = lod.clamp(0.0, (self.levels.len() - 1) as f64);
        let (level, part) = (lod as usize, lod.fract());
        let below = self.bilinear(w, level);
        if part == 0.0 { below } else { below.lerp(self.bilinear(w, level + 1), part) }
    }
}

/// The level with one value for each direction: a texel on an edge gets the mean of the values that the faces
/// around have for it.
fn joined(side: usize, level: Vec<Vec3>) -> Vec<Vec3> {
    let mut joined = level.clone();
    let last = side - 1;
    for face in 0..6 {
        let edge = (0..side).flat_map(|i| [(i, 0), (i, last), (0, i), (last, i)]);
        for (x, y) in edge {
            let w = cube_direction(face, place(x, side), place(y, side));
            let (mut sum, mut count) = (DVec3::ZERO, 0.0);
            for other in 0..6 {
                let axis = cube_direction(other, 0.0, 0.0);
                if w.dot(axis) < 1.0 {
                    continue;
                }
                let across =
                    [cube_direction(other, 1.0, 0.0), cube_direction(other, 0.0, 1.0)].map(|d| d - axis);
                let at = across.map(|d| ((w.dot(d) + 1.0) / 2.0 * last as f64).round() as usize);
                sum += level[(other * side + at[1]) * side + at[0]].as_dvec3();
                count += 1.0;
            }
            joined[(face * side + y) * side + x] = (sum / count).as_vec3();
        }
    }
    joined
}

/// Place of a texel's middle on its face.
fn place(i: usize, side: usize) -> f64 {
    2.0 * i as f64 / (side - 1) as f64 - 1.0
}

/// Mean of a function over a texel, by solid angle. A place on a face's plane counts `(1 + s² + t²)^-3/2`;
/// where the texel reaches beyond the edge, so does the plane.
fn mean_around(side: usize, (face, at): (usize, DVec2), f: impl Fn(DVec3) -> DVec3) -> DVec3 {
    let step = 2.0 / (side - 1) as f64;
    let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
    for i in 0..POINTS * POINTS {
        let point = DVec2::new((i % POINTS) as f64 + 0.5, (i / POINTS) as f64 + 0.5) / POINTS as f64 - 0.5;
        let w = cube_direction(face, at.x + step * point.x, at.y + step * point.y);
        let solid_angle = w.length_squared().powf(-1.5);
        sum += f(w.normalize()) * solid_angle;
        weight += solid_angle;
    }
    sum / weight
}

#[cfg(test)]
mod tests {
    use super::super::tests::{smooth, smooth_radiance};
    use super::*;
    use crate::grid::Size;

    #[test]
    fn places_and_directions_are_inverses() {
        for face in 0..6 {
            for (s, t) in [(0.0, 0.0), (0.3, -0.7), (-0.9, 0.99)] {
                assert_eq!(cube_place(cube_direction(face, s, t)), (face, DVec2::new(s, t)));
            }
        }
    }

    #[test]
    fn there_are_no_seams() {
        let cube = Cube::of(&smooth(Size { width: 64, height: 32 }));
        for level in 0..cube.levels() {
            // Either side of each edge, and of corners.
            for (a, b) in [
                ((1.0, 0.999_999_9, 0.3), (0.999_999_9, 1.0, 0.3)),
                ((-1.0, 0.2, 0.999_999_9), (-0.999_999_9, 0.2, 1.0)),
                ((0.999_999_9, -1.0, 1.0), (1.0, -0.999_999_9, 1.0)),
            ] {
                let (a, b) = (cube.lookup(a.into(), level as f64), cube.lookup(b.into(), level as f64));
                assert!((a - b).length() < 1e-5, "level {level}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_smooth_sky_is_on_the_cube() {
        let cube = Cube::of(&smooth(Size { width: 512, height: 256 }));
        assert_eq!((cube.side(), cube.levels()), (128, 6));
        for w in [DVec3::X, DVec3::new(0.6, -0.64, 0.48), DVec3::new(0.5, 0.5, -0.707).normalize()] {
            // Texels of the picture are 0.7 degrees, and a face's 0.9: 0.02 of what changes by at most 1 in a
            // radian.
            assert!((cube.lookup(w, 0.0) - smooth_radiance(w)).length() < 0.015, "{w}");
        }
    }

    #[test]
    fn coarse_levels_hold_the_same_light() {
        let cube = Cube::of(&smooth(Size { width: 128, height: 64 }));
        for level in 0..cube.levels() {
            let side = cube.side() >> level;
            let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
            for (i, texel) in cube.texels(level).iter().enumerate() {
                let (x, y) = (i % side, i / side % side);
                // Texels on edges and corners are half and a quarter inside.
                let inside = |k: usize| if k == 0 || k == side - 1 { 0.5 } else { 1.0 };
                let solid_angle =
                    cube_direction(0, place(x, side), place(y, side)).length_squared().powf(-1.5);
                let w = solid_angle * inside(x) * inside(y);
                sum += texel.as_dvec3() * w;
                weight += w;
            }
            let mean = smooth(Size { width: 128, height: 64 }).mean();
            // Four texels on a side leave the sum some 1 %.
            assert!((sum / weight - mean).length() < 0.015, "level {level}: {} {mean}", sum / weight);
        }
    }
}
