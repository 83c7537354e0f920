//! Judge of roughness mips: each level as an engine shades it, beside the mean of the level's own normals.
//!
//! A level is laid on a sphere and on a floor, a texel a pixel, as it is seen from where that level is read.
//! The truth of a pixel is the engine's shading of every normal under its texel; stock and fixed materials
//! are the engine's shading of one normal and one roughness. No filter of an engine is in it: what is judged
//! is the bake alone. Whole objects, because a highlight and the dark beside it are one picture, with one
//! exposure: a lobe too wide is a haze over the dark. A floor too, because lobes that are right from above
//! may be too wide where the eye grazes them.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::sync::LazyLock;

use glam::{DMat3, DVec2, DVec3, Vec3};
use ndfmap_core::brdf::{AnyLobe, Brdf, Directions, Ggx, Microfacets, ShadingModel};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::SplitSum;
use ndfmap_core::light::environment::{FilteredEnvironment, Technique, builtin};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::roughness::{EngineMaterial, LEAST_ROUGHNESS, RoughSurface};
use ndfmap_core::surface::unit_or_up;
use ndfmap_core::units::{PerceptualRoughness, SlopeVariance};
use ndfmap_scene::metrics::{FlipTruth, Picture, relative_l2, to_bytes};
use rayon::prelude::*;
use serde::Serialize;

/// Pixels on a side of a level's picture: the busiest part of large levels, and small ones repeated.
const SIDE: usize = 64;

/// Samples that the truth of a picture reads.
const SAMPLES: usize = 1 << 20;

/// Brightness of a picture's mean on the display: its exposure is this over the truth's mean.
const MIDDLE: f64 = 0.3;

/// Radius of the part of the sphere's disk that is shown, over its own: the rim is seen at 76 degrees.
const SHOWN: f64 = 0.97;

/// Angles of the eye above the floor, far away and near, and to each side, in degrees.
const FLOOR: (f64, f64) = (4.0, 40.0);
const FLOOR_SIDE: f64 = 22.0;

/// Object that a level is laid on, with what lights it.
struct Setting {
    name: &'static str,
    /// Spots by the places of pixels, from -1 to 1, right and up, and a sun.
    spot: fn(DVec2, DVec3) -> Spot,
    /// Direction to the sun.
    sun: DVec3,
    /// Name of the environment.
    room: &'static str,
}

/// Objects, each with a sun of its own and a room. The world has x to the right, y up, and z towards the eye,
/// which is level; over the floor the sun stands behind the horizon.
const OBJECTS: [Setting; 2] = [
    Setting { name: SPHERE, spot: Spot::of_sphere, sun: DVec3::new(2.0, 2.5, 3.0), room: "studio" },
    Setting { name: "floor", spot: Spot::of_floor, sun: DVec3::new(-2.5, 2.2, -1.5), room: "sky" },
];
const SPHERE: &str = "sphere";

/// Irradiance of a sun that shines into a room, over the room's own mean radiance.
const SUN_IN_ROOM: f64 = 4.0;

/// Errors of one set of roughness mips, against the truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Relative L2 of linear light.
    pub relative_l2: f64,
    /// FLIP of display values.
    pub flip: f64,
}

/// Errors of a level by candidates.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelErrors {
    /// Level, 0 the finest.
    pub level: usize,
    /// Errors of each candidate in each light, in order.
    pub candidates: Vec<[Errors; PICTURES]>,
}

/// Pictures of a level: in a sun, in a room, and in the room that the sun shines into, for each object.
pub const PICTURES: usize = 3 * OBJECTS.len();

/// Light of one normal in every picture.
type Lights = [f64; PICTURES];

/// Pictures of an object, as a display shows them.
#[derive(Clone, Debug)]
pub struct View {
    /// Name of the object.
    pub object: &'static str,
    /// Picture of the truth.
    pub truth: Grid<[u8; 3]>,
    /// Picture by each roughness map.
    pub shaded: Vec<Grid<[u8; 3]>>,
    /// Errors of each picture.
    pub errors: Vec<Errors>,
}

/// Environment, as engines look it up: cubes that GGX facets have blurred.
struct Room {
    filtered: FilteredEnvironment,
    /// Mean radiance.
    mean: f64,
}

