//! Brute force: the pixels of a normal-mapped scene by many rays, with the map as it is.
//!
//! Each ray shades one texel of the finest level, without masking or shadowing, so that a pixel tends to the
//! plain mean of the BRDF over its footprint. Between texels the map is the bilinear mix of the *reflected
//! light* of the texels, as texture units filter level 0: a ray takes the texel under a point displaced by up
//! to half a texel either way, which has that mean. Nothing here uses `ndfmap_core::ndf`. `environment.rs`
//! samples an environment's light.

mod environment;

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DMat3, DVec2, DVec3, Vec3};
use ndfmap_core::brdf::{Directions, ShadingModel, SurfaceParams};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::Light;
use ndfmap_core::observe::{Cancelled, Forward, Observer};
use ndfmap_core::surface::{SurfaceRow, Wraps, normal_of_slope, slope_of_normal};
use ndfmap_scene::metrics::{Picture, relative_l2};
use ndfmap_scene::{Camera, Effort, Material, Rays, Scene, TruePicture};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use self::environment::{LitFacet, Numbers, SampledEnvironment};
use crate::displacement::{DisplacedMeshes, Facet};
use crate::geometry::{Geometry, Place};
use crate::{drift, incident_directions};

/// Strata a pixel is cut into on each axis; every pass sends a ray through each.
const STRATA: usize = 4;

/// Rays a pixel in the least truth: one pass for each of the two halves whose difference is the noise.
pub const LEAST_RAYS: usize = 2 * STRATA * STRATA;

/// Normals of the finest level, and the material they belong to.
struct Finest<'a> {
    material: &'a Material,
    normals: Grid<Vec3>,
    wraps: Wraps,
}

impl Finest<'_> {
    /// The texel `displaced` (in texels) from a place.
    fn texel(&self, uv: DVec2, displaced: DVec2) -> (usize, usize) {
        let size = self.normals.size();
        let at = uv * DVec2::new(size.width as f64, size.height as f64) + displaced;
        (
            self.wraps.x.index(at.x.floor() as isize, size.width),
            self.wraps.y.index(at.y.floor() as isize, size.height),
        )
    }

    /// Surface parameters of a texel.
    fn finish(&self, x: usize, y: usize) -> SurfaceParams {
        let own = self.material.params;
        self.material.textures.as_ref().map_or(own, |map| map.at(x, y, own.specular))
    }
}

/// A scene, ready to be rendered by brute force.
pub struct Truth<'a> {
    scene: &'a Scene,
    geometry: &'a Geometry,
    /// Displaced meshes of the scene; the rest is in `geometry`.
    displacement: Option<&'a DisplacedMeshes>,
    materials: Vec<Finest<'a>>,
    environment: Option<SampledEnvironment<'a>>,
}

