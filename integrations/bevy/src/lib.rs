//! Normal distribution maps in Bevy: lobes of normals that a texel of a normal map's mips stands for, each
//! shaded by Bevy's own light. Maps are what `ndfmap bake --method vmf:J` writes.
//!
//! ```no_run
//! use bevy::image::{ImageAddressMode, ImageLoaderSettings, ImageSampler, ImageSamplerDescriptor};
//! use bevy::prelude::*;
//! use bevy_ndfmap::{NdfMap3d, NdfPlugin};
//!
//! fn main() {
//!     App::new().add_plugins((DefaultPlugins, NdfPlugin)).add_systems(Startup, set_up).run();
//! }
//!
//! fn set_up(
//!     mut commands: Commands,
//!     assets: Res<AssetServer>,
//!     mut materials: ResMut<Assets<StandardMaterial>>,
//! ) {
//!     // Normals are numbers and no colours, and repeat as their map does. A glTF says so itself.
//!     let normals = assets.load_builder().with_settings(|settings: &mut ImageLoaderSettings| {
//!         settings.is_srgb = false;
//!         settings.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
//!             address_mode_u: ImageAddressMode::Repeat,
//!             address_mode_v: ImageAddressMode::Repeat,
//!             ..ImageSamplerDescriptor::linear()
//!         });
//!     });
//!     let material =
//!         StandardMaterial { normal_map_texture: Some(normals.load("leather.png")), ..default() };
//!     commands.spawn((
//!         Mesh3d(assets.load("chair.glb#Mesh0/Primitive0")),
//!         MeshMaterial3d(materials.add(material)),
//!         NdfMap3d(assets.load("leather.ndf.ktx2")),
//!     ));
//! }
//! ```
//!
//! Lights, shadows, environment maps, fog and tone mapping are Bevy's own. The material keeps its normal map:
//! near by it is what is seen, and the lobes take over as it shrinks.

mod file;
mod map;
mod material;

pub use self::file::FileError;
pub use self::map::{NdfError, NdfLoader, NdfMap, NdfSettings};
pub use self::material::{NdfLobes, NdfMap3d, NdfMaterial, Refusal};

use bevy::asset::embedded_asset;
use bevy::prelude::*;
use bevy::shader::load_shader_library;

/// Plug-in: loader, material and the system that applies [`NdfMap3d`].
pub struct NdfPlugin;

impl Plugin for NdfPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "lobes.wgsl");
        embedded_asset!(app, "material.wgsl");
        app.add_plugins(MaterialPlugin::<NdfMaterial>::default())
            .init_asset::<NdfMap>()
            .init_asset_loader::<NdfLoader>()
            .init_resource::<material::Made>()
            .add_systems(Update, (material::forget, material::apply).chain());
    }
}
