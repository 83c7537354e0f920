//! ndfmap-scene: scenes as data: a camera, meshes with materials, lights; the table of built-in ones; and how
//! far pictures of them are apart ([`metrics`]).
//!
//! World: right-handed, y up, no unit. A scene that moves is a function of time, 0 to 1; nothing else is kept
//! between frames. [`TABLE`] has one row for each built-in scene, and the tests at the end of this file run
//! over its rows.

mod armour;
mod baked;
mod camera;
mod cloth;
mod creature;
mod desert;
mod disk;
mod displacement;
mod foil;
mod material;
mod mesh;
pub mod metrics;
mod noise_sphere;
mod plane;
mod sphere;
pub mod tessellation;
pub mod tone;
mod truth;
mod v_groove;

pub use self::truth::{Effort, TruePicture};
pub use baked::{BakedMaterial, BakedSurface};
pub use camera::{Camera, Rays};
pub use displacement::Displacement;
pub use material::{Material, MaterialMap, SurfaceTextures};
pub use mesh::{Mesh, Vertex, area_normals};

use std::sync::Arc;

use glam::{DVec3, Vec3};

use ndfmap_core::brdf::{self, AnyLobe, Argument, Brdf, Lobe, ShadingModel, SurfaceParams};
use ndfmap_core::grid::Size;
use ndfmap_core::light::Light;
use ndfmap_core::light::environment::SceneEnvironment;
use ndfmap_core::procedural;
use ndfmap_core::units::SlopeVariance;

/// A mesh of one material.
#[derive(Clone, Debug)]
pub struct Object {
    /// Shape of the object.
    pub mesh: Arc<Mesh>,
    /// Index into the scene's materials.
    pub material: usize,
}

/// All that a picture shows.
pub struct Scene {
    /// Camera that sees the scene.
    pub camera: Camera,
    /// Objects of the scene.
    pub objects: Vec<Object>,
    /// Materials of the objects.
    pub materials: Vec<Material>,
    /// Lights of the scene.
    pub lights: Vec<Light>,
    /// Light from everywhere. It reaches every normal from all directions that face it, even from below the
    /// base surface.
    pub environment: Option<SceneEnvironment>,
    /// Radiance where nothing is hit, linear RGB.
    pub background: Vec3,
    /// Display values are sRGB of radiance times this.
    pub exposure: f32,
}

/// Options of a built-in scene.
#[derive(Clone)]
pub struct SceneOptions {
    /// Time, 0 to 1.
    pub time: f64,
    /// Size of built-in maps.
    pub map_size: Size,
    /// A map for the scene's first material, in place of its own.
    pub map: Option<MaterialMap>,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self { time: 0.0, map_size: Size { width: 512, height: 512 }, map: None }
    }
}

impl SceneOptions {
    /// The map of the first material: the one given, or a built-in one.
    fn first_map(&self, own: &str) -> MaterialMap {
        self.map.clone().unwrap_or_else(|| self.builtin(own))
    }

    /// A built-in map.
    fn builtin(&self, name: &str) -> MaterialMap {
        let row = procedural::find(name).unwrap_or_else(|| unreachable!("{name} is a row of the table"));
        MaterialMap::Surface(Arc::from((row.build)(self.map_size)))
    }
}

/// A row of [`TABLE`].
pub struct Row {
    /// Name on the command line.
    pub name: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Motion as time goes from 0 to 1, in words.
    pub animation: &'static str,
    /// Sets the scene up.
    pub build: fn(&SceneOptions) -> Scene,
}

/// Every built-in scene.
pub static TABLE: &[Row] = &[
    plane::ROW,
    disk::ROW,
    disk::OBLIQUE,
    armour::ROW,
    desert::ROW,
    sphere::ROW,
    noise_sphere::ROW,
    noise_sphere::LATITUDINAL,
    noise_sphere::LONGITUDINAL,
    v_groove::ROW,
    foil::ROW,
    creature::ROW,
    cloth::ROW,
];

/// The row of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Row> {
    TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name))
}