impl Room {
    fn new(name: &str) -> Option<Self> {
        let environment = builtin::find(name)?.build();
        let filtered = FilteredEnvironment::new(&environment);
        filtered.make(Technique::Prefiltered, Microfacets::Ggx);
        let texels = filtered.radiance.texels(filtered.radiance.levels() - 1);
        let mean = texels.iter().map(|v| f64::from(v.element_sum()) / 3.0).sum::<f64>() / texels.len() as f64;
        Some(Self { filtered, mean })
    }
}

/// Spot on an object: what lights and sees it, in the frame of its surface.
struct Spot {
    /// Frame of the surface in that of the world.
    frame: DMat3,
    wo: DVec3,
    sun: Option<Directions>,
}

impl Spot {
    fn new(frame: DMat3, eye: DVec3, sun: DVec3) -> Self {
        let inside = |w: DVec3| frame.transpose() * w;
        let wo = inside(eye);
        Self { frame, wo, sun: Directions::between(inside(sun.normalize()), wo) }
    }

    /// Spot of the sphere, whose disk the square of the picture is.
    fn of_sphere(at: DVec2, sun: DVec3) -> Self {
        let disk = SHOWN * disk_of_square(at);
        let normal = disk.extend((1.0 - disk.length_squared()).sqrt());
        let tangent = DVec3::Y.cross(normal).normalize();
        Self::new(DMat3::from_cols(tangent, normal.cross(tangent), normal), DVec3::Z, sun)
    }

    /// Spot of the floor, far ones above.
    fn of_floor(at: DVec2, sun: DVec3) -> Self {
        let (far, near) = FLOOR;
        let height = (near + (far - near) * 0.5 * (at.y + 1.0)).to_radians();
        let side = (FLOOR_SIDE * at.x).to_radians();
        let eye = DVec3::new(-height.cos() * side.sin(), height.sin(), height.cos() * side.cos());
        Self::new(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y), eye, sun)
    }
}

/// Lights, and the objects that every surface is laid on.
struct Stage {
    objects: Vec<Object>,
    /// Share of a white sky that a lobe reflects.
    lobe: SplitSum,
}

/// Object in its room.
struct Object {
    /// Spots of the pixels, row by row.
    spots: Vec<Spot>,
    room: Room,
}

/// The stage, set once: many materials are judged on the same.
static STAGE: LazyLock<Stage> = LazyLock::new(Stage::new);

impl Stage {
    fn new() -> Self {
        let facets =
            Brdf::new(AnyLobe::from(Ggx::new(PerceptualRoughness::SMOOTHEST.into())), ShadingModel::Smith);
        let along = |i: usize| 2.0 * (i as f64 + 0.5) / SIDE as f64 - 1.0;
        let object = |Setting { spot, sun, room, .. }: Setting| {
            let spots = (0..SIDE * SIDE).map(|i| spot(DVec2::new(along(i % SIDE), -along(i / SIDE)), sun));
            Some(Object { spots: spots.collect(), room: Room::new(room)? })
        };
        Self { objects: OBJECTS.into_iter().filter_map(object).collect(), lobe: SplitSum::new(&facets) }
    }

    /// Light of a normal at a pixel, in every picture.
    fn lights(&self, material: &EngineMaterial, n: DVec3, roughness: f64, pixel: usize) -> Lights {
        let width = SlopeVariance::clamped(roughness.max(LEAST_ROUGHNESS).powi(4) / 2.0);
        let grey = |v: DVec3| v.element_sum() / 3.0;
        let albedo = (1.0 - material.specular) * material.diffuse / std::f64::consts::PI;
        let mut lights = [0.0; PICTURES];
        for (picture, Object { spots, room }) in lights.as_chunks_mut().0.iter_mut().zip(&self.objects) {
            let Spot { frame, wo, sun } = &spots[pixel];
            let eye = n.dot(*wo).clamp(0.0, 1.0);
            let reflected = self.lobe.lookup(eye, width);
            let reflected = material.specular * grey(reflected.scale) + reflected.bias;
            let cube = room.filtered.prefiltered(Microfacets::Ggx);
            let mirror = *frame * (2.0 * eye * n - *wo);
            let seen = grey(cube.lookup(mirror, Microfacets::level(width, 1.0, cube.levels())));
            let scattered = match albedo {
                0.0 => 0.0,
                _ => albedo * grey(room.filtered.irradiance.of_normals(*frame * n, 0.0, false)),
            };
            let in_room = seen * reflected + scattered;
            let in_sun = sun.map_or(0.0, |path| material.shade(n, roughness, &path));
            *picture = [in_sun, in_room, SUN_IN_ROOM * room.mean * in_sun + in_room];
        }
        lights
    }
}

