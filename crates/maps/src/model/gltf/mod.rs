//! glTF 2.0 by the `gltf` crate: meshes in the pose of the file, and metallic-roughness materials.
//!
//! It reads positions, normals, tangents and coordinates in every type (`KHR_mesh_quantization`), compressed
//! too (`EXT_meshopt_compression`, `KHR_meshopt_compression`), the normal texture with its scale, base
//! colour, metalness and roughness, factors and textures, each with its `KHR_texture_transform`, and one
//! colour for all vertices of a primitive. Colours and roughness are averaged over the texels of the normal
//! map. It does not read animation, skins, morphs, colours that vary from vertex to vertex, occlusion,
//! emission, alpha, cameras and lights.

mod accessors;
mod document;
mod meshopt;
mod textures;

pub(crate) use self::document::{OLD, PICTURES, Resource, resource, resource_path};
pub(crate) use self::textures::Scaled;

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::{Mat3, Mat4, Vec3, Vec4};

use self::document::Opened;
use super::laying::{Laying, Textures};
use super::material::{Factors, MetalRough};
use super::{MAX_ELEMENTS, ModelFormat, Parts, RawMesh};
use crate::MapError;

pub(super) const FORMAT: ModelFormat = ModelFormat { name: "glTF", extensions: &["gltf", "glb"], read };

/// Deepest tree of nodes.
const MAX_DEPTH: usize = 64;

fn read(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<Parts, MapError> {
    let opened = document::open(path, bytes)?;
    let mut walk = Walk {
        opened: &opened,
        parts: Parts::default(),
        materials: HashMap::new(),
        seen: HashSet::new(),
        elements: 0,
        left_out: 0,
        coloured: false,
        warnings,
    };
    let scene = opened.document.default_scene().or_else(|| opened.document.scenes().next());
    for node in scene.iter().flat_map(gltf::Scene::nodes) {
        walk.node(&node, Mat4::IDENTITY, 0)?;
    }
    let Walk { parts, left_out, coloured, .. } = walk;
    if opened.document.animations().len() + opened.document.skins().len() > 0 {
        warnings.push("is animated: only the pose of the file is shown".to_owned());
    }
    if left_out > 0 {
        warnings.push(format!("has {left_out} parts that are lines or points, which are left out"));
    }
    if coloured {
        warnings.push("has colours that vary from vertex to vertex, which are not read".to_owned());
    }
    Ok(parts)
}

/// Material of a primitive: its index, `None` for glTF's default one, and the bits of the one colour of the
/// primitive's vertices.
type MaterialKey = (Option<usize>, [u32; 3]);

/// Material that was made: its index, and the laying of its map.
#[derive(Clone, Copy)]
struct Known {
    index: usize,
    laying: Laying,
}

/// Walk over the nodes that collects their meshes, and the materials that those use.
struct Walk<'a> {
    opened: &'a Opened<'a>,
    parts: Parts,
    materials: HashMap<MaterialKey, Known>,
    /// Nodes visited: a tree has each once.
    seen: HashSet<usize>,
    /// Vertices and indices so far.
    elements: usize,
    /// Number of primitives left out, which are lines or points.
    left_out: usize,
    /// Some primitive has vertices of different colours.
    coloured: bool,
    warnings: &'a mut Vec<String>,
}

