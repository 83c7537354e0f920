//! Models: meshes and materials from glTF, OBJ, FBX and PLY files, as scenes.
//!
//! A parser only fills in a raw mesh. This module makes what the file leaves out, the same way for all
//! formats: normals (area-weighted), map coordinates (`unwrap.rs`), tangents (MikkTSpace), and a camera and
//! two lights that suit the model's size.

#[cfg(any(feature = "gltf", feature = "obj", feature = "ply"))]
mod corners;
#[cfg(feature = "gltf")]
mod gltf;
#[cfg(any(feature = "gltf", feature = "obj"))]
mod laying;
#[cfg(any(feature = "gltf", feature = "obj"))]
mod material;
#[cfg(feature = "gltf")]
mod mirror;
#[cfg(feature = "ply")]
mod ply;
#[cfg(any(feature = "gltf", feature = "obj"))]
mod relay;
#[cfg(feature = "obj")]
mod ufbx;
mod unwrap;

use std::path::Path;
use std::sync::Arc;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, Vec2, Vec3, Vec4};
use ndfmap_core::brdf::{Brdf, Ggx, ShadingModel, SurfaceParams};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::Light;
use ndfmap_core::surface::{NormalGrid, Surface, Wraps};
use ndfmap_core::units::{Alpha, SlopeVariance};
use ndfmap_scene::{Camera, Material, Mesh, Object, Scene, SceneOptions, Vertex, area_normals};

use crate::MapError;
use crate::formats::read_file;

#[cfg(feature = "gltf")]
pub(crate) use self::gltf::{OLD as OLD_GLTF, PICTURES, Resource, Scaled, resource, resource_path};
#[cfg(feature = "gltf")]
pub(crate) use self::material::colours;

/// Reads the parts of a model from a whole file; warnings go into the list.
type ReadModel = fn(&Path, &[u8], &mut Vec<String>) -> Result<Parts, MapError>;

/// A row of [`TABLE`].
pub struct ModelFormat {
    /// Name for messages.
    pub name: &'static str,
    /// Extensions, lower case.
    pub extensions: &'static [&'static str],
    read: ReadModel,
}

/// Every model format that the crate was built with.
pub static TABLE: &[ModelFormat] = &[
    #[cfg(feature = "gltf")]
    gltf::FORMAT,
    #[cfg(feature = "obj")]
    ufbx::OBJ,
    #[cfg(feature = "obj")]
    ufbx::FBX,
    #[cfg(feature = "ply")]
    ply::FORMAT,
];

/// Options for reading a model.
pub struct ModelOptions {
    /// A map for the first material, in place of its own; the time is ignored.
    pub staging: SceneOptions,
    /// Name of the material that comes first; `None` for that of the first mesh.
    pub material: Option<String>,
}

/// Meshes and their materials.
#[derive(Default)]
struct Parts {
    meshes: Vec<(RawMesh, usize)>,
    /// Materials; an empty list stands for one plain material, index 0.
    materials: Vec<Material>,
}

/// Mesh as read; a list is empty where the file leaves it out.
#[derive(Default)]
struct RawMesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    tangents: Vec<Vec4>,
    triangles: Vec<[u32; 3]>,
}

/// Most vertices, and most triangles, of a mesh.
const MAX_ELEMENTS: usize = 1 << 26;

fn format_of(path: &Path) -> Option<&'static ModelFormat> {
    let extension = path.extension()?.to_string_lossy().to_lowercase();
    TABLE.iter().find(|f| f.extensions.contains(&extension.as_str()))
}

/// True for a file whose name says that it holds a model.
#[must_use]
pub fn is_model(path: &Path) -> bool {
    format_of(path).is_some()
}

/// Reads a model as a scene; returns it with warnings.
///
/// # Errors
/// [`MapError`] when it, or a file that it names, cannot be read.
pub fn read_model(path: &Path, options: &ModelOptions) -> Result<(Scene, Vec<String>), MapError> {
    model_of_bytes(path, &read_file(path)?, options)
}

/// Reads a model from a whole file in memory. The path tells its format, and the folder of the files that it
/// names.
///
/// # Errors
/// [`MapError`] when it, or a file that it names, cannot be read.
pub fn model_of_bytes(
    path: &Path,
    bytes: &[u8],
    options: &ModelOptions,
) -> Result<(Scene, Vec<String>), MapError> {
    let format = format_of(path).ok_or_else(|| {
        let names: Vec<&str> = TABLE.iter().map(|f| f.name).collect();
        MapError::unsupported(path, format!("is no model; models are {}", names.join(", ")))
    })?;
    let mut warnings = Vec::new();
    // Failed assertions of a decoder are caught: the fault is the file's, which may be hostile.
    let read = std::panic::AssertUnwindSafe(|| (format.read)(path, bytes, &mut warnings));
    let damaged = || {
        MapError::invalid(path, format!("is damaged in a way that the {} reader cannot handle", format.name))
    };
    let parts = std::panic::catch_unwind(read).map_err(|_| damaged())??;
    scene_of(path, parts, options, &mut warnings).map(|scene| (scene, warnings))
}

