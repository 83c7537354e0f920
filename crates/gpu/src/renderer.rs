//! Renderer: draws a scene's triangles, through baked maps or as they are, on a canvas.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec2;
use ndfmap_core::grid::Size;
use ndfmap_core::light::SplitSum;
use ndfmap_core::light::environment::SceneEnvironment;
use ndfmap_core::lookup::{Lookups, Sampling};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::surface::Wraps;
use ndfmap_scene::{Camera, Material, Scene};

use crate::canvas::{Antialiasing, Canvas, DEPTH, Keep, PARTS, PassTarget, Target, TargetFormat, texture};
use crate::device::record_dispatch;
use crate::environment::Environments;
use crate::geometry::Geometry;
use crate::maps::{BindKey, Maps, Surrounding, Textures, sampler};
use crate::pipelines::Pipelines;
use crate::uniforms::{self, LightUniform, View};
use crate::{Device, GpuError};

/// Scene as it is now. Its triangles are those of `geometry`; materials, lights and background may have
/// changed since those were uploaded.
#[derive(Clone, Copy)]
pub struct SceneView<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Triangles of the scene.
    pub geometry: &'a Geometry,
    /// Camera that sees it.
    pub camera: &'a Camera,
}

/// Frame to be drawn: a scene, seen through baked maps.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// The scene.
    pub view: SceneView<'a>,
    /// Maps of its materials, baked on the renderer's device.
    pub maps: &'a Maps,
    /// Look-ups of the maps.
    pub lookups: Lookups,
}

/// Renderer on one device. It keeps all that the next frame can use again: pipelines, samplers, groups,
/// environments.
pub struct Renderer {
    device: Device,
    /// Number that no other renderer has.
    number: u64,
    pipelines: Pipelines,
    accumulate: wgpu::ComputePipeline,
    outlines: wgpu::ComputePipeline,
    environments: Environments,
    samplers: Mutex<Vec<(SamplerKey, wgpu::Sampler)>>,
    /// Depths for targets that come without.
    depth: Mutex<Option<wgpu::TextureView>>,
    /// Stand-in for a mask in passes without one.
    no_mask: wgpu::TextureView,
}

/// Key that a sampler is kept under.
#[derive(Clone, Copy, PartialEq)]
struct SamplerKey {
    wraps: Wraps,
    taps: u16,
}

/// Bindings of a pass to a material: its pipeline and its group.
pub(crate) struct MaterialBindings {
    pipeline: Arc<wgpu::RenderPipeline>,
    group: wgpu::BindGroup,
}

/// Pass over all triangles.
pub(crate) struct Pass<'a> {
    pub(crate) target: PassTarget<'a>,
    pub(crate) view: View,
    /// Bindings, one for each material.
    pub(crate) bindings: &'a [MaterialBindings],
    /// Queries that take the times of its beginning and its end.
    pub(crate) clock: Option<&'a wgpu::QuerySet>,
}

/// Weights with which a picture joins the sums before it.
#[derive(Clone, Copy)]
pub(crate) struct Weights {
    /// Part of the sums that stays.
    pub(crate) keep: f32,
    /// Part of the picture that is added.
    pub(crate) add: f32,
}

impl Renderer {
    /// Prepares to draw.
    ///
    /// # Errors
    /// [`GpuError`] when there is no room for the least textures.
    pub fn new(device: &Device) -> Result<Self, GpuError> {
        static NUMBERS: AtomicU64 = AtomicU64::new(0);
        let one = Size { width: 1, height: 1 };
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let no_mask = TargetFormat { format: wgpu::TextureFormat::R32Uint, samples: 1 };
        Ok(Self {
            number: NUMBERS.fetch_add(1, Ordering::Relaxed),
            environments: Environments::new(device)?,
            pipelines: Pipelines::new(device),
            accumulate: device.compute_pipeline(include_str!("passes/accumulate.wgsl")),
            outlines: device.compute_pipeline(include_str!("passes/outlines.wgsl")),
            samplers: Mutex::default(),
            depth: Mutex::default(),
            no_mask: texture(device, one, no_mask, read),
            device: device.clone(),
        })
    }