impl Walk<'_> {
    fn node(&mut self, node: &gltf::Node<'_>, above: Mat4, depth: usize) -> Result<(), MapError> {
        let path = self.opened.path;
        if depth > MAX_DEPTH {
            return Err(MapError::invalid(path, format!("has nodes more than {MAX_DEPTH} deep")));
        }
        if !self.seen.insert(node.index()) {
            return Err(MapError::invalid(path, format!("has its node {} in two places", node.index())));
        }
        let pose = above * Mat4::from_cols_array_2d(&node.transform().matrix());
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            use gltf::mesh::Mode;
            if matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
                self.count(&primitive)?;
                let material = self.material(&primitive)?;
                let mesh = self.primitive(&primitive, material.laying, pose)?;
                self.parts.meshes.push((mesh, material.index));
            } else {
                self.left_out += 1;
            }
        }
        for child in node.children() {
            self.node(&child, pose, depth + 1)?;
        }
        Ok(())
    }

    /// A primitive's material, which is made where it is not known yet.
    fn material(&mut self, primitive: &gltf::Primitive<'_>) -> Result<Known, MapError> {
        let tint = self.tint(primitive)?;
        let material = primitive.material();
        let key = (material.index(), tint.to_array().map(f32::to_bits));
        if let Some(known) = self.materials.get(&key) {
            return Ok(*known);
        }
        // The default material is ours, not glTF's metal, but for the colour of its vertices.
        let (made, laying) = match material.index() {
            Some(_) => self.opened.material(&material, tint, self.warnings)?,
            None if tint == Vec3::ONE => (super::plain(), Laying::PLAIN),
            None => (tinted(tint).into_material(self.warnings), Laying::PLAIN),
        };
        self.parts.materials.push(made);
        let known = Known { index: self.parts.materials.len() - 1, laying };
        self.materials.insert(key, known);
        Ok(known)
    }

    /// The colour of all vertices, which multiplies the base colour (glTF 2.0, 3.9.2); white where they
    /// differ.
    fn tint(&mut self, primitive: &gltf::Primitive<'_>) -> Result<Vec3, MapError> {
        let Some(accessor) = primitive.get(&gltf::Semantic::Colors(0)) else { return Ok(Vec3::ONE) };
        let colours: Vec<Vec3> = match accessor.dimensions() {
            gltf::accessor::Dimensions::Vec4 => {
                self.opened.vectors::<4>(&accessor)?.into_iter().map(|c| Vec4::from(c).truncate()).collect()
            }
            _ => self.opened.vectors::<3>(&accessor)?.into_iter().map(Vec3::from).collect(),
        };
        let first = colours.first().copied().unwrap_or(Vec3::ONE);
        if colours.iter().all(|c| *c == first) {
            return Ok(first);
        }
        self.coloured = true;
        Ok(Vec3::ONE)
    }

    /// Counts a primitive's vertices and indices.
    fn count(&mut self, primitive: &gltf::Primitive<'_>) -> Result<(), MapError> {
        let path = self.opened.path;
        let counts =
            primitive.attributes().map(|(_, a)| a.count()).chain(primitive.indices().map(|a| a.count()));
        for count in counts {
            if count > self.opened.held() {
                return Err(MapError::invalid(path, "announces more vertices than its buffers can hold"));
            }
            self.elements += count;
        }
        if self.elements > 4 * MAX_ELEMENTS {
            return Err(MapError::unsupported(
                path,
                format!("has more than {MAX_ELEMENTS} vertices or triangles"),
            ));
        }
        Ok(())
    }

    /// Mesh of a primitive, with the coordinates of its material's map.
    fn primitive(
        &self,
        primitive: &gltf::Primitive<'_>,
        laying: Laying,
        pose: Mat4,
    ) -> Result<RawMesh, MapError> {
        let path = self.opened.path;
        let rotation = Mat3::from_mat4(pose);
        let normal_matrix = rotation.inverse().transpose();
        let mirrored = rotation.determinant() < 0.0;
        let get = |semantic: gltf::Semantic| primitive.get(&semantic);
        let positions = get(gltf::Semantic::Positions)
            .ok_or_else(|| MapError::invalid(path, "has a mesh without positions"))?;
        let positions = self.opened.vectors::<3>(&positions)?;
        let positions: Vec<Vec3> = positions.into_iter().map(|p| pose.transform_point3(p.into())).collect();
        let indices: Vec<u32> = match primitive.indices() {
            Some(indices) => self.opened.indices(&indices)?,
            None => (0..positions.len() as u32).collect(),
        };
        let mut triangles = triangles(&indices, primitive.mode());
        if mirrored {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let uvs = match get(gltf::Semantic::TexCoords(laying.set)) {
            Some(uvs) => self.opened.vectors::<2>(&uvs)?,
            None => Vec::new(),
        };
        let uvs = uvs.into_iter().map(|uv| laying.apply(uv.into())).collect();
        let Some(normals) = get(gltf::Semantic::Normals) else {
            // Flat ones are due, and the file's tangents are to be left alone (glTF 2.0, 3.7.2.1).
            let mesh = RawMesh { positions, uvs, triangles, ..RawMesh::default() };
            mesh.check(path)?;
            return Ok(mesh.faceted());
        };
        let normals = self.opened.vectors::<3>(&normals)?;
        let tangents = match get(gltf::Semantic::Tangents) {
            Some(tangents) => self.opened.vectors::<4>(&tangents)?,
            None => Vec::new(),
        };
        let sign = if mirrored { -1.0 } else { 1.0 };
        let turned = |t: [f32; 4]| {
            let t = Vec4::from(t);
            (rotation * t.truncate()).extend(sign * t.w)
        };
        Ok(RawMesh {
            positions,
            normals: normals.into_iter().map(|n| normal_matrix * Vec3::from(n)).collect(),
            uvs,
            tangents: tangents.into_iter().map(turned).collect(),
            triangles,
        })
    }
}

/// Material of a mesh that has none but a colour of its vertices.
fn tinted(tint: Vec3) -> MetalRough {
    MetalRough {
        name: "plain".to_owned(),
        factors: Factors { base: tint.to_array(), metallic: 0.0, roughness: 0.5 },
        textures: Textures::default().arranged(),
    }
}

/// Triangles of a list, strip or fan of vertices, all of them turned alike (glTF 2.0, 3.7.2.1).
fn triangles(indices: &[u32], mode: gltf::mesh::Mode) -> Vec<[u32; 3]> {
    match mode {
        gltf::mesh::Mode::TriangleStrip => super::strip(indices),
        gltf::mesh::Mode::TriangleFan => {
            indices.iter().skip(1).zip(indices.iter().skip(2)).map(|(a, b)| [*a, *b, indices[0]]).collect()
        }
        _ => indices.as_chunks().0.to_vec(),
    }
}
