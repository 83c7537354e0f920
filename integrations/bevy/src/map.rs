//! The asset and its loader.

use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext, RenderAssetUsages};
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDataOrder, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use serde::{Deserialize, Serialize};

use crate::file::{File, FileError, Range, Wrap};

/// Map of lobes: an array texture whose layers are lobes, and how to read it.
#[derive(Asset, TypePath, Clone, Debug)]
pub struct NdfMap {
    /// Sums of lobes, with their own levels.
    pub image: Handle<Image>,
    /// Number of lobes.
    pub lobes: usize,
    /// Least value of each lobe's channels.
    pub low: Vec<Vec4>,
    /// Width of the range of each lobe's channels.
    pub span: Vec<Vec4>,
    /// Texels of level 0, which the file may leave out.
    pub size: Vec2,
    /// Levels that the file leaves out.
    pub from_level: u32,
    /// Taps of the anisotropic filter, at most.
    pub anisotropy: u16,
}

/// Settings of the loader.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct NdfSettings {
    /// Taps of the anisotropic filter, at most: 1 to 16.
    pub anisotropy: u16,
}

impl Default for NdfSettings {
    fn default() -> Self {
        Self { anisotropy: 16 }
    }
}

/// Failure to load a map.
#[derive(Debug, thiserror::Error)]
pub enum NdfError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The file is no map of lobes.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Loader of maps in KTX2. Bevy knows it by the asset's type, so that any name does; `.ndf.ktx2` is told
/// apart from other KTX2 by its name too.
#[derive(Default, TypePath)]
pub struct NdfLoader;

impl AssetLoader for NdfLoader {
    type Asset = NdfMap;
    type Settings = NdfSettings;
    type Error = NdfError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &NdfSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<NdfMap, NdfError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let file = File::read(&bytes)?;
        let anisotropy = settings.anisotropy.clamp(1, 16);
        let zero_to_one = vec![Range(0.0, 1.0); 4 * file.lobes];
        let ranges = file.ranges.as_ref().unwrap_or(&zero_to_one);
        let fours = |of: fn(&Range) -> f32| -> Vec<Vec4> {
            let four = |four: &[Range]| Vec4::from_array(std::array::from_fn(|k| of(&four[k])));
            ranges.chunks_exact(4).take(file.lobes).map(four).collect()
        };
        let (low, span) = (fours(|range| range.0), fours(|range| range.1 - range.0));
        let (lobes, from_level) = (file.lobes, file.from_level);
        let size = Vec2::from(file.size.map(|side| side as f32)) * (from_level as f32).exp2();
        let image = context.add_labeled_asset("image".to_owned(), image(file, anisotropy));
        Ok(NdfMap { image, lobes, low, span, size, from_level, anisotropy })
    }

    fn extensions(&self) -> &[&str] {
        &["ndf.ktx2"]
    }
}

/// Array texture of a file's levels.
fn image(file: File, anisotropy: u16) -> Image {
    let format = if file.ranges.is_some() { TextureFormat::Rgba8Unorm } else { TextureFormat::Rgba16Float };
    let [width, height] = file.size;
    let mut image = Image::default();
    image.texture_descriptor.size = Extent3d { width, height, depth_or_array_layers: file.lobes as u32 };
    image.texture_descriptor.dimension = TextureDimension::D2;
    image.texture_descriptor.format = format;
    image.texture_descriptor.mip_level_count = file.levels.len() as u32;
    image.data = Some(file.levels.concat());
    image.data_order = TextureDataOrder::MipMajor;
    image.asset_usage = RenderAssetUsages::RENDER_WORLD;
    // A map of one lobe is an array of one layer, and not a plain texture.
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() });
    let address = |wrap: Wrap| match wrap {
        Wrap::Repeat => ImageAddressMode::Repeat,
        Wrap::Clamp => ImageAddressMode::ClampToEdge,
    };
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: address(file.wrap[0]),
        address_mode_v: address(file.wrap[1]),
        mag_filter: ImageFilterMode::Linear,
        min_filter: ImageFilterMode::Linear,
        mipmap_filter: ImageFilterMode::Linear,
        anisotropy_clamp: anisotropy,
        ..default()
    });
    image
}