/// Judge of roughness mips on one surface: it has seen the truth of every level but the finest.
pub struct Judge<'a> {
    surface: &'a RoughSurface,
    material: EngineMaterial,
    levels: Vec<Truth>,
}

/// Part of a level that is seen, and its truth.
struct Truth {
    level: usize,
    size: Size,
    corner: (usize, usize),
    /// Picture in each light; `None` for one that is black.
    pictures: Vec<Option<Shown>>,
}

/// Picture, as it is and as the eye sees it.
struct Shown {
    picture: Picture,
    exposure: f32,
    seen: FlipTruth,
}

impl<'a> Judge<'a> {
    /// Shades every normal of a surface as an engine does.
    ///
    /// # Errors
    /// [`Cancelled`] when the observer wants it to end.
    pub fn new(
        surface: &'a RoughSurface,
        material: EngineMaterial,
        observer: &dyn Observer,
    ) -> Result<Self, Cancelled> {
        let sizes: Vec<Size> = surface.sizes().collect();
        let mut levels = Vec::new();
        for (level, whole) in sizes.iter().enumerate().skip(1) {
            observer.check()?;
            levels.push(Truth::new(surface, &material, (level, *whole)));
            observer.progress(level as f64 / (sizes.len() - 1) as f64);
        }
        Ok(Self { surface, material, levels })
    }

    /// Errors of several sets of roughness mips, level by level from the first that is filtered; every set
    /// has the surface's levels. They are shaded with the mean normals of an engine's own mips.
    ///
    /// # Errors
    /// [`Cancelled`] when the observer wants it to end.
    ///
    /// # Panics
    /// When a set has fewer levels than the surface.
    pub fn errors(
        &self,
        candidates: &[&[Grid<f32>]],
        observer: &dyn Observer,
    ) -> Result<Vec<LevelErrors>, Cancelled> {
        let mut all = Vec::new();
        for (i, truth) in self.levels.iter().enumerate() {
            observer.check()?;
            let errors = |levels: &&[Grid<f32>]| truth.errors(&self.shaded(truth, &levels[truth.level]));
            let candidates = candidates.iter().map(errors).collect();
            all.push(LevelErrors { level: truth.level, candidates });
            observer.progress((i + 1) as f64 / self.levels.len() as f64);
        }
        Ok(all)
    }

    /// Pictures of a level by several roughness maps: each object in its room with its sun. None where the
    /// level is not judged, or black.
    #[must_use]
    pub fn views(&self, level: usize, candidates: &[&Grid<f32>]) -> Vec<View> {
        let Some(truth) = self.levels.iter().find(|truth| truth.level == level) else { return Vec::new() };
        let shaded: Vec<Vec<Lights>> = candidates.iter().map(|r| self.shaded(truth, r)).collect();
        let errors: Vec<[Errors; PICTURES]> = shaded.iter().map(|pixels| truth.errors(pixels)).collect();
        let view = |(i, Setting { name, .. }): (usize, &Setting)| {
            let which = 3 * i + 2;
            let shown = truth.pictures[which].as_ref()?;
            let displayed = |picture: &Picture| {
                let bytes = to_bytes(picture, shown.exposure);
                if *name == SPHERE { disk(&bytes) } else { bytes }
            };
            Some(View {
                object: name,
                truth: displayed(&shown.picture),
                shaded: shaded.iter().map(|pixels| displayed(&picture(pixels, which))).collect(),
                errors: errors.iter().map(|errors| errors[which]).collect(),
            })
        };
        OBJECTS.iter().enumerate().filter_map(view).collect()
    }

