//! Shading through a representation: one look-up a pixel, as wide as the pixel's reach on the map.
//!
//! A pixel whose neighbours show another surface than its own is cut into 4 × 4 parts that are shaded apart,
//! each at its own reach, as a rasteriser's multisampling would have it: the measure is for the filtering of
//! maps, not of outlines.

mod baked;

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DMat3, DVec2, DVec3, Vec3};
use ndfmap_core::brdf::Directions;
use ndfmap_core::compact::Storage;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::environment::SceneEnvironment;
use ndfmap_core::light::{Light, SplitSum};
use ndfmap_core::lookup::{Lookups, PixelFootprint};
use ndfmap_core::ndf::{AnyMethod, IncidentLight, LocalEnvironment, PreparedBrdf};
use ndfmap_core::observe::{Cancelled, Forward, Observer};
use ndfmap_scene::metrics::Picture;
use ndfmap_scene::{Camera, Material, Rays, Scene};
use rayon::prelude::*;

use self::baked::{Baked, Shading};
use crate::geometry::{Geometry, Hit, Place};
use crate::incident_directions;

/// Parts that a pixel with an outline in it is cut into, on each axis.
const PARTS: usize = 4;

/// The maps of a scene's materials, baked with one method. Camera, lights, BRDFs, models and meshes may
/// change afterwards. Textures are baked too: a material that gets some afterwards keeps the colour of its
/// parameters.
pub struct BakedMaps {
    method: AnyMethod,
    materials: Vec<Baked>,
}

impl BakedMaps {
    /// Bakes every material's map.
    ///
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn new(
        materials: &[Material],
        method: &AnyMethod,
        storage: impl Into<Storage>,
        observer: &dyn Observer,
    ) -> Result<Self, Cancelled> {
        let (count, storage) = (materials.len() as f64, storage.into());
        let bake = |(i, material)| {
            let part = observer.part(i as f64 / count, (i + 1) as f64 / count);
            Baked::new(material, method, storage, &part)
        };
        let materials = materials.iter().enumerate().map(bake).collect::<Result<_, _>>()?;
        Ok(Self { method: method.clone(), materials })
    }
}

/// A scene that is rendered through baked maps.
pub struct Filtered<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Triangles of the scene.
    pub geometry: &'a Geometry,
    /// Baked maps of its materials.
    pub maps: &'a BakedMaps,
}

/// Rows that are worked out together.
const BAND: usize = 16;

/// Data that all pixels share.
#[derive(Clone, Copy)]
struct How<'a> {
    lookups: Lookups,
    /// For each material.
    prepared: &'a [PreparedBrdf],
    around: Option<&'a EnvironmentShading<'a>>,
}

/// Environment that a scene stands in, with the split sums of its materials.
struct EnvironmentShading<'a> {
    environment: &'a SceneEnvironment,
    to_environment: DMat3,
    suns: Vec<Light>,
    /// For each material.
    split_sums: Vec<SplitSum>,
}

impl<'a> EnvironmentShading<'a> {
    fn new(environment: &'a SceneEnvironment, materials: &[Material]) -> Self {
        let split_sums: Vec<SplitSum> = materials.iter().map(|m| SplitSum::new(&m.brdf)).collect();
        split_sums.iter().for_each(|s| environment.filtered.make(environment.technique, s.microfacets));
        let (to_environment, suns) = (environment.to_environment(), environment.suns());
        Self { environment, to_environment, suns, split_sums }
    }

    /// Environment as a place sees it.
    fn at(&self, place: &Place, wo: DVec3) -> LocalEnvironment<'_> {
        LocalEnvironment {
            light: &self.environment.filtered,
            technique: self.environment.technique,
            to_environment: self.to_environment * place.frame,
            wo,
            split_sum: &self.split_sums[place.material],
        }
    }
}

/// Room for a pixel's channels.
struct Scratch {
    channels: Vec<f32>,
    lights: Vec<IncidentLight>,
}

