//! Judge of roughness mips: each level as an engine shades it, beside the mean of the level's own normals.
//!
//! A texel of a level is a pixel that sees it at that distance. Its truth is the engine's shading of every
//! normal under it; stock and fixed materials are the engine's shading of one normal and one roughness. No
//! filter of an engine is in it, and no geometry: what is judged is the bake alone.

use std::sync::LazyLock;

use glam::{DVec3, Vec3};
use ndfmap_core::brdf::{AnyLobe, Brdf, Directions, Ggx, Microfacets, ShadingModel};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::SplitSum;
use ndfmap_core::light::environment::{FilteredEnvironment, Technique, builtin};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::roughness::{EngineMaterial, LEAST_ROUGHNESS, RoughSurface};
use ndfmap_core::surface::unit_or_up;
use ndfmap_core::units::{PerceptualRoughness, SlopeVariance};
use ndfmap_scene::metrics::{Picture, flip, relative_l2};
use rayon::prelude::*;
use serde::Serialize;

/// Pixels on a side of a level's picture: the busiest part of large levels, and small ones repeated.
const SIDE: usize = 64;

/// Samples that the truth of a picture reads.
const SAMPLES: usize = 1 << 18;

/// Brightness of a picture's mean on the display: its exposure is this over the truth's mean.
const MIDDLE: f64 = 0.3;

/// Angles of the eye to the surface's normal, in degrees.
const EYES: [f64; 3] = [10.0, 45.0, 70.0];

/// Angles of a sun's half-vector to the surface's normal, and its azimuths, in degrees.
const SUNS: [(f64, f64); 2] = [(5.0, 40.0), (25.0, 200.0)];

/// Environments, by their names.
const ROOMS: [&str; 2] = ["studio", "sky"];

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

/// Errors of a level: means over eyes and lights.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelErrors {
    /// Level, 0 the finest.
    pub level: usize,
    /// Errors of each candidate, in order.
    pub candidates: Vec<Errors>,
}

/// An eye, and what lights the surface.
struct Setting<'a> {
    wo: DVec3,
    sun: Option<(Directions, f64)>,
    room: Option<&'a Room>,
}

/// Environment, as engines look it up: cubes that GGX facets have blurred, times what the lobe reflects of a
/// white sky.
struct Room {
    filtered: FilteredEnvironment,
    /// Mean radiance.
    mean: f64,
}

/// Every room, blurred once: many materials are judged in the same.
static BUILT_ROOMS: LazyLock<Vec<Room>> =
    LazyLock::new(|| ROOMS.iter().filter_map(|name| Room::new(name)).collect());

impl Room {
    fn new(name: &str) -> Option<Self> {
        let environment = builtin::find(name)?.build();
        let filtered = FilteredEnvironment::new(&environment);
        filtered.make(Technique::Prefiltered, Microfacets::Ggx);
        let texels = filtered.radiance.texels(filtered.radiance.levels() - 1);
        let mean = texels.iter().map(|v| f64::from(v.element_sum()) / 3.0).sum::<f64>() / texels.len() as f64;
        Some(Self { filtered, mean })
    }

    /// Light of a normal.
    fn lit(&self, engine: &Engine, n: DVec3, wo: DVec3, roughness: f64) -> f64 {
        let Engine { material, lobe } = engine;
        let width = SlopeVariance::clamped(roughness.max(LEAST_ROUGHNESS).powi(4) / 2.0);
        let eye = n.dot(wo).clamp(0.0, 1.0);
        let cube = self.filtered.prefiltered(Microfacets::Ggx);
        // Up is y in an environment, and out of the surface here.
        let turned = |w: DVec3| DVec3::new(w.x, w.z, -w.y);
        let grey = |v: DVec3| v.element_sum() / 3.0;
        let seen =
            grey(cube.lookup(turned(2.0 * eye * n - wo), Microfacets::level(width, 1.0, cube.levels())));
        let reflected = lobe.lookup(eye, width);
        let specular = seen * (material.specular * grey(reflected.scale) + reflected.bias);
        if material.diffuse == 0.0 {
            return specular;
        }
        let irradiance = self.filtered.irradiance.of_normals(turned(n), 0.0, false);
        specular + (1.0 - material.specular) * material.diffuse / std::f64::consts::PI * grey(irradiance)
    }
}

/// Every eye in every light: suns, rooms, and rooms that a sun shines into.
fn settings(rooms: &[Room]) -> Vec<Setting<'_>> {
    let spherical = |angle: f64, azimuth: f64| {
        let (sin, cos) = angle.to_radians().sin_cos();
        let (y, x) = azimuth.to_radians().sin_cos();
        DVec3::new(sin * x, sin * y, cos)
    };
    let mut settings = Vec::new();
    for angle in EYES {
        let wo = spherical(angle, 0.0);
        for ((tilt, azimuth), room) in SUNS.into_iter().zip(rooms) {
            let wh = spherical(tilt, azimuth);
            let path = Directions::between(2.0 * wh.dot(wo) * wh - wo, wo);
            let sun = |irradiance: f64| path.map(|path| (path, irradiance));
            settings.push(Setting { wo, sun: sun(1.0), room: None });
            settings.push(Setting { wo, sun: None, room: Some(room) });
            settings.push(Setting { wo, sun: sun(SUN_IN_ROOM * room.mean), room: Some(room) });
        }
    }
    settings
}

