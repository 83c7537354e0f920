//! A scene's triangles in the GPU's memory.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Mat2, Vec3, Vec4};
use ndfmap_scene::{Mesh, Object, Scene, Vertex};

use crate::{Device, GpuError};

/// `Vertex` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Corner {
    position_u: Vec4,
    normal_v: Vec4,
    tangent: Vec4,
    stretch: Vec4,
}

/// `Triangle` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Triangle {
    face: Vec4,
    grad_u: Vec4,
    grad_v: Vec4,
}

/// Run of triangles of one material.
pub(crate) struct Part {
    pub(crate) material: usize,
    /// Corners, from the first to past the last.
    pub(crate) corners: std::ops::Range<u32>,
}

/// Triangles of a scene, ready to be drawn.
pub struct Geometry {
    pub(crate) vertices: wgpu::Buffer,
    pub(crate) corners: wgpu::Buffer,
    pub(crate) triangles: wgpu::Buffer,
    pub(crate) parts: Vec<Part>,
    /// Origin of places: single floats then have their digits where the scene is.
    pub(crate) middle: DVec3,
    pub(crate) radius: f64,
}

impl Geometry {
    /// Uploads the meshes as they are; [`crate::Meshes`] cuts the displaced ones.
    ///
    /// # Errors
    /// [`GpuError`] for a scene larger than the device's buffers.
    pub fn new(device: &Device, scene: &Scene) -> Result<Self, GpuError> {
        let count = |f: fn(&Mesh) -> usize| scene.objects.iter().map(|o| f(&o.mesh) as u64).sum();
        let total = (count(|m| m.vertices.len()), count(|m| m.triangles.len()));
        let geometry = Self::empty(device, total, scene.bounds())?;
        let (mut parts, mut first) = (Vec::new(), (0, 0));
        for (number, Object { mesh, material }) in scene.objects.iter().enumerate() {
            let vertices: Vec<Corner> =
                (0..mesh.vertices.len()).map(|i| corner(mesh, i, geometry.middle)).collect();
            let corners: Vec<u32> = mesh.triangles.iter().flatten().map(|i| first.0 + i).collect();
            let triangles: Vec<Triangle> = mesh.triangles.iter().map(|t| triangle(mesh, t, number)).collect();
            geometry.fill(device, (&vertices, &corners, &triangles), first);
            let next = (first.0 + vertices.len() as u32, first.1 + triangles.len() as u32);
            parts.push(Part { material: *material, corners: 3 * first.1..3 * next.1 });
            first = next;
        }
        Ok(Self { parts, ..geometry })
    }

    /// Room for so many vertices and triangles.
    pub(crate) fn empty(
        device: &Device,
        (vertices, triangles): (u64, u64),
        (middle, radius): (DVec3, f64),
    ) -> Result<Self, GpuError> {
        // An empty scene still needs buffers.
        let room =
            |what: &'static str, count: u64, each: usize| device.storage(what, count.max(1) * each as u64);
        Ok(Self {
            vertices: room("the vertices", vertices, size_of::<Corner>())?,
            corners: room("the triangles' corners", 3 * triangles, size_of::<u32>())?,
            triangles: room("the triangles", triangles, size_of::<Triangle>())?,
            parts: Vec::new(),
            middle,
            radius,
        })
    }

    /// Writes vertices, corners and triangles from the given vertex and triangle on.
    pub(crate) fn fill(
        &self,
        device: &Device,
        (vertices, corners, triangles): (&[Corner], &[u32], &[Triangle]),
        (first_vertex, first_triangle): (u32, u32),
    ) {
        let write = |buffer: &wgpu::Buffer, first: usize, bytes: &[u8]| {
            device.queue.write_buffer(buffer, first as u64, bytes);
        };
        let (vertex, triangle) = (first_vertex as usize, first_triangle as usize);
        write(&self.vertices, vertex * size_of::<Corner>(), bytemuck::cast_slice(vertices));
        write(&self.corners, 3 * triangle * size_of::<u32>(), bytemuck::cast_slice(corners));
        write(&self.triangles, triangle * size_of::<Triangle>(), bytemuck::cast_slice(triangles));
    }

    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts.last().map_or(0, |part| part.corners.end as usize / 3)
    }

    /// True for an empty scene.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Vertex `i` of a mesh.
pub(crate) fn corner(mesh: &Mesh, i: usize, middle: DVec3) -> Corner {
    let v: &Vertex = &mesh.vertices[i];
    let stretch = mesh.stretches.get(i).copied().unwrap_or(Mat2::IDENTITY);
    Corner {
        position_u: (v.position.as_dvec3() - middle).as_vec3().extend(v.uv.x),
        normal_v: v.normal.extend(v.uv.y),
        tangent: v.tangent,
        stretch: Vec4::from_array(stretch.to_cols_array()),
    }
}

pub(crate) fn triangle(mesh: &Mesh, corners: &[u32; 3], object: usize) -> Triangle {
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
