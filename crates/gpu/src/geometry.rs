//! A scene's triangles in the GPU's memory.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4};
use ndfmap_core::grid::Size;
use ndfmap_core::scene::{Camera, Mesh, Scene, Vertex};

use crate::{Device, GpuError};

/// `Vertex` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Corner {
    position_u: Vec4,
    normal_v: Vec4,
    tangent: Vec4,
}

/// `Triangle` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Triangle {
    face: Vec4,
    grad_u: Vec4,
    grad_v: Vec4,
}

/// A run of triangles of one material.
pub(crate) struct Part {
    pub(crate) material: usize,
    /// First corner, and past the last.
    pub(crate) corners: std::ops::Range<u32>,
}

/// Triangles of a scene, ready to be drawn.
pub struct Geometry {
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) corners: wgpu::Buffer,
    pub(crate) triangles: wgpu::Buffer,
    pub(crate) parts: Vec<Part>,
    /// What places are relative to: single floats then have their digits where the scene is.
    pub(crate) middle: DVec3,
    pub(crate) radius: f64,
}

impl Geometry {
    /// Uploads the meshes, those with relief cut and displaced for a picture of this size.
    ///
    /// # Errors
    /// [`GpuError`] for a scene larger than the device's buffers.
    pub fn displaced(device: &Device, scene: &Scene, camera: &Camera, size: Size) -> Result<Self, GpuError> {
        let _ = (camera, size);
        Self::new(device, scene)
    }

    /// Uploads the meshes.
    ///
    /// # Errors
    /// [`GpuError`] for a scene larger than the device's buffers.
    pub fn new(device: &Device, scene: &Scene) -> Result<Self, GpuError> {
        let (middle, radius) = scene.bounds();
        let (mut vertices, mut corners, mut triangles, mut parts) = (vec![], vec![], vec![], vec![]);
        for (number, object) in scene.objects.iter().enumerate() {
            let (first, base) = (corners.len() as u32, vertices.len() as u32);
            vertices.extend(object.mesh.vertices.iter().map(|v| corner(v, middle)));
            corners.extend(object.mesh.triangles.iter().flatten().map(|i| base + i));
            let triangle = |t: &[u32; 3]| triangle(&object.mesh, t, number);
            triangles.extend(object.mesh.triangles.iter().map(triangle));
            parts.push(Part { material: object.material, corners: first..corners.len() as u32 });
        }
        // A scene of nothing still needs buffers.
        if triangles.is_empty() {
            vertices.push(Corner::zeroed());
            corners.push(0);
            triangles.push(Triangle::zeroed());
        }
        let upload = |what: &'static str, bytes: &[u8]| {
            device.check_bytes(what, bytes.len() as u64)?;
            Ok(device.upload(bytes, wgpu::BufferUsages::STORAGE))
        };
        Ok(Self {
            vertices: upload("the vertices", bytemuck::cast_slice(&vertices))?,
            corners: upload("the triangles' corners", bytemuck::cast_slice(&corners))?,
            triangles: upload("the triangles", bytemuck::cast_slice(&triangles))?,
            parts,
            middle,
            radius,
        })
    }
}

fn corner(v: &Vertex, middle: DVec3) -> Corner {
    Corner {
        position_u: (v.position.as_dvec3() - middle).as_vec3().extend(v.uv.x),
        normal_v: v.normal.extend(v.uv.y),
        tangent: v.tangent,
    }
}

fn triangle(mesh: &Mesh, corners: &[u32; 3], object: usize) -> Triangle {
    let [a, b, c] = corners.map(|i| mesh.vertices[i as usize]);
    let (p, q) = ((b.position - a.position).as_dvec3(), (c.position - a.position).as_dvec3());
    let (du, dv) = ((b.uv - a.uv).as_dvec2(), (c.uv - a.uv).as_dvec2());
    let normal = p.cross(q);
    let square = normal.length_squared().max(f64::MIN_POSITIVE);
    // The weights of the second and third corner grow along these.
    let (s, t) = (q.cross(normal) / square, normal.cross(p) / square);
    let with = |v: Vec3, w: f32| v.extend(w);
    Triangle {
        face: with(normal.normalize_or(DVec3::Y).as_vec3(), object as f32 + 1.0),
        grad_u: with((s * du.x + t * dv.x).as_vec3(), 0.0),
        grad_v: with((s * du.y + t * dv.y).as_vec3(), 0.0),
    }
}