impl Scene {
    /// Gives every material this lobe. A diffuse lobe leaves no highlight: specular colour becomes albedo. A
    /// measured lobe brings its own colours, and Han et al.'s model, with which it reflects as was measured.
    pub fn set_brdf(&mut self, lobe: &dyn Lobe) {
        for material in &mut self.materials {
            material.brdf.lobe = lobe.widen(SlopeVariance::ZERO);
            if let Some(measured) = lobe.measured() {
                material.params = SurfaceParams {
                    diffuse: measured.factors().diffuse,
                    specular: DVec3::ONE,
                    ..material.params
                };
                material.textures = None;
                material.brdf.shading = ShadingModel::Han;
            }
            if material.brdf.lobe.argument() == Argument::Light {
                material.params.diffuse = material.params.diffuse.max(material.params.specular);
                material.textures = material.textures.take().map(SurfaceTextures::without_highlight);
            }
        }
    }

    /// Gives every material this shading model.
    pub fn set_shading(&mut self, shading: ShadingModel) {
        self.materials.iter_mut().for_each(|m| m.brdf.shading = shading);
    }

    /// Lets maps with heights displace the meshes they lie on: by `scale` times the depth that keeps their
    /// slopes, so that 1 is the surface that the map was made of. Lobes become those of microfacets; facets
    /// hide each other from the eye, and, with `shadows`, from lights.
    ///
    /// # Errors
    /// [`NoHeights`] when no map has any.
    pub fn displace(&mut self, scale: f64, shadows: bool) -> Result<(), NoHeights> {
        let mut any = false;
        for (index, material) in self.materials.iter_mut().enumerate() {
            if !material.map.has_height() {
                continue;
            }
            any = true;
            if let Some(exact) = material.map.with_exact_slopes() {
                material.map = exact.into();
            }
            let Size { width, height } = material.map.size();
            let on = |o: &&mut Object| o.material == index;
            let meshes = self.objects.iter().filter(|o| o.material == index).map(|o| &*o.mesh);
            let width = displacement::texture_width(meshes, height as f64 / width as f64);
            let displacement = Displacement::new(&*material.map, width, scale);
            for object in self.objects.iter_mut().filter(on) {
                object.mesh = object.mesh.with_displacement(&displacement).into();
            }
            material.displacement = Some(displacement);
            material.brdf.shading = if shadows { ShadingModel::Shadowed } else { ShadingModel::Masked };
            if let Some(lobe) = material.brdf.lobe.as_beckmann() {
                material.brdf.lobe = lobe.into();
            }
        }
        if any { Ok(()) } else { Err(NoHeights) }
    }

    /// The scene as a picture of this size sees it: displaced meshes cut and moved.
    #[must_use]
    pub fn displaced_for(&self, camera: &Camera, size: Size) -> Vec<Object> {
        let rays = camera.rays(size);
        let displaced = |object: &Object| {
            let Some(displacement) = &self.materials[object.material].displacement else {
                return object.clone();
            };
            let plan = tessellation::plan(&object.mesh, displacement, &rays, size);
            let mesh = tessellation::expand(&object.mesh, displacement, &plan, &rays);
            Object { mesh: mesh.into(), ..object.clone() }
        };
        self.objects.iter().map(displaced).collect()
    }

    /// True where some material is displaced.
    #[must_use]
    pub fn is_displaced(&self) -> bool {
        self.materials.iter().any(|m| m.displacement.is_some())
    }

    /// A sphere that holds the scene, around the middle of its box: centre and radius.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, f64) {
        let places = || self.objects.iter().flat_map(|o| &o.mesh.vertices).map(|v| v.position);
        let low = places().fold(Vec3::INFINITY, Vec3::min).as_dvec3();
        let high = places().fold(Vec3::NEG_INFINITY, Vec3::max).as_dvec3();
        let reach = self
            .materials
            .iter()
            .filter_map(|m| m.displacement.as_ref())
            .map(|r| r.reach)
            .fold(0.0, f64::max);
        if low.x > high.x {
            return (DVec3::ZERO, 1.0);
        }
        ((low + high) / 2.0, (high - low).length() / 2.0 + reach)
    }
}

