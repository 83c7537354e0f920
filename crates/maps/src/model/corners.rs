//! Corners of triangles, and the vertices that are made of them.
//!
//! Formats give normals and map coordinates to corners; a mesh has them at its vertices. A vertex becomes
//! several where its corners disagree.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
#[cfg(any(feature = "obj", feature = "ply"))]
use ndfmap_scene::area_normals;

use super::RawMesh;

/// Mesh whose corners have normals and map coordinates of their own.
#[derive(Default)]
pub(super) struct CornerMesh {
    pub(super) positions: Vec<Vec3>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Normals of the corners, three a triangle; none where the file leaves them out.
    pub(super) normals: Vec<Vec3>,
    /// Map coordinates of the corners, three a triangle; none where the file leaves them out.
    pub(super) uvs: Vec<Vec2>,
}

impl CornerMesh {
    /// Gives every corner the area-weighted normal of its position, so that seams of map coordinates are no
    /// creases.
    #[cfg(any(feature = "obj", feature = "ply"))]
    pub(super) fn smooth(&mut self) {
        let normals = area_normals(&self.positions, &self.triangles);
        self.normals = self.triangles.iter().flatten().map(|i| normals[*i as usize]).collect();
    }

    /// Gives every corner the normal of its triangle.
    #[cfg(feature = "gltf")]
    pub(super) fn flatten(&mut self) {
        let position = |i: u32| self.positions[i as usize];
        let normal = |t: &[u32; 3]| {
            let [a, b, c] = t.map(position);
            [(b - a).cross(c - a).normalize_or_zero(); 3]
        };
        self.normals = self.triangles.iter().flat_map(normal).collect();
    }

    /// Vertices of the corners, in the order in which they are first met.
    pub(super) fn weld(self) -> RawMesh {
        let mut known = HashMap::new();
        let mut out = RawMesh::default();
        for (face, triangle) in self.triangles.iter().enumerate() {
            let mut indices = [0; 3];
            for (corner, (index, i)) in indices.iter_mut().zip(triangle).enumerate() {
                let normal = self.normals.get(3 * face + corner);
                let uv = self.uvs.get(3 * face + corner);
                let key = (
                    *i,
                    normal.map(|n| n.to_array().map(f32::to_bits)),
                    uv.map(|uv| uv.to_array().map(f32::to_bits)),
                );
                *index = *known.entry(key).or_insert_with(|| {
                    out.positions.push(self.positions[*i as usize]);
                    out.normals.extend(normal);
                    out.uvs.extend(uv);
                    (out.positions.len() - 1) as u32
                });
            }
            out.triangles.push(indices);
        }
        out
    }
}

#[cfg(feature = "gltf")]
impl RawMesh {
    /// Mesh whose every triangle is as flat as it lies.
    pub(super) fn faceted(self) -> Self {
        let uvs = match self.uvs.is_empty() {
            true => Vec::new(),
            false => self.triangles.iter().flatten().map(|i| self.uvs[*i as usize]).collect(),
        };
        let mut corners =
            CornerMesh { positions: self.positions, triangles: self.triangles, normals: Vec::new(), uvs };
        corners.flatten();
        corners.weld()
    }
}