    /// Pixels of a level with one normal and one roughness each.
    fn shaded(&self, truth: &Truth, roughness: &Grid<f32>) -> Vec<Lights> {
        let stage = &*STAGE;
        let pixel = |i: usize| {
            let (x, y) = truth.texel(i);
            let n = unit_or_up(self.surface.mean(truth.level, x, y).normal).as_dvec3();
            stage.lights(&self.material, n, f64::from(roughness.row(y)[x]), i)
        };
        (0..SIDE * SIDE).into_par_iter().map(pixel).collect()
    }
}

/// Corner of the part of a level whose normals are spread most, among parts side by side.
fn busiest(surface: &RoughSurface, level: usize, size: Size, part: Size) -> (usize, usize) {
    let spread = |(x, y): (usize, usize)| -> f64 {
        let texels = (y..y + part.height).flat_map(|j| (x..x + part.width).map(move |i| (i, j)));
        texels.map(|(i, j)| f64::from(1.0 - surface.mean(level, i, j).normal.length())).sum()
    };
    let along = |whole: usize, part: usize| (0..=whole - part).step_by(part);
    let corners =
        along(size.height, part.height).flat_map(|y| along(size.width, part.width).map(move |x| (x, y)));
    let parts = corners.map(|corner| (spread(corner), corner));
    parts.max_by(|a, b| a.0.total_cmp(&b.0)).map_or((0, 0), |(_, corner)| corner)
}

impl Truth {
    fn new(surface: &RoughSurface, material: &EngineMaterial, (level, whole): (usize, Size)) -> Self {
        let size = Size { width: whole.width.min(SIDE), height: whole.height.min(SIDE) };
        let corner = busiest(surface, level, whole, size);
        // Every pixel reads its own samples, those of one texel too.
        let stride = surface.stride(whole, SAMPLES * whole.area() / (SIDE * SIDE));
        let mut truth = Self { level, size, corner, pictures: Vec::new() };
        let stage = &*STAGE;
        let pixel = |i: usize| {
            let mut lights = [0.0; PICTURES];
            surface.under(whole, truth.texel(i), stride, |weight, texel| {
                let seen = stage.lights(material, texel.normal.as_dvec3(), f64::from(texel.roughness), i);
                lights.iter_mut().zip(seen).for_each(|(sum, light)| *sum += f64::from(weight) * light);
            });
            lights
        };
        let pixels: Vec<Lights> = (0..SIDE * SIDE).into_par_iter().map(pixel).collect();
        truth.pictures = (0..PICTURES).into_par_iter().map(|which| shown(&pixels, which)).collect();
        truth
    }

    /// Texel of a pixel. Small levels repeat, as they would on a surface.
    fn texel(&self, pixel: usize) -> (usize, usize) {
        let (x, y) = (pixel % SIDE % self.size.width, pixel / SIDE % self.size.height);
        (self.corner.0 + x, self.corner.1 + y)
    }

    /// Errors of pixels in each light.
    fn errors(&self, pixels: &[Lights]) -> [Errors; PICTURES] {
        let of_picture = |which: usize| {
            let Some(truth) = &self.pictures[which] else { return Errors::default() };
            let picture = picture(pixels, which);
            Errors { relative_l2: relative_l2(&picture, &truth.picture), flip: truth.seen.mean(&picture) }
        };
        let each: Vec<Errors> = (0..PICTURES).into_par_iter().map(of_picture).collect();
        std::array::from_fn(|i| each[i])
    }
}

/// Picture of pixels in a light, grey.
fn picture(pixels: &[Lights], which: usize) -> Picture {
    Grid::from_fn(Size { width: SIDE, height: SIDE }, |x, y| Vec3::splat(pixels[y * SIDE + x][which] as f32))
}

fn shown(pixels: &[Lights], which: usize) -> Option<Shown> {
    let picture = picture(pixels, which);
    let mean = picture.texels().iter().map(|v| f64::from(v.x)).sum::<f64>() / (SIDE * SIDE) as f64;
    let exposure = (mean > 0.0).then(|| (MIDDLE / mean) as f32)?;
    Some(Shown { seen: FlipTruth::new(&picture, exposure), picture, exposure })
}