/// Error of displacing a scene without heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("none of the scene's maps has heights")]
pub struct NoHeights;

/// A light far away, from a direction that need not be of unit length.
fn sun(towards: [f64; 3], irradiance: [f64; 3]) -> Light {
    Light::Directional { towards: DVec3::from(towards).normalize(), irradiance: irradiance.into() }
}

/// A lobe in a model, for the scenes' own spellings.
fn brdf(shading: ShadingModel, lobe: &str) -> Brdf {
    let lobe: AnyLobe = lobe.parse().unwrap_or_else(|e| unreachable!("{e}"));
    Brdf::new(lobe, shading)
}

/// Value that goes from `a` to `b` by equal factors, as time goes from 0 to 1.
fn zoom(a: f64, b: f64, time: f64) -> f64 {
    a * (b / a).powf(time)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenes() -> impl Iterator<Item = (&'static Row, f64, Scene)> {
        let staging = |time| SceneOptions { time, map_size: Size { width: 16, height: 16 }, map: None };
        TABLE.iter().flat_map(move |row| [0.0, 0.6, 1.0].map(|time| (row, time, (row.build)(&staging(time)))))
    }

    #[test]
    fn scenes_are_whole() {
        for (row, time, scene) in scenes() {
            let name = format!("{} at {time}", row.name);
            assert!(!scene.objects.is_empty() && !scene.lights.is_empty() && scene.exposure > 0.0, "{name}");
            for object in &scene.objects {
                assert!(object.material < scene.materials.len(), "{name}");
                let vertices = &object.mesh.vertices;
                assert!(
                    object.mesh.triangles.iter().flatten().all(|i| (*i as usize) < vertices.len()),
                    "{name}"
                );
                for v in vertices {
                    let (n, t) = (v.normal, v.tangent.truncate());
                    let finite = v.position.is_finite() && v.uv.is_finite();
                    assert!(finite && (n.length() - 1.0).abs() < 1e-4, "{name}: {v:?}");
                    assert!((t.length() - 1.0).abs() < 1e-4 && v.tangent.w.abs() == 1.0, "{name}: {v:?}");
                }
            }
            assert!(scene.camera.eye.distance(scene.camera.target) > 0.0, "{name}");
        }
    }

    #[test]
    fn tangents_follow_the_maps() {
        // Along a triangle's u the position moves with the tangent, and against v (v runs down) with the
        // bitangent.
        for (row, _, scene) in scenes() {
            for object in &scene.objects {
                let mesh = &object.mesh;
                let (mut agree, mut all) = (0, 0);
                for t in &mesh.triangles {
                    let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
                    let (p, q) = (b.position - a.position, c.position - a.position);
                    let (s, t) = (b.uv - a.uv, c.uv - a.uv);
                    let determinant = s.perp_dot(t);
                    if determinant.abs() < 1e-12 || p.cross(q).length() < 1e-12 {
                        continue;
                    }
                    let du = (p * t.y - q * s.y) / determinant;
                    let up = -(q * s.x - p * t.x) / determinant;
                    let bitangent = a.normal.cross(a.tangent.truncate()) * a.tangent.w;
                    all += 1;
                    agree += usize::from(du.dot(a.tangent.truncate()) > 0.0 && up.dot(bitangent) > 0.0);
                }
                // Poles and folds aside.
                assert!(agree as f64 > 0.97 * f64::from(all), "{}: {agree} of {all}", row.name);
            }
        }
    }

    #[test]
    fn faces_are_seen_from_outside() {
        for (row, _, scene) in scenes() {
            for object in &scene.objects {
                let mesh = &object.mesh;
                let outward = mesh.triangles.iter().filter(|t| {
                    let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
                    let normal = (b.position - a.position).cross(c.position - a.position);
                    normal.dot(a.normal + b.normal + c.normal) >= 0.0
                });
                assert!(outward.count() as f64 > 0.97 * mesh.triangles.len() as f64, "{}", row.name);
            }
        }
    }
}
