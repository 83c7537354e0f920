//! Environments in a GPU's memory.

use std::sync::{Arc, Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use half::f16;
use half::slice::HalfFloatSliceExt;
use ndfmap_core::grid::Size;
use ndfmap_core::light::environment::{Cube, FilteredEnvironment, SceneEnvironment, Technique, VIEWS};
use ndfmap_core::light::{ENTRIES, SplitSum};

use crate::maps::{Stored, array_view, create, write};
use crate::{Device, GpuError};
use ndfmap_core::brdf::Microfacets;

/// `Environment` in `environment.wgsl`.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct EnvironmentUniform {
    rotation: [Vec4; 3],
    irradiance: [Vec4; 9],
    size: [f32; 2],
    scale: f32,
    technique: u32,
}

/// Bindings of the passes to an environment; dark without one.
pub(crate) struct Bound {
    pub(crate) uniform: EnvironmentUniform,
    pub(crate) radiance: wgpu::TextureView,
    pub(crate) half_vectors: wgpu::TextureView,
}

/// Environments that have been uploaded: the last one, and its cubes.
pub(crate) struct Environments {
    device: Device,
    pub(crate) sampler: wgpu::Sampler,
    dark_cube: wgpu::TextureView,
    dark: wgpu::TextureView,
    last: Mutex<Option<Uploaded>>,
}

/// Textures of an environment, as far as they were asked for.
struct Uploaded {
    of: Arc<FilteredEnvironment>,
    radiance: wgpu::TextureView,
    half_vectors: Option<wgpu::TextureView>,
    blurred: Vec<(Microfacets, wgpu::TextureView)>,
}

/// Scale that brings radiance into the range of half floats, which end at 65504.
fn scale(environment: &FilteredEnvironment) -> f32 {
    let brightest = environment.radiance.texels(0).iter().map(|v| v.max_element()).fold(0.0, f32::max);
    (brightest / 60_000.0).max(1.0)
}