/// Errors of several sets of roughness mips on one surface, level by level from the first that is filtered;
/// every set has the surface's levels. They are shaded with the mean normals of an engine's own mips.
///
/// # Errors
/// [`Cancelled`] when the observer wants it to end.
///
/// # Panics
/// When a set has fewer levels than the surface.
pub fn judge(
    surface: &RoughSurface,
    material: EngineMaterial,
    candidates: &[&[Grid<f32>]],
    observer: &dyn Observer,
) -> Result<Vec<LevelErrors>, Cancelled> {
    let settings = settings(&BUILT_ROOMS);
    let facets =
        Brdf::new(AnyLobe::from(Ggx::new(PerceptualRoughness::SMOOTHEST.into())), ShadingModel::Smith);
    let engine = Engine { material, lobe: SplitSum::new(&facets) };
    let mut levels = Vec::new();
    let last = surface.sizes().len() - 1;
    for level in 1..=last {
        observer.check()?;
        let of_level: Vec<&Grid<f32>> = candidates.iter().map(|levels| &levels[level]).collect();
        let pictures = Pictures::shade(surface, &engine, &settings, level, &of_level);
        levels.push(LevelErrors { level, candidates: pictures.errors() });
        observer.progress(level as f64 / last as f64);
    }
    Ok(levels)
}

/// Shading of an engine.
struct Engine {
    material: EngineMaterial,
    /// Share of a white sky that a lobe reflects.
    lobe: SplitSum,
}

impl Engine {
    fn lit(&self, n: DVec3, roughness: f64, setting: &Setting<'_>) -> f64 {
        let sun = setting.sun.map_or(0.0, |(path, power)| power * self.material.shade(n, roughness, &path));
        let room = setting.room.map_or(0.0, |room| room.lit(self, n, setting.wo, roughness));
        sun + room
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

/// Pictures of a level for each setting, grey.
struct Pictures {
    size: Size,
    /// By pixel, then setting, then the truth and the candidates.
    values: Vec<Vec<Vec<f64>>>,
}

impl Pictures {
    fn shade(
        surface: &RoughSurface,
        engine: &Engine,
        settings: &[Setting<'_>],
        level: usize,
        candidates: &[&Grid<f32>],
    ) -> Self {
        let whole = candidates[0].size();
        let size = Size { width: whole.width.min(SIDE), height: whole.height.min(SIDE) };
        let corner = busiest(surface, level, whole, size);
        // The whole level may be larger than the part of it that is seen.
        let stride = surface.stride(whole, SAMPLES * whole.area() / size.area());
        let pixel = |i: usize| -> Vec<Vec<f64>> {
            let (x, y) = (corner.0 + i % size.width, corner.1 + i / size.width);
            let mut samples = Vec::new();
            surface.under(whole, (x, y), stride, |weight, texel| {
                samples.push((f64::from(weight), texel.normal.as_dvec3(), f64::from(texel.roughness)));
            });
            let n = unit_or_up(surface.mean(level, x, y).normal).as_dvec3();
            let of_setting = |setting: &Setting<'_>| {
                let truth = samples.iter().map(|(weight, n, r)| weight * engine.lit(*n, *r, setting)).sum();
                let shaded = candidates.iter().map(|r| engine.lit(n, f64::from(r.row(y)[x]), setting));
                std::iter::once(truth).chain(shaded).collect()
            };
            settings.iter().map(of_setting).collect()
        };
        Self { size, values: (0..size.area()).into_par_iter().map(pixel).collect() }
    }

    /// Mean errors of each candidate.
    fn errors(&self) -> Vec<Errors> {
        let settings = self.values[0].len();
        let count = self.values[0][0].len() - 1;
        // Small levels fill the picture by repeating, as they would on a surface.
        let picture = |setting: usize, which: usize| -> Picture {
            Grid::from_fn(Size { width: SIDE, height: SIDE }, |x, y| {
                let at = y % self.size.height * self.size.width + x % self.size.width;
                Vec3::splat(self.values[at][setting][which] as f32)
            })
        };
        let of_setting = |setting: usize| -> Vec<Errors> {
            let truth = picture(setting, 0);
            let mean = truth.texels().iter().map(|v| f64::from(v.x)).sum::<f64>() / (SIDE * SIDE) as f64;
            if mean <= 0.0 {
                return vec![Errors::default(); count];
            }
            let exposure = (MIDDLE / mean) as f32;
            let errors = |which: usize| {
                let shaded = picture(setting, which);
                Errors { relative_l2: relative_l2(&shaded, &truth), flip: flip(&shaded, &truth, exposure) }
            };
            (1..=count).map(errors).collect()
        };
        let each: Vec<Vec<Errors>> = (0..settings).into_par_iter().map(of_setting).collect();
        let mean = |pick: fn(&Errors) -> f64, which: usize| {
            each.iter().map(|errors| pick(&errors[which])).sum::<f64>() / settings as f64
        };
        (0..count)
            .map(|i| Errors { relative_l2: mean(|e| e.relative_l2, i), flip: mean(|e| e.flip, i) })
            .collect()
    }
}
