//! Baked materials in the GPU's memory: 2-D array textures with all their levels, filtered by the hardware.

use std::sync::{Arc, Mutex};

use half::f16;
use half::slice::HalfFloatSliceExt;
use ndfmap_core::brdf::{Brdf, SurfaceParams};
use ndfmap_core::compact::Storage;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::light::environment::{FilteredEnvironment, Technique};
use ndfmap_core::lookup::{Lookup, Texels};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Observer;
use ndfmap_core::pyramid::{Precision, Pyramid};
use ndfmap_core::surface::{SurfaceRow, Wrap, Wraps};
use ndfmap_core::units::SlopeVariance;
use ndfmap_scene::{BakedMaterial, Material, SurfaceTextures};

use crate::{Device, GpuError};

/// Textures of a material.
pub(crate) struct Textures {
    pub(crate) map: wgpu::TextureView,
    pub(crate) params: wgpu::TextureView,
    /// Number of attributes that the map's lobes carry.
    pub(crate) attributes: usize,
    /// Number of colours in `params`.
    pub(crate) mapped: u32,
    /// Least and most roughness, where a texture holds it.
    pub(crate) roughness: Option<(SlopeVariance, SlopeVariance)>,
    pub(crate) size: Size,
    pub(crate) wraps: Wraps,
    /// Group that the last frame bound, with its key.
    pub(crate) bound: Mutex<Option<(BindKey, wgpu::BindGroup)>>,
}

/// Contents of a material's group besides its textures: while they are the same, so is the group.
#[derive(Clone, PartialEq)]
pub(crate) struct BindKey {
    /// Number of the renderer.
    pub(crate) renderer: u64,
    pub(crate) brdf: Brdf,
    pub(crate) params: SurfaceParams,
    pub(crate) at_means: bool,
    /// Taps of the device's sampler.
    pub(crate) taps: u16,
    /// Environment, by its place in memory, and the way highlights look it up.
    pub(crate) environment: Option<Surrounding>,
}

/// Environment, held so that no other takes its place in memory.
#[derive(Clone)]
pub(crate) struct Surrounding(pub(crate) Arc<FilteredEnvironment>, pub(crate) Technique);

impl PartialEq for Surrounding {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0) && self.1 == other.1
    }
}

/// Maps of a scene's materials, baked with one method. Camera, lights, lobes, shading models and meshes may
/// change afterwards. Colours and roughness may change too, except that a material keeps the `textures` that
/// it was baked with, and one without `textures` stays without.
pub struct Maps {
    pub(crate) method: AnyMethod,
    pub(crate) materials: Vec<Textures>,
}

impl Maps {
    /// Bakes every material's map and uploads it.
    ///
    /// # Errors
    /// [`GpuError`] for maps that the device cannot hold or filter, and where the observer cancels.
    pub fn new(
        device: &Device,
        materials: &[Material],
        method: &AnyMethod,
        storage: impl Into<Storage>,
        observer: &dyn Observer,
    ) -> Result<Self, GpuError> {
        let (count, storage) = (materials.len() as f64, storage.into());
        let one = |(i, material): (usize, &Material)| {
            let part = observer.part(i as f64 / count, (i + 1) as f64 / count);
            let baked = BakedMaterial::new(material, &**method, storage, &part)?;
            Textures::new(device, material, &baked)
        };
        let materials = materials.iter().enumerate().map(one).collect::<Result<_, GpuError>>()?;
        Ok(Self { method: method.clone(), materials })
    }
}

impl Textures {
    fn new(device: &Device, material: &Material, baked: &BakedMaterial) -> Result<Self, GpuError> {
        let name = &material.name;
        Ok(Self {
            map: upload_pyramid(device, &format!("the map of material `{name}`"), &baked.pyramid)?,
            params: finish(device, name, &baked.params, baked.pyramid.wraps(), true)?,
            attributes: baked.attributes,
            mapped: baked.params.len() as u32,
            roughness: material.textures.as_ref().map(SurfaceTextures::roughness_range),
            size: baked.pyramid.sizes()[0],
            wraps: baked.pyramid.wraps(),
            bound: Mutex::default(),
        })
    }

    /// Normals of the finest level, one by one, with their colours and roughness, for the truth.
    pub(crate) fn finest(device: &Device, material: &Material) -> Result<Self, GpuError> {
        let (size, wraps) = (material.map.size(), material.map.wraps());
        let what = format!("the map of material `{}`", material.name);
        let mut row = SurfaceRow::flat(size.width);
        let mut values = Vec::with_capacity(4 * size.area());
        for y in 0..size.height {
            material.map.read_row(y, &mut row);
            values.extend((0..size.width).flat_map(|x| row.normal(x).extend(0.0).to_array()));
        }
        let layout = Stored { layers: 1, levels: 1, format: wgpu::TextureFormat::Rgba32Float };
        let texture = create(device, &what, size, layout)?;
        write(device, &texture, 0, size, bytemuck::cast_slice(&values));
        let grids = material.textures.as_ref().map_or_else(Vec::new, |map| map.grids());
        Ok(Self {
            map: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            params: finish(device, &material.name, &grids, wraps, false)?,
            attributes: 0,
            mapped: grids.len() as u32,
            roughness: None,
            size,
            wraps,
            bound: Mutex::default(),
        })
    }
}