impl Environments {
    pub(crate) fn new(device: &Device) -> Result<Self, GpuError> {
        let one = Size { width: 1, height: 1 };
        let stored = |layers, format| Stored { layers, levels: 1, format };
        let cube = create(device, "no cube", one, stored(6, wgpu::TextureFormat::Rgba16Float))?;
        let table = create(device, "no table", one, stored(1, wgpu::TextureFormat::Rgba32Float))?;
        let sampler = device.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("cube"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        Ok(Self {
            device: device.clone(),
            sampler,
            dark_cube: array_view(&cube),
            dark: table.create_view(&wgpu::TextureViewDescriptor::default()),
            last: Mutex::new(None),
        })
    }

    /// Bindings of the scene's passes.
    pub(crate) fn bind(&self, environment: Option<&SceneEnvironment>) -> Result<Bound, GpuError> {
        let Some(environment) = environment else {
            let (radiance, half_vectors) = (self.dark_cube.clone(), self.dark.clone());
            return Ok(Bound { uniform: EnvironmentUniform::default(), radiance, half_vectors });
        };
        let filtered = &*environment.filtered;
        let rotation = environment.to_environment();
        let mut irradiance = [Vec4::ZERO; 9];
        for (to, from) in irradiance.iter_mut().zip(filtered.irradiance.light.coefficients()) {
            *to = from.as_vec3().extend(0.0);
        }
        for (to, least) in irradiance.iter_mut().zip(filtered.irradiance.least.to_array()) {
            to.w = least as f32;
        }
        if environment.technique == Technique::Harmonics {
            // Before the lock is taken: all threads work it out.
            irradiance[3].w = filtered.half_vectors().narrowest().get() as f32;
        }
        let uniform = EnvironmentUniform {
            rotation: [rotation.x_axis, rotation.y_axis, rotation.z_axis]
                .map(|axis| axis.as_vec3().extend(0.0)),
            irradiance,
            size: [filtered.radiance.side() as f32, filtered.radiance.levels() as f32],
            scale: scale(filtered),
            technique: environment.technique.index(),
        };
        self.with(environment, |uploaded| {
            if environment.technique == Technique::Harmonics && uploaded.half_vectors.is_none() {
                let texels: Vec<[f32; 4]> = filtered
                    .half_vectors()
                    .coefficients()
                    .iter()
                    .map(|c| c.as_vec3().extend(0.0).to_array())
                    .collect();
                let size = Size { width: texels.len() / (VIEWS * VIEWS), height: VIEWS * VIEWS };
                uploaded.half_vectors = Some(self.table("light over half-vectors", size, &texels)?);
            }
            let half_vectors = uploaded.half_vectors.as_ref().unwrap_or(&self.dark).clone();
            Ok(Bound { uniform, radiance: uploaded.radiance.clone(), half_vectors })
        })
    }

    /// Bindings of a material: its table, and the cubes that facets like its own have blurred.
    pub(crate) fn bind_material(
        &self,
        environment: Option<&SceneEnvironment>,
        split_sum: impl FnOnce() -> SplitSum,
    ) -> Result<(wgpu::TextureView, wgpu::TextureView), GpuError> {
        let Some(environment) = environment else {
            return Ok((self.dark.clone(), self.dark_cube.clone()));
        };
        let split_sum = split_sum();
        let texels = split_sum.texels();
        let size = Size { width: 2 * ENTRIES, height: texels.len() / (2 * ENTRIES) };
        let table = self.table("what a material reflects of a white sky", size, &texels)?;
        if environment.technique != Technique::Prefiltered {
            return Ok((table, self.dark_cube.clone()));
        }
        let microfacets = split_sum.microfacets;
        // Before the lock is taken: all threads work it out.
        environment.filtered.make(environment.technique, microfacets);
        let cube = self.with(environment, |uploaded| {
            if let Some((_, made)) = uploaded.blurred.iter().find(|(k, _)| *k == microfacets) {
                return Ok(made.clone());
            }
            let filtered = &environment.filtered;
            let made =
                self.cube("blurred environment", filtered.prefiltered(microfacets), scale(filtered))?;
            uploaded.blurred.push((microfacets, made.clone()));
            Ok(made)
        })?;
        Ok((table, cube))
    }

    fn with<T>(
        &self,
        environment: &SceneEnvironment,
        f: impl FnOnce(&mut Uploaded) -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        let of = &environment.filtered;
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let mut uploaded = match last.take().filter(|u| Arc::ptr_eq(&u.of, of)) {
            Some(uploaded) => uploaded,
            None => Uploaded {
                of: Arc::clone(of),
                radiance: self.cube("environment", &of.radiance, scale(of))?,
                half_vectors: None,
                blurred: Vec::new(),
            },
        };
        let done = f(&mut uploaded);
        *last = Some(uploaded);
        done
    }

    fn table(&self, what: &str, size: Size, texels: &[[f32; 4]]) -> Result<wgpu::TextureView, GpuError> {
        let stored = Stored { layers: 1, levels: 1, format: wgpu::TextureFormat::Rgba32Float };
        let texture = create(&self.device, what, size, stored)?;
        write(&self.device, &texture, 0, size, bytemuck::cast_slice(texels));
        Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
    }

    fn cube(&self, what: &str, cube: &Cube, scale: f32) -> Result<wgpu::TextureView, GpuError> {
        let levels = cube.levels();
        let side = |level: usize| Size { width: cube.side() >> level, height: cube.side() >> level };
        let stored = Stored { layers: 6, levels, format: wgpu::TextureFormat::Rgba16Float };
        let texture = create(&self.device, what, side(0), stored)?;
        for level in 0..levels {
            let values: Vec<f32> =
                cube.texels(level).iter().flat_map(|v| (*v / scale).extend(1.0).to_array()).collect();
            let mut halves = vec![f16::ZERO; values.len()];
            halves.convert_from_f32_slice(&values);
            write(&self.device, &texture, level as u32, side(level), bytemuck::cast_slice(&halves));
        }
        Ok(array_view(&texture))
    }
}
