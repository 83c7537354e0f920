//! Environments: pictures of light from everywhere, by latitude and longitude or on the faces of a cube.
//!
//! Faces of cubes are seen from inside, as OpenGL and Direct3D define them: in a world whose z runs ahead
//! while x runs to the right, the mirror image of ours. Ours has the same z, and x the other way. OpenEXR
//! defines its cubes in a world like ours (ImfEnvmap.h, "Cube map"), whose panoramas look to +z where ours
//! look to -z.

use std::path::Path;

use glam::{DVec2, DVec3, Vec3};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::environment::{Environment, builtin, cube_direction};

use crate::formats::exr::is_cube;
use crate::formats::{read_file, read_image};
use crate::source::BUILTIN_PREFIX;
use crate::{Image, MapError, Samples};

/// Places of the faces +x, -x, +y, -y, +z, -z in a picture, in sides of a face, and whether the last is
/// upside down.
struct Layout {
    /// Sides across and down.
    sides: (usize, usize),
    faces: [(usize, usize); 6],
    last_turned: bool,
}

impl Layout {
    fn fits(&self, size: Size) -> bool {
        size.width * self.sides.1 == size.height * self.sides.0 && size.width.is_multiple_of(self.sides.0)
    }
}

/// True for the size of a panorama, or of a cube in a known layout.
pub(crate) fn is_environment_size(size: Size) -> bool {
    size.width == 2 * size.height || LAYOUTS.iter().any(|layout| layout.fits(size))
}

/// Strip of an OpenEXR file that says so. Turned by half from its world to ours, it is OpenGL's strip but for
/// the order of the last two faces.
const OPENEXR: Layout =
    Layout { sides: (1, 6), faces: [(0, 0), (0, 1), (0, 2), (0, 3), (0, 5), (0, 4)], last_turned: false };

/// Pictures of a cube: crosses, and strips.
const LAYOUTS: [Layout; 4] = [
    Layout { sides: (4, 3), faces: [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)], last_turned: false },
    Layout { sides: (3, 4), faces: [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (1, 3)], last_turned: true },
    Layout { sides: (6, 1), faces: [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0)], last_turned: false },
    Layout { sides: (1, 6), faces: [(0, 0), (0, 1), (0, 2), (0, 3), (0, 4), (0, 5)], last_turned: false },
];

/// Reads an environment, `builtin:NAME` or a file; returns it with warnings of oddities that do no harm.
///
/// # Errors
/// [`MapError`] for a file that cannot be read, that is of integers (which hold no radiance), or whose sides
/// are those of no known layout.
pub fn read_environment(path: &Path) -> Result<(Environment, Vec<String>), MapError> {
    if let Some(name) = path.to_str().and_then(|p| p.strip_prefix(BUILTIN_PREFIX)) {
        let row = builtin::find(name).ok_or_else(|| {
            let names: Vec<&str> = builtin::TABLE.iter().map(|r| r.name).collect();
            MapError::invalid(
                path,
                format!("there is no such environment; built in are {}", names.join(", ")),
            )
        })?;
        return Ok((row.build(), Vec::new()));
    }
    parse_environment(path, &read_file(path)?)
}

/// [`read_environment`] of a file's bytes.
///
/// # Errors
/// [`MapError`], as for a file.
pub fn parse_environment(path: &Path, bytes: &[u8]) -> Result<(Environment, Vec<String>), MapError> {
    let image = read_image(path, bytes)?;
    let (mut warnings, picture) = radiance(path, &image)?;
    let Size { width, height } = picture.size();
    let latitudes = if width == 2 * height {
        picture
    } else {
        let fits = |l: &&Layout| l.fits(Size { width, height });
        let own = Some(&OPENEXR).filter(|_| is_cube(path, bytes));
        let layout = own.into_iter().chain(&LAYOUTS).find(fits).ok_or_else(|| {
            MapError::unsupported(
                path,
                format!(
                    "is {width} × {height}; an environment is twice as wide as high, or a cube as a cross (4:3, 3:4) or a strip (6:1, 1:6)"
                ),
            )
        })?;
        unfold(&picture, layout)
    };
    if latitudes.texels().iter().all(|v| *v == Vec3::ZERO) {
        warnings.push("is black".to_owned());
    }
    let environment = Environment::new(latitudes).map_err(|e| MapError::invalid(path, e))?;
    Ok((environment, warnings))
}

/// Radiance of a picture; samples that are negative or not finite become black, and are counted.
fn radiance(path: &Path, image: &Image) -> Result<(Vec<String>, Grid<Vec3>), MapError> {
    let Samples::F32(samples) = &image.samples else {
        return Err(MapError::unsupported(
            path,
            "is of integers; an environment is of floats, as .hdr and .exr are",
        ));
    };
    let (mut negative, mut not_finite) = (0_usize, 0_usize);
    let mut channel = |v: f32| {
        if !v.is_finite() {
            not_finite += 1;
            return 0.0;
        }
        negative += usize::from(v < 0.0);
        v.max(0.0)
    };
    let channels = image.channels;
    let picture = Grid::from_fn(image.size, |x, y| {
        let texel = &samples[(y * image.size.width + x) * channels..][..channels];
        match *texel {
            [r, g, b, ..] => Vec3::new(channel(r), channel(g), channel(b)),
            [grey, ..] => Vec3::splat(channel(grey)),
            [] => Vec3::ZERO,
        }
    });
    let mut warnings = image.warnings.clone();
    for (count, what) in [(negative, "negative"), (not_finite, "not finite")] {
        if count > 0 {
            warnings.push(format!("{count} samples are {what}, and taken as 0"));
        }
    }
    Ok((warnings, picture))
}

/// Sample points of a texel on each axis; the texel is their mean.
const POINTS: usize = 3;

