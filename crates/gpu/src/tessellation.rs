//! Displaced meshes on the GPU: cut anew for each picture, by compute passes that work out their points and
//! triangles.
//!
//! A picture costs a plan on the CPU, a pass over the base mesh. The memory in use is bounded by that mesh
//! and the picture's pixels, not by the map.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Texels;
use ndfmap_core::surface::Wrap;
use ndfmap_scene::tessellation::{HEIGHT_PIXELS, Plan, TESSELLATION, plan};
use ndfmap_scene::{Camera, Displacement, Object, Scene};

use crate::geometry::{Corner, Geometry, Part, Triangle, corner, triangle};
use crate::{Device, GpuError};

/// Common part of both passes.
const HEIGHTS: &str =
    concat!(include_str!("passes/vertices.wgsl"), "\n", include_str!("passes/heights.wgsl"));

/// `Cut` in `heights.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Cut {
    eye: Vec3,
    width: f32,
    texels: [u32; 2],
    levels: u32,
    repeat: u32,
    depth: f32,
    patches: u32,
    points: u32,
    triangles: u32,
    first_point: u32,
    first_triangle: u32,
    object: u32,
    texture_width: f32,
}

/// A mesh, as it is before it is cut.
enum Base {
    /// Mesh that is not displaced, ready to be drawn.
    Plain {
        vertices: Vec<Corner>,
        corners: Vec<u32>,
        triangles: Vec<Triangle>,
    },
    Displacement {
        vertices: wgpu::Buffer,
        corners: wgpu::Buffer,
        heights: wgpu::Buffer,
    },
}

/// Meshes of a scene in the GPU's memory, to be cut for any picture.
pub struct Meshes<'a> {
    device: Device,
    scene: &'a Scene,
    bases: Vec<Base>,
    points: wgpu::ComputePipeline,
    facets: wgpu::ComputePipeline,
    middle: DVec3,
    radius: f64,
}