/// Sampler for maps with these wraps; `anisotropy` 1 is plain trilinear filtering.
pub(crate) fn sampler(device: &Device, wraps: Wraps, anisotropy: u16) -> wgpu::Sampler {
    let mode = |wrap| match wrap {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
    };
    device.device.create_sampler(&wgpu::SamplerDescriptor {
        label: None,
        address_mode_u: mode(wraps.x),
        address_mode_v: mode(wraps.y),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        anisotropy_clamp: anisotropy.max(1),
        ..wgpu::SamplerDescriptor::default()
    })
}

/// Layout of a texture.
#[derive(Clone, Copy)]
pub(crate) struct Stored {
    pub(crate) layers: usize,
    pub(crate) levels: usize,
    pub(crate) format: wgpu::TextureFormat,
}

pub(crate) fn create(
    device: &Device,
    what: &str,
    size: Size,
    stored: Stored,
) -> Result<wgpu::Texture, GpuError> {
    let extent = wgpu::Extent3d {
        width: size.width as u32,
        height: size.height as u32,
        depth_or_array_layers: stored.layers as u32,
    };
    device.check_size(what, extent)?;
    Ok(device.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(what),
        size: extent,
        mip_level_count: stored.levels as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: stored.format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    }))
}

/// Uploads a level: its layers one after another, each rows of texels.
pub(crate) fn write(device: &Device, texture: &wgpu::Texture, level: u32, size: Size, bytes: &[u8]) {
    let (width, height) = (size.width as u32, size.height as u32);
    let row = texture.format().block_copy_size(None).unwrap_or(8) * width;
    for (layer, bytes) in bytes.chunks_exact(row as usize * size.height).enumerate() {
        device.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: level,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer as u32 },
                aspect: wgpu::TextureAspect::All,
            },
            bytes,
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        // Copies wait in memory until something is submitted.
        device.queue.submit([]);
    }
}

pub(crate) fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..wgpu::TextureViewDescriptor::default()
    })
}

fn upload_pyramid(device: &Device, what: &str, pyramid: &Pyramid) -> Result<wgpu::TextureView, GpuError> {
    let format = match pyramid.precision() {
        Precision::Half => wgpu::TextureFormat::Rgba16Float,
        Precision::Single if device.device.features().contains(wgpu::Features::FLOAT32_FILTERABLE) => {
            wgpu::TextureFormat::Rgba32Float
        }
        Precision::Single => {
            return Err(GpuError::Unsupported {
                adapter: device.name(),
                feature: "filtering of 32-bit floats",
                instead: "bake in half floats",
            });
        }
    };
    let sizes = pyramid.sizes();
    // OpenGL takes an array of one layer for no array, and reads nothing: a second layer costs little.
    let stored = Stored { layers: pyramid.layers().max(2), levels: sizes.len(), format };
    let texture = create(device, what, sizes[0], stored)?;
    for (level, size) in sizes.iter().enumerate() {
        write(device, &texture, level as u32, *size, pyramid.level_bytes(level));
    }
    Ok(array_view(&texture))
}

/// Uploads colours, one a layer; without colours, a single dark texel.
fn finish(
    device: &Device,
    name: &str,
    grids: &[Grid<[f32; 4]>],
    wraps: Wraps,
    mipped: bool,
) -> Result<wgpu::TextureView, GpuError> {
    let none = [Grid::from_fn(Size { width: 1, height: 1 }, |_, _| [0.0; 4])];
    let grids = if grids.is_empty() { &none } else { grids };
    let lookups: Vec<Lookup> = grids.iter().map(|values| Lookup::of_values(values, wraps)).collect();
    let sizes = lookups[0].sizes();
    let levels = if mipped { sizes.len() } else { 1 };
    let stored = Stored { layers: 2, levels, format: wgpu::TextureFormat::Rgba16Float };
    let texture = create(device, &format!("the colours of material `{name}`"), sizes[0], stored)?;
    for (level, size) in sizes.iter().enumerate().take(levels) {
        let texel = |lookup: &Lookup, i: usize| lookup.texel(level, i % size.width, i / size.width).to_vec();
        let layer = |lookup| (0..size.area()).flat_map(move |i| texel(lookup, i));
        let values: Vec<f32> = lookups.iter().flat_map(layer).collect();
        let mut halves = vec![f16::ZERO; values.len()];
        halves.convert_from_f32_slice(&values);
        write(device, &texture, level as u32, *size, bytemuck::cast_slice(&halves));
    }
    Ok(array_view(&texture))
}