    /// Records a frame, one sample of shading a pixel, into the caller's commands, which the caller submits.
    /// Nothing is waited for; textures that the frame is the first to need are uploaded by the queue.
    ///
    /// The frame shows the scene as it is now. Materials whose BRDF, colours and environment are those of the
    /// last frame cost the processor nothing but the comparison.
    ///
    /// # Errors
    /// [`GpuError`] for a shader that does not hold together, or textures that the device cannot hold.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target<'_>,
        frame: &Frame<'_>,
    ) -> Result<(), GpuError> {
        let Frame { view: shown, lookups, .. } = frame;
        let (size, format) = (target.size(), target.target_format());
        let bindings = self.bind_materials(frame, format)?;
        let view = View::new(shown.camera, size, shown.geometry).on(format.format, lookups.sampling);
        let own;
        let depth = match target.depth {
            Some(depth) => depth,
            None => {
                own = self.own_depth(size, format.samples);
                &own
            }
        };
        let own = target.depth.is_none();
        let keep = Keep { colours: target.keep, depths: target.keep && !own, depths_after: !own };
        let target = PassTarget { view: target.view, resolved: None, depth, keep };
        self.pass(encoder, shown, &Pass { target, view, bindings: &bindings, clock: None })
    }

    /// Draws a picture, for [`Canvas::read`] to read. It waits for the picture before, so that no queue grows
    /// without end.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn draw(&self, canvas: &Canvas, frame: &Frame<'_>) -> Result<(), GpuError> {
        let Frame { view: shown, lookups, .. } = frame;
        self.device.wait()?;
        let format = canvas.outlines.format();
        let bindings = self.bind_materials(frame, format)?;
        let on = |view: View| view.on(format.format, lookups.sampling);
        let view = on(View::new(shown.camera, canvas.size, shown.geometry));
        let pass = |view| Pass { target: canvas.pass_target(), view, bindings: &bindings, clock: None };
        let mut encoder = self.device.encoder();
        self.pass(&mut encoder, shown, &pass(view))?;
        self.add(&mut encoder, canvas, Weights { keep: 0.0, add: 1.0 }, false);
        if canvas.outlines == Antialiasing::Parts {
            self.find_outlines(&mut encoder, canvas, shown, view)?;
            let share = 1.0 / (PARTS * PARTS) as f32;
            for i in 0..PARTS * PARTS {
                let part = DVec2::new((i % PARTS) as f64, (i / PARTS) as f64);
                let offset = (part + 0.5) / PARTS as f64 - 0.5;
                let camera = Camera { shift: shown.camera.shift - offset, ..*shown.camera };
                let moved = View::new(&camera, canvas.size, shown.geometry);
                let view = View { width: 1.0 / PARTS as f32, masked: 1, ..on(moved) };
                self.pass_masked(&mut encoder, shown, &pass(view), &canvas.mask)?;
                let keep = if i == 0 { 0.0 } else { 1.0 };
                self.add(&mut encoder, canvas, Weights { keep, add: share }, true);
            }
        }
        self.device.submit(encoder);
        Ok(())
    }

    /// Draws a frame as an application would, and returns the milliseconds that it took: by the device's own
    /// clock where it has one, else by ours, from the call until the frame is done.
    ///
    /// # Errors
    /// [`GpuError`].
    pub fn time(&self, canvas: &Canvas, frame: &Frame<'_>) -> Result<f64, GpuError> {
        let Frame { view: shown, lookups, .. } = frame;
        let format = canvas.outlines.format();
        let bindings = self.bind_materials(frame, format)?;
        let view = View::new(shown.camera, canvas.size, shown.geometry).on(format.format, lookups.sampling);
        self.clocked(|clock| {
            let mut encoder = self.device.encoder();
            let pass = Pass { target: canvas.pass_target(), view, bindings: &bindings, clock };
            self.pass(&mut encoder, shown, &pass)?;
            self.device.submit(encoder);
            Ok(())
        })
    }

    /// Milliseconds of one pass.
    pub(crate) fn clocked(
        &self,
        pass: impl FnOnce(Option<&wgpu::QuerySet>) -> Result<(), GpuError>,
    ) -> Result<f64, GpuError> {
        let device = &self.device;
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
        let mut encoder = device.encoder();
        encoder.resolve_query_set(&queries, 0..2, &stamps, 0);
        device.submit(encoder);
        let stamps: Vec<u64> = bytemuck::pod_collect_to_vec(&device.read(&stamps)?);
        let ticks = stamps[1].saturating_sub(stamps[0]);
        Ok(ticks as f64 * f64::from(device.queue.get_timestamp_period()) / 1e6)
    }

    /// Pipelines and groups of the scene's materials, for a method.
    fn bind_materials(
        &self,
        frame: &Frame<'_>,
        target: TargetFormat,
    ) -> Result<Vec<MaterialBindings>, GpuError> {
        let Frame { view: SceneView { scene, .. }, maps, lookups } = *frame;
        let (entry, taps) = match lookups.sampling {
            _ if lookups.neighbours || !maps.method.filterable() => ("neighbours", 1),
            Sampling::Taps(_) => ("filtered", 1),
            Sampling::Sampler(taps) => ("sampled", taps),
        };
        let one = |(material, textures): (&Material, &Textures)| {
            let linked = (&*maps.method, &*material.brdf.lobe);
            let pipeline = self.pipelines.draw(linked, textures.attributes, entry, target)?;
            let key = BindKey {
                renderer: self.number,
                brdf: material.brdf.clone(),
                params: material.params,
                at_means: lookups.at_means,
                taps,
                environment: (scene.environment.as_ref())
                    .map(|e| Surrounding(Arc::clone(&e.filtered), e.technique)),
            };
            let bound = || textures.bound.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((_, group)) = bound().as_ref().filter(|(last, _)| *last == key) {
                return Ok(MaterialBindings { pipeline, group: group.clone() });
            }
            // Made without the lock: what the material makes of an environment is worked out by all threads.
            let group = self.material_group(scene, (material, textures), &maps.method, &key)?;
            *bound() = Some((key, group.clone()));
            Ok(MaterialBindings { pipeline, group })
        };
        scene.materials.iter().zip(&maps.materials).map(one).collect()
    }

    /// Group 1 of a material.
    fn material_group(
        &self,
        scene: &Scene,
        (material, textures): (&Material, &Textures),
        method: &AnyMethod,
        key: &BindKey,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let bytes = uniforms::material(material, textures, Some(&**method), key.at_means);
        let sampler = self.sampler(SamplerKey { wraps: textures.wraps, taps: key.taps });
        let (split_sums, blurred) =
            self.environments.bind_material(scene.environment.as_ref(), || SplitSum::new(&material.brdf))?;
        Ok(self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
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
        }))
    }

    /// Sampler of a kind, made once.
    fn sampler(&self, key: SamplerKey) -> wgpu::Sampler {
        let mut made = self.samplers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, sampler)) = made.iter().find(|(of, _)| *of == key) {
            return sampler.clone();
        }
        let sampler = sampler(&self.device, key.wraps, key.taps);
        made.push((key, sampler.clone()));
        sampler
    }

    /// Depths for a target without its own; made anew when its size changes.
    fn own_depth(&self, size: Size, samples: u32) -> wgpu::TextureView {
        let mut last = self.depth.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |view: &&wgpu::TextureView| {
            let texture = view.texture();
            let held = [texture.width() as usize, texture.height() as usize];
            held == [size.width, size.height] && texture.sample_count() == samples
        };
        if let Some(view) = last.as_ref().filter(fits) {
            return view.clone();
        }
        let format = TargetFormat { format: DEPTH, samples };
        let view = texture(&self.device, size, format, wgpu::TextureUsages::RENDER_ATTACHMENT);
        *last = Some(view.clone());
        view
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

    /// Group 0 of a pass; a pass that makes the mask does not read it.
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

    /// Draws all triangles.
    pub(crate) fn pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &SceneView<'_>,
        pass: &Pass<'_>,
    ) -> Result<(), GpuError> {
        self.pass_masked(encoder, shown, pass, &self.no_mask)
    }

    /// Draws all triangles; in a masked view, only where the mask is set.
    fn pass_masked(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        shown: &SceneView<'_>,
        pass: &Pass<'_>,
        mask: &wgpu::TextureView,
    ) -> Result<(), GpuError> {
        let Pass { target, view, bindings, clock } = *pass;
        let background = shown.scene.background.as_dvec3();
        let clear = wgpu::Color { r: background.x, g: background.y, b: background.z, a: 1.0 };
        let load = if target.keep.colours { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(clear) };
        let colours = wgpu::RenderPassColorAttachment {
            view: target.view,
            depth_slice: None,
            resolve_target: target.resolved,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        };
        let group = self.scene_group(shown, view, mask)?;
        encode(encoder, &[Some(colours)], &target, clock, |pass| {
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

    /// Marks the canvas's pixels that have an outline in them.
    fn find_outlines(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        canvas: &Canvas,
        shown: &SceneView<'_>,
        view: View,
    ) -> Result<(), GpuError> {
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
        let targets = [target(&canvas.places), target(&canvas.faces)];
        encode(encoder, &targets, &canvas.pass_target(), None, |pass| {
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
        record_dispatch(encoder, &self.outlines, &group, canvas.size.area() as u32);
        Ok(())
    }

    /// Adds the picture on the canvas to its sums, by these weights.
    pub(crate) fn add(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        canvas: &Canvas,
        Weights { keep, add }: Weights,
        masked: bool,
    ) {
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
        record_dispatch(encoder, &self.accumulate, &group, canvas.size.area() as u32);
    }
}

/// Records a pass with depths.
fn encode(
    encoder: &mut wgpu::CommandEncoder,
    targets: &[Option<wgpu::RenderPassColorAttachment<'_>>],
    target: &PassTarget<'_>,
    clock: Option<&wgpu::QuerySet>,
    draw: impl FnOnce(&mut wgpu::RenderPass<'_>),
) {
    let Keep { depths, depths_after, .. } = target.keep;
    let depth_ops = wgpu::Operations {
        load: if depths { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(0.0) },
        store: if depths_after { wgpu::StoreOp::Store } else { wgpu::StoreOp::Discard },
    };
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: None,
        color_attachments: targets,
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: target.depth,
            depth_ops: Some(depth_ops),
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

fn bind(binding: u32, resource: wgpu::BindingResource<'_>) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource }
}
