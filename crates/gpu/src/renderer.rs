//! Drawing: a scene's triangles, through baked maps or as they are, on a canvas.

use glam::DVec2;
use ndfmap_core::lookup::Filtering;
use ndfmap_core::scene::{Camera, Material, Scene};

use ndfmap_core::light::SplitSum;
use ndfmap_core::light::environment::SceneEnvironment;

use crate::canvas::{Antialiasing, Canvas, PARTS};
use crate::environment::Environments;
use crate::geometry::Geometry;
use crate::maps::{Maps, Textures, sampler};
use crate::pipelines::Pipelines;
use crate::uniforms::{self, LightUniform, View};
use crate::{Device, GpuError};

/// Who filters maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Our own taps: the same on every device, and as the CPU renderer has them.
    Taps(Filtering),
    /// The device's sampler, with so many taps at most; 1 is plain trilinear filtering. What comes out is the device's choice.
    Sampler(u16),
}

/// How maps are looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lookups {
    /// Who filters.
    pub sampling: Sampling,
    /// Shade every texel that the filter reads and mix the results; methods that cannot be filtered take it unasked.
    pub neighbours: bool,
    /// Take factors at the lobes' means, as the papers print it.
    pub at_means: bool,
}

impl Lookups {
    /// The device's own trilinear filter.
    pub const TRILINEAR: Self = Self { sampling: Sampling::Sampler(1), neighbours: false, at_means: false };
}

/// A scene as it is now. Its triangles are those of `geometry`; materials, lights and background may have changed since.
#[derive(Clone, Copy)]
pub struct SceneView<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its triangles.
    pub geometry: &'a Geometry,
    /// Where it is seen from.
    pub camera: &'a Camera,
}

/// Draws. Keeps what is made for one frame and good for the next.
pub struct Renderer<'a> {
    device: &'a Device,
    pipelines: Pipelines<'a>,
    accumulate: wgpu::ComputePipeline,
    outlines: wgpu::ComputePipeline,
    environments: Environments<'a>,
    /// Stands for a mask where there is none.
    no_mask: wgpu::TextureView,
}

/// What a pass draws with: for each material its pipeline and its group.
pub(crate) struct MaterialBindings {
    pipeline: std::sync::Arc<wgpu::RenderPipeline>,
    group: wgpu::BindGroup,
}

/// One pass over all triangles.
pub(crate) struct Pass<'a> {
    pub(crate) view: View,
    /// For each material.
    pub(crate) bindings: &'a [MaterialBindings],
    /// Where its beginning and its end are noted.
    pub(crate) clock: Option<&'a wgpu::QuerySet>,
}

impl<'a> Renderer<'a> {
    /// Prepares to draw.
    ///
    /// # Errors
    /// [`GpuError`] when there is no room for the least textures.
    pub fn new(device: &'a Device) -> Result<Self, GpuError> {
        let no_mask = device.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("no mask"),
            size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        Ok(Self {
            device,
            environments: Environments::new(device)?,
            pipelines: Pipelines::new(device),
            accumulate: device.compute_pipeline(include_str!("passes/accumulate.wgsl")),
            outlines: device.compute_pipeline(include_str!("passes/outlines.wgsl")),
            no_mask: no_mask.create_view(&wgpu::TextureViewDescriptor::default()),
        })
    }

