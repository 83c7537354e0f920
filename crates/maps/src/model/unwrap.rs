//! Map coordinates for meshes that have none: each triangle is projected along the axis it faces most.

use glam::{Vec2, Vec3};

use super::RawMesh;

/// Repeats of the map along the longest side of the mesh.
const TILES: f32 = 4.0;

/// Mesh with map coordinates, its vertices no longer shared. Seams run where the axis changes.
pub(super) fn along_axes(mesh: &RawMesh) -> RawMesh {
    let low = mesh.positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let high = mesh.positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    let scale = TILES / (high - low).max_element().max(f32::MIN_POSITIVE);
    let mut out = RawMesh::default();
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let face = (b - a).cross(c - a);
        let size = face.abs();
        let place = |p: Vec3| {
            let p = (p - low) * scale;
            // Seen from outside, u runs to the right and v down.
            if size.x >= size.y && size.x >= size.z {
                Vec2::new(-face.x.signum() * p.z, -p.y)
            } else if size.y >= size.z {
                Vec2::new(p.x, face.y.signum() * p.z)
            } else {
                Vec2::new(face.z.signum() * p.x, -p.y)
            }
        };
        let first = out.positions.len() as u32;
        for i in t.map(|i| i as usize) {
            out.positions.push(mesh.positions[i]);
            out.normals.push(mesh.normals[i]);
            out.uvs.push(place(mesh.positions[i]));
        }
        out.triangles.push([first, first + 1, first + 2]);
    }
    out
}
