//! ndfmap-maps: files in and out, and the meaning of their channels.
//!
//! Two things come out of files. A **source** ([`source`]) is a picture read as a surface: a normal map
//! or a height map, in any of the formats of [`formats::TABLE`]. A **normal distribution map**
//! ([`NdfMap`]) is the product of a bake: a stored pyramid and a [`Header`] that describes it.

#[cfg(feature = "gltf")]
pub mod asset;
pub mod atomic;
pub mod attribute;
pub mod environment;
mod error;
pub mod formats;
mod header;
mod image;
pub mod merl;
pub mod model;
mod ndf_map;
pub mod picture;
pub mod source;

pub use error::MapError;
pub use formats::{ChannelLayout, WriteOptions};
pub use header::{Attribute, COMPACT_VERSION, Header, Integers, Source, SourceKind, VERSION};
pub use image::{Image, MAX_SIDE, MAX_TEXELS, Samples};
pub use ndf_map::{MAX_ATTRIBUTES, NdfMap, NdfTexel};