fn scene_of(
    path: &Path,
    mut parts: Parts,
    options: &ModelOptions,
    warnings: &mut Vec<String>,
) -> Result<Scene, MapError> {
    parts.meshes.retain(|(mesh, _)| !mesh.triangles.is_empty());
    if parts.meshes.is_empty() {
        return Err(MapError::invalid(path, "holds no triangles"));
    }
    if parts.materials.is_empty() {
        parts.materials.push(plain());
    }
    // It becomes the first, for whoever changes the first material later.
    let first = first_material(path, &parts, options.material.as_deref())?;
    parts.materials.swap(0, first);
    for (_, material) in &mut parts.meshes {
        *material = match *material {
            0 => first,
            m if m == first => 0,
            m => m,
        };
    }
    if let Some(map) = &options.staging.map {
        if options.material.is_none() && used_materials(&parts).len() > 1 {
            let (name, others) = (&parts.materials[0].name, used_materials(&parts)[1..].join("`, `"));
            warnings.push(format!(
                "the map is laid on its material `{name}`; others are `{others}` (`--material`)"
            ));
        }
        parts.materials[0].map = map.clone();
        if parts.materials[0].textures.take().is_some() {
            warnings.push(
                "its first material's textures go with its own normal map, and are left out".to_owned(),
            );
        }
    }
    let mut objects = Vec::new();
    for (raw, material) in parts.meshes {
        let mesh = Arc::new(raw.finish(path, warnings)?);
        objects.push(Object { mesh, material });
    }
    let sun = |towards: [f64; 3], irradiance: [f64; 3]| Light::Directional {
        towards: DVec3::from(towards).normalize(),
        irradiance: irradiance.into(),
    };
    let mut scene = Scene {
        camera: Camera::new([0.0, 0.0, 1.0], [0.0; 3], 35.0),
        objects,
        materials: parts.materials,
        lights: vec![sun([0.5, 0.8, 0.9], [2.8, 2.7, 2.5]), sun([-0.9, 0.3, 0.4], [0.7, 0.8, 1.0])],
        environment: None,
        background: Vec3::new(0.02, 0.022, 0.026),
        exposure: 1.0,
    };
    let (middle, radius) = scene.bounds();
    // The sphere around it fills the angle of view, a little from above and the right.
    let distance = 1.02 * radius / (35.0_f64 / 2.0).to_radians().sin();
    let eye = middle + DVec3::new(0.35, 0.25, 1.0).normalize() * distance;
    scene.camera = Camera::new(eye.into(), middle.into(), 35.0);
    Ok(scene)
}

/// Names of the materials that meshes have, in their order in the file.
fn used_materials(parts: &Parts) -> Vec<&str> {
    let used = |i: &usize| parts.meshes.iter().any(|(_, material)| material == i);
    (0..parts.materials.len()).filter(used).map(|i| parts.materials[i].name.as_str()).collect()
}

/// Index of the material of this name, or of the first mesh's.
fn first_material(path: &Path, parts: &Parts, name: Option<&str>) -> Result<usize, MapError> {
    let Some(name) = name else { return Ok(parts.meshes[0].1) };
    let used = |i: &usize| parts.meshes.iter().any(|(_, material)| material == i);
    (0..parts.materials.len()).filter(used).find(|i| parts.materials[*i].name == name).ok_or_else(|| {
        let names = used_materials(parts).join("`, `");
        MapError::unsupported(path, format!("has no material `{name}` on its meshes; they have `{names}`"))
    })
}

/// A flat map.
fn flat(size: Size) -> Arc<dyn Surface> {
    Arc::new(NormalGrid { normals: Grid::from_fn(size, |_, _| Vec3::Z), wraps: Wraps::default() })
}

/// Material of a file without materials.
fn plain() -> Material {
    Material {
        name: "plain".to_owned(),
        map: flat(Size { width: 1, height: 1 }).into(),
        params: SurfaceParams {
            diffuse: DVec3::splat(0.3),
            specular: DVec3::splat(0.12),
            roughness: SlopeVariance::ZERO,
        },
        textures: None,
        displacement: None,
        brdf: microfacets(0.25),
    }
}

/// GGX in Smith's model; `alpha` is held to what the lobe takes.
fn microfacets(alpha: f64) -> Brdf {
    let alpha = Alpha::new(alpha.clamp(1e-4, 1.0)).unwrap_or_else(|e| unreachable!("{e}"));
    Brdf::new(Ggx::new(alpha), ShadingModel::Smith)
}

/// Triangles of a strip of vertices, all of them turned alike.
#[cfg(any(feature = "gltf", feature = "ply"))]
fn strip(indices: &[u32]) -> Vec<[u32; 3]> {
    let turned = |(i, t): (usize, &[u32])| match i % 2 {
        0 => [t[0], t[1], t[2]],
        _ => [t[0], t[2], t[1]],
    };
    // Strips are joined by triangles without area.
    let whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    indices.windows(3).enumerate().map(turned).filter(whole).collect()
}