    /// Draws a picture; [`Canvas::read`] has it. Waits for the picture before, so that no queue grows without end.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn draw(
        &self,
        canvas: &Canvas<'_>,
        shown: &SceneView<'_>,
        maps: &Maps<'_>,
        lookups: Lookups,
    ) -> Result<(), GpuError> {
        self.device.wait()?;
        let bindings = self.bind_materials(shown.scene, maps, lookups, canvas.outlines)?;
        let view = View::new(shown.camera, canvas.size, shown.geometry).on(canvas, lookups.sampling);
        self.pass(canvas, shown, &Pass { view, bindings: &bindings, clock: None })?;
        self.add(canvas, (0.0, 1.0), false);
        if canvas.outlines != Antialiasing::Parts {
            return Ok(());
        }
        self.find_outlines(canvas, shown, view)?;
        let share = 1.0 / (PARTS * PARTS) as f32;
        for i in 0..PARTS * PARTS {
            let part = DVec2::new((i % PARTS) as f64, (i / PARTS) as f64);
            let offset = (part + 0.5) / PARTS as f64 - 0.5;
            let camera = Camera { shift: shown.camera.shift - offset, ..*shown.camera };
            let moved = View::new(&camera, canvas.size, shown.geometry);
            let view = View { width: 1.0 / PARTS as f32, masked: 1, ..moved.on(canvas, lookups.sampling) };
            self.pass(canvas, shown, &Pass { view, bindings: &bindings, clock: None })?;
            self.add(canvas, (if i == 0 { 0.0 } else { 1.0 }, share), true);
        }
        Ok(())
    }

    /// Draws a frame as an application would, and says how many milliseconds it took: by the device's own clock where it has
    /// one, else by ours from asking to being done.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn time(
        &self,
        canvas: &Canvas<'_>,
        shown: &SceneView<'_>,
        maps: &Maps<'_>,
        lookups: Lookups,
    ) -> Result<f64, GpuError> {
        let bindings = self.bind_materials(shown.scene, maps, lookups, canvas.outlines)?;
        let view = View::new(shown.camera, canvas.size, shown.geometry).on(canvas, lookups.sampling);
        self.clocked(|clock| self.pass(canvas, shown, &Pass { view, bindings: &bindings, clock }))
    }

    /// Milliseconds of one pass.
    pub(crate) fn clocked(
        &self,
        pass: impl FnOnce(Option<&wgpu::QuerySet>) -> Result<(), GpuError>,
    ) -> Result<f64, GpuError> {
        let device = self.device;
        device.wait()?;
        if !device.has_timestamps() {
            let start = std::time::Instant::now();
            pass(None)?;
            device.wait()?;
            return Ok(start.elapsed().as_secs_f64() * 1e3);
        }
        let queries = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        pass(Some(&queries))?;
        let stamps = device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: 16,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.resolve_query_set(&queries, 0..2, &stamps, 0);
        device.queue.submit([encoder.finish()]);
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&device.read(&stamps)?);
        let ticks = stamps[1].saturating_sub(stamps[0]);
        Ok(ticks as f64 * f64::from(device.queue.get_timestamp_period()) / 1e6)
    }

    /// Pipelines and groups of the scene's materials, for a method.
    fn bind_materials(
        &self,
        scene: &Scene,
        maps: &Maps<'_>,
        lookups: Lookups,
        outlines: Antialiasing,
    ) -> Result<Vec<MaterialBindings>, GpuError> {
        let (entry, anisotropy) = match lookups.sampling {
            _ if lookups.neighbours || !maps.method.filterable() => ("neighbours", 1),
            Sampling::Taps(_) => ("filtered", 1),
            Sampling::Sampler(taps) => ("sampled", taps),
        };
        let one = |(material, textures): (&Material, &Textures)| {
            let lobe = &*material.brdf.lobe;
            let pipeline = self.pipelines.draw((maps.method, lobe), textures.attributes, entry, outlines)?;
            let bytes = uniforms::material(material, textures, Some(maps.method), lookups.at_means);
            let sampler = sampler(self.device, textures.wraps, anisotropy);
            let (split_sums, blurred) = self
                .environments
                .bind_material(scene.environment.as_ref(), || SplitSum::new(&material.brdf))?;
            let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("material"),
                layout: &self.pipelines.material,
                entries: &[
                    bind(0, self.uniform(&bytes).as_entire_binding()),
                    bind(1, wgpu::BindingResource::TextureView(&textures.map)),
                    bind(2, wgpu::BindingResource::TextureView(&textures.params)),
                    bind(3, wgpu::BindingResource::Sampler(&sampler)),
                    bind(4, wgpu::BindingResource::TextureView(&split_sums)),
                    bind(5, wgpu::BindingResource::TextureView(&blurred)),
                ],
            });
            Ok(MaterialBindings { pipeline, group })
        };
        scene.materials.iter().zip(&maps.materials).map(one).collect()
    }

    /// Pipelines and groups of the scene's materials, for the truth.
    pub(crate) fn bind_finest(
        &self,
        scene: &Scene,
        finest: &[Textures],
    ) -> Result<Vec<MaterialBindings>, GpuError> {
        let one = |(material, textures): (&Material, &Textures)| {
            let pipeline = self.pipelines.truth(&*material.brdf.lobe)?;
            let bytes = uniforms::material(material, textures, None, false);
            let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("finest"),
                layout: &self.pipelines.finest,
                entries: &[
                    bind(0, self.uniform(&bytes).as_entire_binding()),
                    bind(1, wgpu::BindingResource::TextureView(&textures.map)),
                    bind(2, wgpu::BindingResource::TextureView(&textures.params)),
                ],
            });
            Ok(MaterialBindings { pipeline, group })
        };
        scene.materials.iter().zip(finest).map(one).collect()
    }

    fn uniform(&self, bytes: &[u8]) -> wgpu::Buffer {
        self.device.upload(bytes, wgpu::BufferUsages::UNIFORM)
    }

    /// Group 0 of a pass; the mask is read only where it is not being made.
    fn scene_group(
        &self,
        shown: &SceneView<'_>,
        view: View,
        mask: &wgpu::TextureView,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let geometry = shown.geometry;
        let of = |light| LightUniform::new(light, geometry.middle);
        let mut lights: Vec<LightUniform> = shown.scene.lights.iter().map(of).collect();
        let environment = shown.scene.environment.as_ref();
        let suns = environment.map_or_else(Vec::new, SceneEnvironment::suns);
        lights.extend(suns.iter().map(LightUniform::of_environment));
        let environment = self.environments.bind(environment)?;
        let view = View { lights: lights.len() as u32, ..view };
        if lights.is_empty() {
            lights.push(bytemuck::Zeroable::zeroed());
        }
        let lights = self.device.upload(bytemuck::cast_slice(&lights), wgpu::BufferUsages::STORAGE);
        Ok(self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene"),
            layout: &self.pipelines.scene,
            entries: &[
                bind(0, self.uniform(bytemuck::bytes_of(&view)).as_entire_binding()),
                bind(1, lights.as_entire_binding()),
                bind(2, geometry.vertices.as_entire_binding()),
                bind(3, geometry.corners.as_entire_binding()),
                bind(4, geometry.triangles.as_entire_binding()),
                bind(5, wgpu::BindingResource::TextureView(mask)),
                bind(6, self.uniform(bytemuck::bytes_of(&environment.uniform)).as_entire_binding()),
                bind(7, wgpu::BindingResource::TextureView(&environment.radiance)),
                bind(8, wgpu::BindingResource::TextureView(&environment.half_vectors)),
                bind(9, wgpu::BindingResource::Sampler(&self.environments.sampler)),
            ],
        }))
    }

    /// Draws all triangles on the canvas's target; where the view is masked, only where the canvas's mask says so.
    pub(crate) fn pass(
        &self,
        canvas: &Canvas<'_>,
        shown: &SceneView<'_>,
        pass: &Pass<'_>,
    ) -> Result<(), GpuError> {
        let Pass { view, bindings, clock } = *pass;
        let background = shown.scene.background.as_dvec3();
        let clear = wgpu::Color { r: background.x, g: background.y, b: background.z, a: 1.0 };
        let target = wgpu::RenderPassColorAttachment {
            view: &canvas.target,
            depth_slice: None,
            resolve_target: canvas.resolved.as_ref(),
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store: wgpu::StoreOp::Store },
        };
        let group =
            self.scene_group(shown, view, if view.masked == 1 { &canvas.mask } else { &self.no_mask })?;
        self.encode(canvas, &[Some(target)], clock, |pass| {
            pass.set_bind_group(0, &group, &[]);
            for part in &shown.geometry.parts {
                let Some(MaterialBindings { pipeline, group }) = bindings.get(part.material) else {
                    continue;
                };
                pass.set_pipeline(pipeline);
                pass.set_bind_group(1, group, &[]);
                pass.draw(part.corners.clone(), 0..1);
            }
        });
        Ok(())
    }

    fn encode(
        &self,
        canvas: &Canvas<'_>,
        targets: &[Option<wgpu::RenderPassColorAttachment<'_>>],
        clock: Option<&wgpu::QuerySet>,
        draw: impl FnOnce(&mut wgpu::RenderPass<'_>),
    ) {
        let device = &self.device.device;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: None,
                color_attachments: targets,
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &canvas.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: clock.map(|query_set| wgpu::RenderPassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(0),
                    end_of_pass_write_index: Some(1),
                }),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            draw(&mut pass);
        }
        self.device.queue.submit([encoder.finish()]);
    }

    /// Marks the canvas's pixels that have an outline in them.
    fn find_outlines(&self, canvas: &Canvas<'_>, shown: &SceneView<'_>, view: View) -> Result<(), GpuError> {
        let pipeline = self.pipelines.place()?;
        let group = self.scene_group(shown, view, &self.no_mask)?;
        let target = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        self.encode(canvas, &[target(&canvas.places), target(&canvas.faces)], None, |pass| {
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            for part in &shown.geometry.parts {
                pass.draw(part.corners.clone(), 0..1);
            }
        });
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("outlines"),
            layout: &self.outlines.get_bind_group_layout(0),
            entries: &[
                bind(0, wgpu::BindingResource::TextureView(&canvas.places)),
                bind(1, wgpu::BindingResource::TextureView(&canvas.faces)),
                bind(2, wgpu::BindingResource::TextureView(&canvas.mask)),
            ],
        });
        self.device.dispatch(&self.outlines, &group, canvas.size.area() as u32);
        Ok(())
    }

    /// Adds the picture on the canvas to its sums, of which the first part is kept.
    pub(crate) fn add(&self, canvas: &Canvas<'_>, (keep, add): (f32, f32), masked: bool) {
        let weights = [keep.to_le_bytes(), add.to_le_bytes(), u32::from(masked).to_le_bytes(), [0; 4]];
        let mask = if masked { &canvas.mask } else { &self.no_mask };
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("accumulate"),
            layout: &self.accumulate.get_bind_group_layout(0),
            entries: &[
                bind(0, self.uniform(weights.as_flattened()).as_entire_binding()),
                bind(1, wgpu::BindingResource::TextureView(canvas.picture())),
                bind(2, wgpu::BindingResource::TextureView(mask)),
                bind(3, canvas.sums.as_entire_binding()),
            ],
        });
        self.device.dispatch(&self.accumulate, &group, canvas.size.area() as u32);
    }
}

fn bind(binding: u32, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource }
}