impl<'a> Truth<'a> {
    /// Reads the maps.
    #[must_use]
    pub fn new(scene: &'a Scene, geometry: &'a Geometry) -> Self {
        let finest = |material: &'a Material| {
            let surface = &*material.map;
            let mut row = SurfaceRow::flat(surface.size().width);
            let normals = Grid::from_fn(surface.size(), |x, y| {
                if x == 0 {
                    surface.read_row(y, &mut row);
                }
                row.normal(x)
            });
            Finest { material, normals, wraps: surface.wraps() }
        };
        let materials = scene.materials.iter().map(finest).collect();
        Self {
            scene,
            geometry,
            displacement: None,
            materials,
            environment: scene.environment.as_ref().map(SampledEnvironment::new),
        }
    }

    /// Reads the maps of a displaced scene: rays hit displaced meshes by the facets of `displacement`, and
    /// the others by `geometry`.
    #[must_use]
    pub fn displaced(scene: &'a Scene, geometry: &'a Geometry, displacement: &'a DisplacedMeshes) -> Self {
        Self { displacement: Some(displacement), ..Self::new(scene, geometry) }
    }

    /// Renders until the effort is spent.
    ///
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn render(
        &self,
        camera: &Camera,
        size: Size,
        effort: &Effort,
        observer: &dyn Observer,
    ) -> Result<TruePicture, Cancelled> {
        let observer = Forward::new(observer);
        let rays = camera.rays(size);
        let passes = effort.rays.div_ceil(LEAST_RAYS).max(1);
        let mut halves = [vec![DVec3::ZERO; size.area()], vec![DVec3::ZERO; size.area()]];
        let mut done = 0;
        loop {
            // Doubling, so that looking at the noise costs little.
            let more = if effort.noise > 0.0 { done.max(1).min(passes - done) } else { passes - done };
            for (half, sums) in halves.iter_mut().enumerate() {
                let whole = 2 * passes;
                let before = 2 * done + half * more;
                let rows = AtomicUsize::new(0);
                sums.par_chunks_mut(size.width).enumerate().try_for_each(|(y, row)| {
                    observer.check()?;
                    for (x, sum) in row.iter_mut().enumerate() {
                        for pass in done..done + more {
                            let stream = [effort.seed, (2 * pass + half) as u64, (y * size.width + x) as u64];
                            *sum += self.pass(&rays, DVec2::new(x as f64, y as f64), stream);
                        }
                    }
                    let rows = rows.fetch_add(1, Ordering::Relaxed) + 1;
                    let part = rows as f64 / size.height as f64;
                    observer.progress((before as f64 + part * more as f64) / whole as f64);
                    Ok(())
                })?;
            }
            done += more;
            let scale = |sum: &DVec3, passes: usize| (*sum / (passes * STRATA * STRATA) as f64).as_vec3();
            let whole: Vec<DVec3> = halves[0].iter().zip(&halves[1]).map(|(a, b)| *a + *b).collect();
            let picture =
                |sums: &[DVec3], passes| Grid::from_fn(size, |x, y| scale(&sums[y * size.width + x], passes));
            let picture_of_all = picture(&whole, 2 * done);
            // Half the difference of two halves has the spread of their mean.
            let [a, b] = [0, 1].map(|half| picture(&halves[half], done));
            let noise = relative_l2(&a, &b) / 2.0;
            if done == passes || noise <= effort.noise {
                observer.progress(1.0);
                return Ok(TruePicture { picture: picture_of_all, rays: done * LEAST_RAYS, noise });
            }
        }
    }

    /// The truth in every frame of a drift, twice, from independent rays: the mean of the two is the truth,
    /// and half of their difference is its noise. `rays` are those of one pixel in one frame, in both
    /// together; 512 at least.
    ///
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn drift(
        &self,
        camera: &Camera,
        size: Size,
        rays: usize,
        observer: &dyn Observer,
    ) -> Result<[Vec<Picture>; 2], Cancelled> {
        let observer = Forward::new(observer);
        let cell_rays = drift::cell_camera(camera, size).rays(drift::cells(size));
        let each = rays.div_ceil(2 * drift::CELLS).max(1);
        let done = AtomicUsize::new(0);
        let band = |half: u64, first: usize| {
            observer.check()?;
            let rows = drift::BAND.min(size.height - first);
            let part = Size { height: rows, ..size };
            let Size { width, height } = drift::cells(part);
            let cell = |i: usize| {
                let (x, y) = (i % width, first * drift::STEPS + i / width);
                let mut random = Pcg64Mcg::seed_from_u64(mix([half, y as u64, x as u64]));
                let corner = DVec2::new(x as f64, y as f64);
                let mut ray = || {
                    let numbers = self.environment.as_ref().map(|_| random.random()).unwrap_or_default();
                    self.ray(&cell_rays, (corner, 1.0), environment::numbers(numbers, 0), &mut random)
                };
                (0..each).map(|_| ray()).sum::<DVec3>() / each as f64
            };
            let cells: Vec<DVec3> = (0..width * height).map(cell).collect();
            let rows = done.fetch_add(rows, Ordering::Relaxed) + rows;
            observer.progress(rows as f64 / (2 * size.height) as f64);
            Ok(drift::frames(&cells, part))
        };
        let firsts: Vec<usize> = (0..size.height).step_by(drift::BAND).collect();
        let half = |half: u64| {
            let bands: Vec<Vec<Picture>> =
                firsts.par_iter().map(|first| band(half, *first)).collect::<Result<_, Cancelled>>()?;
            let row = |frame: usize, y: usize| bands[y / drift::BAND][frame].row(y % drift::BAND);
            let frame = |frame| Grid::from_fn(size, |x, y| row(frame, y)[x]);
            Ok((0..drift::DRIFT_FRAMES).map(frame).collect())
        };
        Ok([half(0)?, half(1)?])
    }

    /// Sum over one ray through each stratum of a pixel.
    fn pass(&self, rays: &Rays, pixel: DVec2, stream: [u64; 3]) -> DVec3 {
        let mut random = Pcg64Mcg::seed_from_u64(mix(stream));
        // The pixel's own start of the numbers, the same for all passes of one half.
        let [seed, pass, at] = stream;
        let begin = || Pcg64Mcg::seed_from_u64(mix([!seed, pass % 2, at])).random();
        let begin = self.environment.as_ref().map(|_| begin()).unwrap_or_default();
        let first = (pass / 2) as usize * STRATA * STRATA;
        let mut sum = DVec3::ZERO;
        for i in 0..STRATA * STRATA {
            let stratum = DVec2::new((i % STRATA) as f64, (i / STRATA) as f64) / STRATA as f64;
            let numbers = environment::numbers(begin, first + i);
            sum += self.ray(rays, (pixel + stratum, 1.0 / STRATA as f64), numbers, &mut random);
        }
        sum
    }

    /// Light along a ray through a square of the picture: its corner and width are in pixels.
    fn ray(
        &self,
        rays: &Rays,
        (corner, width): (DVec2, f64),
        numbers: Numbers,
        random: &mut Pcg64Mcg,
    ) -> DVec3 {
        let [u, v, s, t]: [f64; 4] = random.random();
        let direction = rays.direction(corner + DVec2::new(u, v) * width);
        let plain = self.geometry.hit(rays.eye, direction);
        let limit = plain.map_or(f64::INFINITY, |hit| hit.distance);
        if let Some(displacement) = self.displacement
            && let Some(hit) = displacement.hit(rays.eye, direction, limit)
        {
            let facet = displacement.facet(&hit, direction);
            return self.shade_facet(&facet, -direction, (DVec2::new(s, t) - 0.5, numbers));
        }
        match plain {
            Some(hit) => {
                let place = self.geometry.place(&hit, direction, false);
                self.shade(&place, -direction, (DVec2::new(s, t) - 0.5, numbers))
            }
            None => self.scene.background.as_dvec3(),
        }
    }

    /// Light that a displaced facet sends to the eye, with the surface parameters of the texel `displaced`
    /// from it. Where facets shade each other, a light that is hidden from the facet adds nothing.
    fn shade_facet(&self, facet: &Facet, eye: DVec3, (displaced, numbers): (DVec2, Numbers)) -> DVec3 {
        let finest = &self.materials[facet.material];
        let (x, y) = finest.texel(facet.uv, displaced);
        let (brdf, params) = (&finest.material.brdf, finest.finish(x, y));
        let (tangent, bitangent) = facet.normal.any_orthonormal_pair();
        let frame = DMat3::from_cols(tangent, bitangent, facet.normal);
        let wo = frame.transpose() * eye;
        let of = |light: &Light| {
            let (towards, irradiance) = light.seen_from(facet.position);
            let Some(directions) = Directions::between(frame.transpose() * towards, wo) else {
                return DVec3::ZERO;
            };
            if brdf.shading == ShadingModel::Shadowed
                && (directions.wi.z <= 0.0 || self.in_shadow(facet, light))
            {
                return DVec3::ZERO;
            }
            irradiance * brdf.true_facet(DVec3::Z, &params, &directions)
        };
        let direct: DVec3 = self.scene.lights.iter().map(of).sum();
        let shown = LitFacet { frame, wo, n: DVec3::Z, params: &params, brdf };
        let shadows = brdf.shading == ShadingModel::Shadowed;
        let open = |wi: DVec3| {
            // A light like any other, of which only the direction counts.
            let light = || Light::Directional { towards: frame * wi, irradiance: DVec3::ONE };
            !shadows || (wi.z > 0.0 && !self.in_shadow(facet, &light()))
        };
        direct
            + self
                .environment
                .as_ref()
                .map_or(DVec3::ZERO, |environment| environment.light(&shown, open, numbers))
    }

    /// True where something stands between a facet and a light.
    fn in_shadow(&self, facet: &Facet, light: &Light) -> bool {
        let Some(displacement) = self.displacement else { return false };
        let from = facet.position + facet.normal * (LIFT * displacement.radius());
        let (towards, _) = light.seen_from(from);
        let reach = match light {
            Light::Directional { .. } => f64::INFINITY,
            Light::Point { at, .. } => at.distance(from),
        };
        displacement.hit(from, towards, reach).is_some()
            || self.geometry.hit(from, towards).is_some_and(|hit| hit.distance < reach)
    }

    /// Light that the texel `displaced` (in texels) from a place sends to the eye.
    fn shade(&self, place: &Place, eye: DVec3, (displaced, numbers): (DVec2, Numbers)) -> DVec3 {
        let finest = &self.materials[place.material];
        let (x, y) = finest.texel(place.uv, displaced);
        let (material, params) = (finest.material, finest.finish(x, y));
        let n = finest.normals.row(y)[x];
        // Heights that displace nothing: their slopes as they lie on the mesh.
        let n = match place.stretch {
            Some(by) => normal_of_slope((by * slope_of_normal(n).as_dvec2()).as_vec2()).as_dvec3(),
            None => n.as_dvec3(),
        };
        let wo = place.frame.transpose() * eye;
        let brdf = &material.brdf;
        let direct: DVec3 =
            incident_directions(&self.scene.lights, (place.position, place.frame), wo, Directions::new)
                .map(|(directions, irradiance)| irradiance * brdf.true_facet(n, &params, &directions))
                .sum();
        let shown = LitFacet { frame: place.frame, wo, n, params: &params, brdf };
        direct
            + self
                .environment
                .as_ref()
                .map_or(DVec3::ZERO, |environment| environment.light(&shown, |_| true, numbers))
    }
}

/// Distance off the surface at which a shadow ray starts, as a fraction of the scene's size.
const LIFT: f64 = 1e-7;

/// Seed made of several numbers (the finaliser of SplitMix64, Steele et al. 2014, over a running sum).
fn mix(stream: [u64; 3]) -> u64 {
    stream.iter().fold(0, |state: u64, value| {
        let mut z = (state ^ value).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}
