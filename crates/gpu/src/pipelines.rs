//! Pipelines, made on first use and kept for every frame after.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use ndfmap_core::brdf::Lobe;
use ndfmap_core::ndf::Method;

use crate::canvas::{Antialiasing, DEPTH, PLACE, TargetFormat};
use crate::{Device, GpuError, link};

/// Key that a pipeline is kept under.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(crate) enum Key {
    /// A method (its spelling), a lobe (its text), attributes, the entry point, the target.
    Draw(String, String, usize, &'static str, TargetFormat),
    /// The truth of a lobe.
    Truth(String),
    /// Places and faces.
    Place,
}

/// Pipelines, and the layouts that all of them share.
pub(crate) struct Pipelines {
    device: Device,
    /// Group 0: view, lights, triangles, mask, environment.
    pub(crate) scene: wgpu::BindGroupLayout,
    /// Group 1 of [`Key::Draw`]: material, map, colours, sampler, and its table and cubes for an environment.
    pub(crate) material: wgpu::BindGroupLayout,
    /// Group 1 of [`Key::Truth`]: material, normals, colours.
    pub(crate) finest: wgpu::BindGroupLayout,
    made: Mutex<HashMap<Key, Arc<wgpu::RenderPipeline>>>,
}

/// Binding that vertices and fragments see.
fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    let visibility = wgpu::ShaderStages::VERTEX_FRAGMENT;
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

fn texture(sample_type: wgpu::TextureSampleType, array: bool) -> wgpu::BindingType {
    let view_dimension =
        if array { wgpu::TextureViewDimension::D2Array } else { wgpu::TextureViewDimension::D2 };
    wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false }
}

impl Pipelines {
    pub(crate) fn new(device: &Device) -> Self {
        let uniform = || buffer(wgpu::BufferBindingType::Uniform);
        let storage = || buffer(wgpu::BufferBindingType::Storage { read_only: true });
        let float = |filterable| wgpu::TextureSampleType::Float { filterable };
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries };
            device.device.create_bind_group_layout(&descriptor)
        };
        let scene = layout(
            "scene",
            &[
                entry(0, uniform()),
                entry(1, storage()),
                entry(2, storage()),
                entry(3, storage()),
                entry(4, storage()),
                entry(5, texture(wgpu::TextureSampleType::Uint, false)),
                entry(6, uniform()),
                entry(7, texture(float(true), true)),
                entry(8, texture(float(false), false)),
                entry(9, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            ],
        );
        let material = layout(
            "material",
            &[
                entry(0, uniform()),
                entry(1, texture(float(true), true)),
                entry(2, texture(float(true), true)),
                entry(3, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
                entry(4, texture(float(false), false)),
                entry(5, texture(float(true), true)),
            ],
        );
        let finest = layout(
            "finest",
            &[
                entry(0, uniform()),
                entry(1, texture(float(false), false)),
                entry(2, texture(float(true), true)),
            ],
        );
        Self { device: device.clone(), scene, material, finest, made: Mutex::default() }
    }

    /// Pipeline that draws a method with a lobe.
    pub(crate) fn draw(
        &self,
        (method, lobe): (&dyn Method, &dyn Lobe),
        attributes: usize,
        entry: &'static str,
        target: TargetFormat,
    ) -> Result<Arc<wgpu::RenderPipeline>, GpuError> {
        let key = Key::Draw(method.to_string(), lobe.shader().into_owned(), attributes, entry, target);
        self.get(key, || {
            let text = link::draw(method, lobe, attributes)?.text;
            let groups = [&self.scene, &self.material];
            let TargetFormat { format, samples } = target;
            let descriptor =
                PipelineDescriptor { text: &text, entry, targets: &[format], groups: &groups, samples };
            Ok(build(&self.device, &descriptor))
        })
    }

    /// Pipeline that draws the truth of a lobe.
    pub(crate) fn truth(&self, lobe: &dyn Lobe) -> Result<Arc<wgpu::RenderPipeline>, GpuError> {
        self.get(Key::Truth(lobe.shader().into_owned()), || {
            let text = link::truth(lobe)?.text;
            let TargetFormat { format, samples } = Antialiasing::Sharp.format();
            let (entry, groups) = ("truth", [&self.scene, &self.finest]);
            let descriptor =
                PipelineDescriptor { text: &text, entry, targets: &[format], groups: &groups, samples };
            Ok(build(&self.device, &descriptor))
        })
    }

    /// Pipeline that draws places and faces.
    pub(crate) fn place(&self) -> Result<Arc<wgpu::RenderPipeline>, GpuError> {
        self.get(Key::Place, || {
            let text = link::place()?.text;
            let (entry, groups) = ("place", [&self.scene]);
            let descriptor = PipelineDescriptor {
                text: &text,
                entry,
                targets: &[PLACE, PLACE],
                groups: &groups,
                samples: 1,
            };
            Ok(build(&self.device, &descriptor))
        })
    }

    fn get(
        &self,
        key: Key,
        make: impl FnOnce() -> Result<wgpu::RenderPipeline, GpuError>,
    ) -> Result<Arc<wgpu::RenderPipeline>, GpuError> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = made.get(&key) {
            return Ok(pipeline.clone());
        }
        let pipeline = Arc::new(make()?);
        made.insert(key, pipeline.clone());
        Ok(pipeline)
    }
}

/// Parts that a pipeline is built from.
struct PipelineDescriptor<'a> {
    text: &'a str,
    entry: &'static str,
    targets: &'a [wgpu::TextureFormat],
    groups: &'a [&'a wgpu::BindGroupLayout],
    samples: u32,
}

fn build(device: &Device, plan: &PipelineDescriptor<'_>) -> wgpu::RenderPipeline {
    let module = device.shader(Some(plan.entry), plan.text);
    let groups: Vec<Option<&wgpu::BindGroupLayout>> = plan.groups.iter().map(|g| Some(*g)).collect();
    let layout = device.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &groups,
        immediate_size: 0,
    });
    let targets: Vec<Option<wgpu::ColorTargetState>> =
        plan.targets.iter().map(|format| Some((*format).into())).collect();
    device.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(plan.entry),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("project"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: plan.samples, ..wgpu::MultisampleState::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(plan.entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
