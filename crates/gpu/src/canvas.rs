//! Canvas: targets of one size to draw on, and the sums that pictures are read from.

use glam::Vec3;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_scene::metrics::Picture;

use crate::{Device, GpuError};

/// Antialiasing of outlines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Antialiasing {
    /// No antialiasing: one sample a pixel.
    Sharp,
    /// Multisampling by the hardware: four samples of coverage a pixel, one of shading.
    Multisampled,
    /// The CPU renderer's way: pixels with an outline are drawn in 4 × 4 parts.
    Parts,
}

/// Parts of a pixel on each axis, for [`Antialiasing::Parts`].
pub(crate) const PARTS: usize = 4;

impl Antialiasing {
    /// Coverage samples of the target.
    pub(crate) fn samples(self) -> u32 {
        if self == Self::Multisampled { 4 } else { 1 }
    }

    /// Format of the target: half floats for speed, or single ones for the digits.
    pub(crate) fn format(self) -> TargetFormat {
        let format = match self {
            Self::Multisampled => wgpu::TextureFormat::Rgba16Float,
            Self::Sharp | Self::Parts => wgpu::TextureFormat::Rgba32Float,
        };
        TargetFormat { format, samples: self.samples() }
    }
}

/// Format of a target, as a pipeline needs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct TargetFormat {
    pub(crate) format: wgpu::TextureFormat,
    pub(crate) samples: u32,
}

/// Contents of a target that a pass keeps.
#[derive(Clone, Copy, Default)]
pub(crate) struct Keep {
    /// Colours before the pass.
    pub(crate) colours: bool,
    /// Depths before the pass.
    pub(crate) depths: bool,
    /// Depths after it.
    pub(crate) depths_after: bool,
}

/// Target of one pass.
#[derive(Clone, Copy)]
pub(crate) struct PassTarget<'a> {
    pub(crate) view: &'a wgpu::TextureView,
    pub(crate) resolved: Option<&'a wgpu::TextureView>,
    pub(crate) depth: &'a wgpu::TextureView,
    pub(crate) keep: Keep,
}

/// Texture of the caller's own to draw a frame on in linear radiance, with the way to draw on it.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// Colours: a view of the first level of a texture.
    pub view: &'a wgpu::TextureView,
    /// Format of the view. An sRGB format encodes the colours drawn, a fixed-point one clamps them.
    pub format: wgpu::TextureFormat,
    /// Depths, `Depth32Float`, 1 at the eye and 0 far away; `None` for depths of the renderer's own.
    pub depth: Option<&'a wgpu::TextureView>,
    /// True to keep the texture's colours (and the caller's depths) and draw over them; else the texture is
    /// cleared to the scene's background.
    pub keep: bool,
}

impl<'a> Target<'a> {
    /// Whole texture, to be cleared and drawn on.
    #[must_use]
    pub fn new(view: &'a wgpu::TextureView, format: wgpu::TextureFormat) -> Self {
        Self { view, format, depth: None, keep: false }
    }

    pub(crate) fn size(&self) -> Size {
        let texture = self.view.texture();
        Size { width: texture.width() as usize, height: texture.height() as usize }
    }

    pub(crate) fn target_format(&self) -> TargetFormat {
        TargetFormat { format: self.format, samples: self.view.texture().sample_count() }
    }
}

/// Format of depths; they run from 1 at the eye to 0 far away, where floats have digits to spare.
pub(crate) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Format of places and faces.
pub(crate) const PLACE: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// Targets of one size.
pub struct Canvas {
    pub(crate) device: Device,
    pub(crate) size: Size,
    pub(crate) outlines: Antialiasing,
    /// Texture that passes draw on.
    pub(crate) target: wgpu::TextureView,
    /// Texture in which several samples become one; `None` for targets of one sample.
    pub(crate) resolved: Option<wgpu::TextureView>,
    pub(crate) depth: wgpu::TextureView,
    pub(crate) places: wgpu::TextureView,
    pub(crate) faces: wgpu::TextureView,
    pub(crate) mask: wgpu::TextureView,
    /// Sums of pictures, RGBA.
    pub(crate) sums: wgpu::Buffer,
}

impl Canvas {
    /// Makes the targets.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`].
    pub fn new(device: &Device, size: Size, outlines: Antialiasing) -> Result<Self, GpuError> {
        let extent =
            wgpu::Extent3d { width: size.width as u32, height: size.height as u32, depth_or_array_layers: 1 };
        if size.area() == 0 {
            return Err(GpuError::Empty);
        }
        device.check_size("a picture", extent)?;
        let sums = device.storage("a picture's pixels", 16 * size.area() as u64)?;
        let format = outlines.format();
        let one_sample = |format| TargetFormat { format, samples: 1 };
        let texture = |size, format, usage| texture(device, size, format, usage);
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        // Targets for finding outlines have one pixel where none are looked for.
        let one = Size { width: 1, height: 1 };
        let looked = if outlines == Antialiasing::Parts { size } else { one };
        let stored = wgpu::TextureUsages::STORAGE_BINDING;
        Ok(Self {
            device: device.clone(),
            size,
            outlines,
            target: texture(size, format, if format.samples > 1 { drawn } else { drawn | read }),
            resolved: (format.samples > 1).then(|| texture(size, one_sample(format.format), drawn | read)),
            depth: texture(size, TargetFormat { format: DEPTH, ..format }, drawn),
            places: texture(looked, one_sample(PLACE), drawn | read),
            faces: texture(looked, one_sample(PLACE), drawn | read),
            mask: texture(looked, one_sample(wgpu::TextureFormat::R32Uint), stored | read),
            sums,
        })
    }

    /// Target of the passes.
    pub(crate) fn pass_target(&self) -> PassTarget<'_> {
        PassTarget {
            view: &self.target,
            resolved: self.resolved.as_ref(),
            depth: &self.depth,
            keep: Keep::default(),
        }
    }

    /// The finished picture of a pass.
    pub(crate) fn picture(&self) -> &wgpu::TextureView {
        self.resolved.as_ref().unwrap_or(&self.target)
    }

    /// Waits for all work and reads the picture, in linear RGB.
    ///
    /// # Errors
    /// [`GpuError`] of the device.
    pub fn read(&self) -> Result<Picture, GpuError> {
        let bytes = self.device.read(&self.sums)?;
        let values: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        let colours = values.iter().map(|[r, g, b, _]| Vec3::new(*r, *g, *b)).collect();
        Ok(Grid::from_vec(self.size, colours).unwrap_or_else(|| unreachable!("one colour a pixel")))
    }
}

/// View of a new texture of one level and layer.
pub(crate) fn texture(
    device: &Device,
    size: Size,
    TargetFormat { format, samples }: TargetFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::TextureView {
    let texture = device.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width: size.width as u32,
            height: size.height as u32,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: samples,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