/// Picture of a cube by latitude and longitude, as many texels around as four faces have.
fn unfold(picture: &Grid<Vec3>, layout: &Layout) -> Grid<Vec3> {
    let side = picture.size().width / layout.sides.0;
    let size = Size { width: 4 * side, height: 2 * side };
    // The environment knows the directions of texels.
    let blank = Environment::new(Grid::from_fn(size, |_, _| Vec3::ZERO))
        .unwrap_or_else(|_| unreachable!("black is radiance"));
    let look = |w: DVec3| {
        let (face, at) = face_of(DVec3::new(-w.x, w.y, w.z));
        let at = if layout.last_turned && face == 5 { -at } else { at };
        let texel = |t: f64| (((t + 1.0) / 2.0 * side as f64) as usize).min(side - 1);
        let (column, row) = layout.faces[face];
        picture.row(row * side + texel(at.y))[column * side + texel(at.x)]
    };
    Grid::from_fn(size, |x, y| {
        let mut sum = Vec3::ZERO;
        for i in 0..POINTS * POINTS {
            let part = |k: usize| (k as f64 + 0.5) / POINTS as f64;
            sum += look(blank.direction(x as f64 + part(i % POINTS), y as f64 + part(i / POINTS)));
        }
        sum / (POINTS * POINTS) as f32
    })
}

/// Face that a direction in OpenGL's world goes through, and the place on it.
fn face_of(w: DVec3) -> (usize, DVec2) {
    let hit = |face: usize| {
        let axis = cube_direction(face, 0.0, 0.0);
        let depth = w.dot(axis);
        let across =
            [cube_direction(face, 1.0, 0.0), cube_direction(face, 0.0, 1.0)].map(|d| w.dot(d - axis));
        (depth, DVec2::from(across) / depth)
    };
    let faces = (0..6).map(|face| (face, hit(face)));
    let nearest = faces.max_by(|a, b| a.1.0.total_cmp(&b.1.0));
    nearest.map_or((0, DVec2::ZERO), |(face, (_, at))| (face, at))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sky without any symmetry.
    fn sky(w: DVec3) -> Vec3 {
        (Vec3::splat(2.0) + (w + 0.5 * DVec3::new(w.y * w.z, w.z * w.x, w.x)).as_vec3()).max(Vec3::ZERO)
    }

    /// Largest difference from the sky, over places inside each face.
    fn largest_error(picture: &Grid<Vec3>, layout: &Layout) -> f32 {
        let e = Environment::new(unfold(picture, layout)).unwrap();
        let ways = (0..6).flat_map(|face| [(0.3, -0.4), (-0.7, 0.1), (0.2, 0.8)].map(|at| (face, at)));
        let error = |(face, (s, t)): (usize, (f64, f64))| {
            let w = cube_direction(face, s, t).normalize();
            (e.radiance(w).as_vec3() - sky(w)).abs().max_element()
        };
        ways.map(error).fold(0.0, f32::max)
    }

    /// Texels of 1/32 of a face, in a sky whose slope is at most 2.5.
    const TOLERANCE: f32 = 2.5 * 2.0 / 32.0;

    #[test]
    fn crosses_and_strips_are_seen_from_inside() {
        // Ahead, right and up of each face in a world whose z runs ahead and x to the right, as seen on a
        // cross.
        let axes = [
            [DVec3::X, DVec3::NEG_Z, DVec3::Y],
            [DVec3::NEG_X, DVec3::Z, DVec3::Y],
            [DVec3::Y, DVec3::X, DVec3::NEG_Z],
            [DVec3::NEG_Y, DVec3::X, DVec3::Z],
            [DVec3::Z, DVec3::X, DVec3::Y],
            [DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y],
        ];
        let side = 32;
        for layout in &LAYOUTS {
            let size = Size { width: layout.sides.0 * side, height: layout.sides.1 * side };
            let picture = Grid::from_fn(size, |x, y| {
                let at = (x / side, y / side);
                let Some(face) = layout.faces.iter().position(|f| *f == at) else { return Vec3::ZERO };
                let place = |i: usize| ((i % side) as f64 + 0.5) / side as f64 * 2.0 - 1.0;
                let turn = if layout.last_turned && face == 5 { -1.0 } else { 1.0 };
                let [ahead, right, up] = axes[face];
                let w = ahead + turn * (place(x) * right - place(y) * up);
                // Ours is the mirror image of that world.
                sky(DVec3::new(-w.x, w.y, w.z).normalize())
            });
            let error = largest_error(&picture, layout);
            assert!(error < TOLERANCE, "{:?}: {error}", layout.sides);
        }
    }

    #[test]
    fn cubes_of_openexr_agree_with_its_panoramas() {
        // ImfEnvmap: faces +x, -x, +y, -y, +z, -z from the top; right and down of each.
        let faces = [
            [DVec3::X, DVec3::Z, DVec3::NEG_Y],
            [DVec3::NEG_X, DVec3::NEG_Z, DVec3::NEG_Y],
            [DVec3::Y, DVec3::X, DVec3::NEG_Z],
            [DVec3::NEG_Y, DVec3::X, DVec3::Z],
            [DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y],
            [DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y],
        ];
        let side = 32;
        let picture = Grid::from_fn(Size { width: side, height: 6 * side }, |x, y| {
            let place = |i: usize| ((i % side) as f64 + 0.5) / side as f64 * 2.0 - 1.0;
            let [ahead, right, down] = faces[y / side];
            let w = ahead + place(x) * right + place(y) * down;
            // Its panoramas have +z in the middle, where ours have -z: half a turn.
            sky(DVec3::new(-w.x, w.y, -w.z).normalize())
        });
        let error = largest_error(&picture, &OPENEXR);
        assert!(error < TOLERANCE, "{error}");
    }
}