impl RawMesh {
    /// Refuses triangles of vertices that are not there, and vertices that are no places.
    fn check(&self, path: &Path) -> Result<(), MapError> {
        let count = self.positions.len();
        if count.max(self.triangles.len()) > MAX_ELEMENTS {
            return Err(MapError::unsupported(
                path,
                format!("has more than {MAX_ELEMENTS} vertices or triangles"),
            ));
        }
        if self.triangles.iter().flatten().any(|i| *i as usize >= count) {
            return Err(MapError::invalid(path, "has a triangle of a vertex that is not there"));
        }
        if self.positions.iter().any(|p| !p.is_finite() || p.abs().max_element() > 1e18) {
            return Err(MapError::invalid(
                path,
                "has vertices that are no places: NaN, infinite or beyond 1e18",
            ));
        }
        Ok(())
    }

    /// Checks the mesh and makes its missing parts.
    fn finish(mut self, path: &Path, warnings: &mut Vec<String>) -> Result<Mesh, MapError> {
        self.check(path)?;
        let count = self.positions.len();
        for (length, what) in [
            (self.normals.len(), "normals"),
            (self.uvs.len(), "map coordinates"),
            (self.tangents.len(), "tangents"),
        ] {
            if length != 0 && length != count {
                return Err(MapError::invalid(path, format!("has {count} vertices but {length} {what}")));
            }
        }
        if self.normals.is_empty() {
            // The loop below makes them unit vectors, as it does those of files.
            self.normals = area_normals(&self.positions, &self.triangles);
        }
        if self.uvs.is_empty() {
            warnings.push("has no map coordinates: its map is laid on along the three axes".to_owned());
            self = unwrap::along_axes(&self);
        }
        if self.uvs.iter().any(|uv| !uv.is_finite()) {
            return Err(MapError::invalid(path, "has map coordinates that are not finite"));
        }
        // In double precision: single ones overflow at lengths that files may have.
        let unit = |n: &Vec3| n.as_dvec3().try_normalize().map_or(Vec3::Y, |n| n.as_vec3());
        let normals = self.normals.iter().map(unit).collect();
        self.normals = normals;
        if self.tangents.is_empty() {
            return Ok(with_tangents(&self));
        }
        let vertex = |i: usize| Vertex {
            position: self.positions[i],
            normal: self.normals[i],
            tangent: across(self.tangents[i].truncate(), self.normals[i])
                .extend(if self.tangents[i].w < 0.0 { -1.0 } else { 1.0 }),
            uv: self.uvs[i],
        };
        Ok(Mesh {
            vertices: (0..self.positions.len()).map(vertex).collect(),
            triangles: self.triangles,
            stretches: Vec::new(),
        })
    }
}

/// The unit vector nearest to `tangent` that is perpendicular to the normal.
fn across(tangent: Vec3, normal: Vec3) -> Vec3 {
    tangent.reject_from_normalized(normal).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector())
}

/// MikkTSpace's view of a mesh: every corner of a triangle by itself.
struct Corners<'a> {
    mesh: &'a RawMesh,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn index(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.index(face, corner)].into()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.index(face, corner)].into()
    }

    /// Map coordinates with v up the picture, so that the bitangent points where green does.
    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let uv = self.mesh.uvs[self.index(face, corner)];
        [uv.x, 1.0 - uv.y]
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(tangent) = tangent {
            self.tangents[3 * face + corner] = tangent.tangent_encoded().into();
        }
    }
}

/// Tangents by MikkTSpace; a vertex becomes several where its triangles disagree.
fn with_tangents(mesh: &RawMesh) -> Mesh {
    let mut corners = Corners { mesh, tangents: vec![Vec4::ZERO; 3 * mesh.triangles.len()] };
    // MikkTSpace fails only for want of memory or of triangles; then tangents come from the normals alone.
    let made = generate_tangents(&mut corners).is_ok();
    let mut known = std::collections::HashMap::new();
    let mut out = Mesh::default();
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let mut indices = [0; 3];
        for (corner, (index, i)) in indices.iter_mut().zip(triangle).enumerate() {
            let tangent = if made { corners.tangents[3 * face + corner] } else { Vec4::ZERO };
            let key = (*i, tangent.to_array().map(f32::to_bits));
            *index = *known.entry(key).or_insert_with(|| {
                let i = *i as usize;
                let normal = mesh.normals[i];
                let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
                out.vertices.push(Vertex {
                    position: mesh.positions[i],
                    normal,
                    tangent: across(tangent.truncate(), normal).extend(sign),
                    uv: mesh.uvs[i],
                });
                (out.vertices.len() - 1) as u32
            });
        }
        out.triangles.push(indices);
    }
    out
}