impl Filtered<'_> {
    /// Renders a picture.
    ///
    /// # Errors
    /// [`Cancelled`] by the observer.
    pub fn render(
        &self,
        camera: &Camera,
        size: Size,
        lookups: Lookups,
        observer: &dyn Observer,
    ) -> Result<Picture, Cancelled> {
        let observer = Forward::new(observer);
        let rays = camera.rays(size);
        let prepare = |m: &Material| self.maps.method.prepare(&m.brdf, m.params.roughness);
        let prepared: Vec<PreparedBrdf> = self.scene.materials.iter().map(prepare).collect();
        let around =
            self.scene.environment.as_ref().map(|s| EnvironmentShading::new(s, &self.scene.materials));
        let how = How { lookups, prepared: &prepared, around: around.as_ref() };
        let done = AtomicUsize::new(0);
        let band = |first: usize| {
            observer.check()?;
            let band = self.band(&rays, size, first, how);
            let rows = done.fetch_add(BAND, Ordering::Relaxed) + BAND;
            observer.progress((rows as f64 / size.height as f64).min(1.0));
            Ok(band)
        };
        let bands: Vec<usize> = (0..size.height).step_by(BAND).collect();
        let bands: Vec<Vec<Vec3>> = bands.into_par_iter().map(band).collect::<Result<_, Cancelled>>()?;
        Ok(Grid::from_vec(size, bands.concat()).unwrap_or_else(|| unreachable!("one colour a pixel")))
    }

    /// The rows from `first` on, [`BAND`] at most.
    fn band(&self, rays: &Rays, size: Size, first: usize, how: How<'_>) -> Vec<Vec3> {
        let last = (first + BAND).min(size.height);
        // Outlines are seen from a pixel's neighbours, so a row more is looked at above and below.
        let seen = first.saturating_sub(1)..(last + 1).min(size.height);
        let centre = |x: usize, y: usize| DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let pixels = seen.clone().flat_map(|y| (0..size.width).map(move |x| (x, y)));
        let hits: Vec<Option<(Hit, Place)>> = pixels.map(|(x, y)| self.look(rays, centre(x, y))).collect();
        let height = seen.len();
        let mut scratch = Scratch { channels: Vec::new(), lights: Vec::new() };
        let mut colours = Vec::with_capacity((last - first) * size.width);
        for y in first..last {
            for x in 0..size.width {
                let i = (y - seen.start) * size.width + x;
                let colour = if outline(&hits, Size { height, ..size }, i) {
                    self.parts(rays, centre(x, y), how, &mut scratch)
                } else {
                    self.shade(rays, hits[i].as_ref(), (centre(x, y), 1.0), (how, &mut scratch))
                };
                colours.push(colour.as_vec3());
            }
        }
        colours
    }

    fn look(&self, rays: &Rays, at: DVec2) -> Option<(Hit, Place)> {
        let direction = rays.direction(at);
        let hit = self.geometry.hit(rays.eye, direction)?;
        Some((hit, self.geometry.place(&hit, direction, self.maps.method.knows_displacement())))
    }

    /// A pixel as the mean of its parts.
    fn parts(&self, rays: &Rays, centre: DVec2, how: How<'_>, scratch: &mut Scratch) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for i in 0..PARTS * PARTS {
            let part = DVec2::new((i % PARTS) as f64, (i / PARTS) as f64);
            let at = centre + (part + 0.5) / PARTS as f64 - 0.5;
            let hit = self.look(rays, at);
            sum += self.shade(rays, hit.as_ref(), (at, 1.0 / PARTS as f64), (how, scratch));
        }
        sum / (PARTS * PARTS) as f64
    }

    /// Light that comes from a hit (or from where nothing is hit), for a pixel at `at` that is `width` pixels
    /// wide.
    fn shade(
        &self,
        rays: &Rays,
        hit: Option<&(Hit, Place)>,
        (at, width): (DVec2, f64),
        (how, scratch): (How<'_>, &mut Scratch),
    ) -> DVec3 {
        let Some((hit, place)) = hit else { return self.scene.background.as_dvec3() };
        let wo = place.frame.transpose() * -rays.direction(at);
        scratch.lights.clear();
        let slope_map = place.stretch.filter(|_| self.maps.method.knows_displacement());
        let between = if slope_map.is_some() { Directions::between } else { Directions::new };
        let of_scene = incident_directions(&self.scene.lights, (place.position, place.frame), wo, between);
        let lit = |(directions, irradiance)| IncidentLight { directions, irradiance };
        scratch.lights.extend(of_scene.map(lit));
        let local = how.around.map(|around| {
            // Normals also see the part of an environment that is below the base surface.
            let suns =
                incident_directions(&around.suns, (place.position, place.frame), wo, Directions::between);
            scratch.lights.extend(suns.map(lit));
            around.at(place, wo)
        });
        if scratch.lights.is_empty() && local.is_none() {
            return DVec3::ZERO;
        }
        let [dx, dy] = self.geometry.differentials(hit, place, rays, at);
        let pixel = PixelFootprint { uv: place.uv, duv_dx: dx * width, duv_dy: dy * width };
        let shading = Shading {
            material: &self.scene.materials[place.material],
            method: &*self.maps.method,
            prepared: &how.prepared[place.material],
            slope_map,
            local,
        };
        let Scratch { channels, lights } = scratch;
        self.maps.materials[place.material].shade(&shading, &pixel, how.lookups, (channels, lights))
    }
}

/// True where a pixel beside this one shows something other than the continuation of this one's surface.
fn outline(hits: &[Option<(Hit, Place)>], size: Size, i: usize) -> bool {
    let (x, y) = (i % size.width, i / size.width);
    let around = [
        (x > 0).then(|| i - 1),
        (x + 1 < size.width).then(|| i + 1),
        (y > 0).then(|| i - size.width),
        (y + 1 < size.height).then(|| i + size.width),
    ];
    around.into_iter().flatten().any(|j| match (&hits[i], &hits[j]) {
        (None, None) => false,
        (Some((hit, a)), Some((_, b))) => {
            // Off the plane of the face by more than a twentieth of the distance, or turned by more than 60
            // degrees.
            let off = (b.position - a.position).dot(a.face).abs() > 0.05 * hit.distance;
            a.object != b.object || off || a.face.dot(b.face) < 0.5
        }
        _ => true,
    })
}