/// Place in the unit disk of a place in the square from -1 to 1, areas kept (Shirley and Chiu 1997): the
/// longer side is the radius, the other the angle from its axis, of an eighth of a turn.
fn disk_of_square(at: DVec2) -> DVec2 {
    let (u, v) = at.into();
    let (radius, angle) =
        if u.abs() > v.abs() { (u, FRAC_PI_4 * v / u) } else { (v, FRAC_PI_2 - FRAC_PI_4 * u / v) };
    radius * DVec2::from_angle(angle)
}

/// The way back of [`disk_of_square`].
fn square_of_disk(at: DVec2) -> DVec2 {
    let along = |longer: f64, other: f64| {
        let radius = at.length().copysign(longer);
        (radius, radius * (other / longer).atan() / FRAC_PI_4)
    };
    if at.x.abs() > at.y.abs() {
        along(at.x, at.y).into()
    } else {
        let (v, u) = along(at.y, at.x);
        DVec2::new(u, v)
    }
}

/// Picture of a sphere's square as its disk, on black.
fn disk(square: &Grid<[u8; 3]>) -> Grid<[u8; 3]> {
    let along = |i: usize| 2.0 * (i as f64 + 0.5) / SIDE as f64 - 1.0;
    let pixel = |v: f64| ((0.5 * (v + 1.0) * SIDE as f64) as usize).min(SIDE - 1);
    Grid::from_fn(square.size(), |x, y| {
        let at = DVec2::new(along(x), -along(y));
        if at.length() >= 1.0 {
            return [0; 3];
        }
        let DVec2 { x: u, y: v } = square_of_disk(at);
        square.row(pixel(-v))[pixel(u)]
    })
}

#[cfg(test)]
mod tests {
    use ndfmap_core::surface::{NormalGrid, Wraps};

    use super::*;

    #[test]
    fn the_disk_of_a_square_is_all_of_it_and_leads_back() {
        let along = |i: usize| 2.0 * (i as f64 + 0.5) / SIDE as f64 - 1.0;
        let mut quarter = 0;
        for i in 0..SIDE * SIDE {
            let at = DVec2::new(along(i % SIDE), along(i / SIDE));
            let disk = disk_of_square(at);
            // Some ten roundings.
            assert!(disk.length() < 1.0 && square_of_disk(disk).distance(at) < 1e-14, "{at} {disk}");
            quarter += usize::from(disk.length() < 0.5);
        }
        // Half the radius is a quarter of the area, and of the pixels.
        assert_eq!(quarter, SIDE * SIDE / 4);
    }

    #[test]
    fn a_flat_map_has_no_error_and_a_wider_lobe_has_one() {
        let size = Size { width: 8, height: 8 };
        let flat = NormalGrid { normals: Grid::from_fn(size, |_, _| Vec3::Z), wraps: Wraps::default() };
        let surface = RoughSurface::new(&flat, &Grid::from_fn(size, |_, _| 0.3)).unwrap();
        let judge =
            Judge::new(&surface, EngineMaterial::DIELECTRIC, &ndfmap_core::observe::Unobserved).unwrap();
        let levels = |roughness: f32| -> Vec<Grid<f32>> {
            surface.sizes().map(|size| Grid::from_fn(size, |_, _| roughness)).collect()
        };
        let (same, wider) = (levels(0.3), levels(0.5));
        for level in judge.errors(&[&same, &wider], &ndfmap_core::observe::Unobserved).unwrap() {
            let [same, wider] = level.candidates[..] else { panic!("two were asked for") };
            // Weights of a mean round.
            assert!(same.iter().all(|e| e.relative_l2 < 1e-6 && e.flip < 1e-6), "{same:?}");
            assert!(wider.iter().all(|e| e.relative_l2 > 0.01), "{wider:?}");
        }
        let views = judge.views(1, &[&same[1], &wider[1]]);
        assert_eq!(views.iter().map(|view| view.object).collect::<Vec<_>>(), ["sphere", "floor"]);
        assert_eq!(views[0].truth.texels(), views[0].shaded[0].texels());
    }
}
