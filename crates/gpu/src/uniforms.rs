//! Uniforms of the shaders: twins in memory of the structures in `passes/`.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Mat4, Vec3, Vec4};
use ndfmap_core::grid::Size;
use ndfmap_core::light::Light;
use ndfmap_core::lookup::{Filtering, Sampling};
use ndfmap_core::ndf::Method;
use ndfmap_core::surface::Wrap;
use ndfmap_scene::{Camera, Material};

use crate::geometry::Geometry;
use crate::maps::Textures;
use ndfmap_core::shader::LobeTable;

/// `View` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct View {
    pub(crate) clip: Mat4,
    pub(crate) eye: Vec3,
    pub(crate) lights: u32,
    pub(crate) corner: Vec3,
    pub(crate) width: f32,
    pub(crate) right: Vec3,
    pub(crate) seed: u32,
    pub(crate) down: Vec3,
    pub(crate) masked: u32,
    pub(crate) max_taps: u32,
    pub(crate) parts: u32,
    pub(crate) lod_bias: f32,
    pub(crate) brightest: f32,
}

impl View {
    /// View of a camera, shaded one whole pixel at a time.
    pub(crate) fn new(camera: &Camera, size: Size, geometry: &Geometry) -> Self {
        let rays = camera.rays(size);
        let forward = rays.right.cross(rays.down).normalize_or(DVec3::NEG_Z);
        // A place p (relative to the eye) at depth p·forward is seen at x = p·right / (right² depth) +
        // middle.x; y alike.
        let axis = |step: DVec3, pixels: usize| {
            let square = step.length_squared();
            let middle = -rays.corner.dot(step) / square;
            step * (2.0 / (pixels as f64 * square)) + forward * (2.0 * middle / pixels as f64 - 1.0)
        };
        let (x, y) = (axis(rays.right, size.width), -axis(rays.down, size.height));
        // The near plane; there is no far one. Floats have as many digits for this distance as for any other.
        let near = 1e-9 * (geometry.radius + geometry.middle.distance(rays.eye));
        let column = |k: usize| Vec4::new(x[k] as f32, y[k] as f32, 0.0, forward[k] as f32);
        Self {
            clip: Mat4::from_cols(column(0), column(1), column(2), Vec4::new(0.0, 0.0, near as f32, 0.0)),
            eye: (rays.eye - geometry.middle).as_vec3(),
            lights: 0,
            corner: rays.corner.as_vec3(),
            width: 1.0,
            right: rays.right.as_vec3(),
            seed: 0,
            down: rays.down.as_vec3(),
            masked: 0,
            max_taps: 1,
            parts: 1,
            lod_bias: 0.0,
            brightest: f32::MAX,
        }
    }

    /// Returns it for a target of this format, with a filter.
    pub(crate) fn on(self, format: wgpu::TextureFormat, sampling: Sampling) -> Self {
        let half = format == wgpu::TextureFormat::Rgba16Float;
        let brightest = if half { half::f16::MAX.to_f32() } else { f32::MAX };
        let view = Self { brightest, ..self };
        let Sampling::Taps(Filtering { max_taps, parts, lod_bias }) = sampling else { return view };
        let (max_taps, parts, lod_bias) = (max_taps as u32, parts as u32, lod_bias as f32);
        Self { max_taps, parts, lod_bias, ..view }
    }
}

/// `Light` in `scene.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LightUniform {
    place: Vec4,
    power: Vec4,
}

impl LightUniform {
    /// Uniform of a small bright source of an environment.
    pub(crate) fn of_environment(light: &Light) -> Self {
        let mut uniform = Self::new(light, DVec3::ZERO);
        uniform.power.w = 1.0;
        uniform
    }

    /// Uniform of a light; places are relative to `middle`.
    pub(crate) fn new(light: &Light, middle: DVec3) -> Self {
        match *light {
            Light::Directional { towards, irradiance } => {
                Self { place: towards.as_vec3().extend(0.0), power: irradiance.as_vec3().extend(0.0) }
            }
            Light::Point { at, intensity } => {
                Self { place: (at - middle).as_vec3().extend(1.0), power: intensity.as_vec3().extend(0.0) }
            }
        }
    }
}

/// `Material` in `draw.wgsl`, with its table at the end.
pub(crate) fn material(
    material: &Material,
    textures: &Textures,
    method: Option<&dyn Method>,
    at_means: bool,
) -> Vec<u8> {
    let (params, size, wraps, mapped) = (material.params, textures.size, textures.wraps, textures.mapped);
    let bit = |wrap: Wrap, bit: u32| if wrap == Wrap::Repeat { bit } else { 0 };
    let roughness = params.roughness.get() as f32;
    let mut bytes = Vec::new();
    let mut four = |values: [[u8; 4]; 4]| bytes.extend(values.as_flattened());
    let f = |v: f64| (v as f32).to_le_bytes();
    let of = |c: DVec3, w: f32| [f(c.x), f(c.y), f(c.z), w.to_le_bytes()];
    four(of(params.diffuse, roughness));
    four(of(params.specular, 0.0));
    let repeat = bit(wraps.x, 1) | bit(wraps.y, 2);
    four([f(size.width as f64), f(size.height as f64), mapped.to_le_bytes(), repeat.to_le_bytes()]);
    let brdf = &material.brdf;
    let shading = brdf.shading.index().to_le_bytes();
    let (least, most) = textures.roughness.unwrap_or((params.roughness, params.roughness));
    four([f(brdf.lobe.base()), shading, u32::from(at_means).to_le_bytes(), f(least.get())]);
    four([f(most.get() - least.get()), [0; 4], [0; 4], [0; 4]]);
    let table = method.map_or_else(|| LobeTable::new(1), |method| method.shader_table(brdf, least, most));
    table.as_flat().as_chunks::<4>().0.iter().for_each(|entry| four(entry.map(f32::to_le_bytes)));
    bytes
}