impl<'a> Meshes<'a> {
    /// Uploads the meshes, and the heights of the displaced ones.
    ///
    /// # Errors
    /// [`GpuError`] for a scene larger than the device's buffers.
    pub fn new(device: &Device, scene: &'a Scene) -> Result<Self, GpuError> {
        let (middle, radius) = scene.bounds();
        let base = |(number, object): (usize, &Object)| {
            let vertices: Vec<Corner> =
                (0..object.mesh.vertices.len()).map(|i| corner(&object.mesh, i, middle)).collect();
            let corners = || object.mesh.triangles.as_flattened();
            let Some(displacement) = &scene.materials[object.material].displacement else {
                let triangles =
                    object.mesh.triangles.iter().map(|t| triangle(&object.mesh, t, number)).collect();
                return Ok(Base::Plain { vertices, corners: corners().to_vec(), triangles });
            };
            let upload = |what: &'static str, bytes: &[u8]| -> Result<wgpu::Buffer, GpuError> {
                device.check_bytes(what, bytes.len() as u64)?;
                Ok(device.upload(bytes, wgpu::BufferUsages::STORAGE))
            };
            Ok(Base::Displacement {
                vertices: upload("the vertices", bytemuck::cast_slice(&vertices))?,
                corners: upload("the triangles' corners", bytemuck::cast_slice(corners()))?,
                heights: upload("the heights", bytemuck::cast_slice(&all_heights(displacement)))?,
            })
        };
        Ok(Self {
            device: device.clone(),
            scene,
            bases: scene.objects.iter().enumerate().map(base).collect::<Result<_, GpuError>>()?,
            points: device
                .compute_pipeline(&[TESSELLATION, HEIGHTS, include_str!("passes/points.wgsl")].join("\n")),
            facets: device
                .compute_pipeline(&[TESSELLATION, HEIGHTS, include_str!("passes/facets.wgsl")].join("\n")),
            middle,
            radius,
        })
    }

    /// Cuts the displaced meshes for a picture of this size.
    ///
    /// # Errors
    /// [`GpuError`] for more triangles than the device's buffers hold.
    pub fn cut(&self, camera: &Camera, size: Size) -> Result<Geometry, GpuError> {
        let rays = camera.rays(size);
        let plans: Vec<Option<(Plan, &Displacement)>> = (self.scene.objects.iter())
            .map(|object| {
                let displacement = self.scene.materials[object.material].displacement.as_ref()?;
                Some((plan(&object.mesh, displacement, &rays, size), displacement))
            })
            .collect();
        let counts = |i: usize| match (&plans[i], &self.bases[i]) {
            (Some((plan, _)), _) => (plan.points, plan.triangles),
            (None, Base::Plain { vertices, triangles, .. }) => {
                (vertices.len() as u32, triangles.len() as u32)
            }
            (None, Base::Displacement { .. }) => (0, 0),
        };
        let total = (0..plans.len()).map(counts).fold((0_u64, 0_u64), |(p, t), (points, triangles)| {
            (p + u64::from(points), t + u64::from(triangles))
        });
        let geometry = Geometry::empty(&self.device, total, (self.middle, self.radius))?;
        let (mut parts, mut first) = (Vec::new(), (0, 0));
        for (i, object) in self.scene.objects.iter().enumerate() {
            let (points, triangles) = counts(i);
            match (&plans[i], &self.bases[i]) {
                (Some((plan, displacement)), Base::Displacement { .. }) => {
                    let cut = Cut {
                        eye: (rays.eye - self.middle).as_vec3(),
                        width: (HEIGHT_PIXELS * rays.right.length()) as f32,
                        object: i as u32 + 1,
                        ..of_displaced(displacement, plan, first)
                    };
                    self.expand(&geometry, i, &cut, plan);
                }
                (_, Base::Plain { vertices, corners, triangles }) => {
                    let corners: Vec<u32> = corners.iter().map(|c| c + first.0).collect();
                    geometry.fill(&self.device, (vertices, &corners, triangles), first);
                }
                (None, Base::Displacement { .. }) => {}
            }
            parts.push(Part { material: object.material, corners: 3 * first.1..3 * (first.1 + triangles) });
            first = (first.0 + points, first.1 + triangles);
        }
        Ok(Geometry { parts, ..geometry })
    }

    /// Works out points and triangles of one mesh.
    fn expand(&self, geometry: &Geometry, object: usize, cut: &Cut, plan: &Plan) {
        let Base::Displacement { vertices, corners, heights } = &self.bases[object] else { return };
        if plan.patches.is_empty() {
            return;
        }
        let of = |p: &ndfmap_scene::tessellation::Patch| {
            let [a, b, c] = p.edges;
            [p.triangle, p.segments, a, b, c, p.first_point, p.first_triangle]
        };
        let patches: Vec<[u32; 7]> = plan.patches.iter().map(of).collect();
        let patches = self.device.upload(bytemuck::cast_slice(&patches), wgpu::BufferUsages::STORAGE);
        let cut = self.device.upload(bytemuck::bytes_of(cut), wgpu::BufferUsages::UNIFORM);
        let run = |pipeline: &wgpu::ComputePipeline, buffers: &[&wgpu::Buffer], count: u32| {
            let all = [&cut, &patches].into_iter().chain(buffers.iter().copied());
            let entries: Vec<wgpu::BindGroupEntry<'_>> = all
                .enumerate()
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding: binding as u32,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("tessellation"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            self.device.dispatch(pipeline, &group, count);
        };
        run(&self.points, &[vertices, corners, heights, &geometry.vertices], plan.points);
        run(&self.facets, &[&geometry.vertices, &geometry.corners, &geometry.triangles], plan.triangles);
    }
}

/// Cut with the values that do not change from picture to picture, and with the plan's numbers.
fn of_displaced(displacement: &Displacement, plan: &Plan, (first_point, first_triangle): (u32, u32)) -> Cut {
    let (finest, wraps) = (displacement.heights_size(), displacement.heights.wraps());
    let bit = |wrap: Wrap, bit: u32| if wrap == Wrap::Repeat { bit } else { 0 };
    Cut {
        texels: [finest.width as u32, finest.height as u32],
        levels: displacement.heights.sizes().len() as u32,
        repeat: bit(wraps.x, 1) | bit(wraps.y, 2),
        depth: displacement.depth as f32,
        texture_width: displacement.width as f32,
        patches: plan.patches.len() as u32,
        points: plan.points,
        triangles: plan.triangles,
        first_point,
        first_triangle,
        ..Cut::zeroed()
    }
}

/// Heights of all levels, finest first.
fn all_heights(displacement: &Displacement) -> Vec<f32> {
    let level = |(level, size): (usize, &Size)| {
        let (width, area) = (size.width, size.area());
        (0..area).map(move |i| displacement.heights.texel(level, i % width, i / width)[0])
    };
    displacement.heights.sizes().iter().enumerate().flat_map(level).collect()
}
