//! ndfmap-core: the mathematics of filtering normals. No files, no GPU, no window.
//!
//! A *normal distribution map* is a mip pyramid whose texels hold the distribution of the normals under
//! them, so that a highlight on a distant surface is the mean of its look up close. The way through:
//!
//! ```
//! use glam::DVec3;
//! use ndfmap_core::bake::Bake;
//! use ndfmap_core::brdf::{Ggx, Lobe};
//! use ndfmap_core::ndf::{Method, Slopes};
//! use ndfmap_core::units::Alpha;
//! use ndfmap_core::{grid::Size, procedural};
//!
//! // A surface: here a built-in one, elsewhere a normal or height map.
//! let surface = (procedural::find("v-groove").unwrap().build)(Size::new(64, 64)?);
//! // Bake it into every level of a representation of your choice ...
//! let method = Slopes::new();
//! let (pyramid, _) = Bake::new(&*surface, &method).to_pyramid()?;
//! // ... and shade the coarsest texel with any BRDF, chosen now and not when baking.
//! let lobe = Ggx::new(Alpha::new(0.2)?);
//! let straight_up = [DVec3::Z];
//! let mut reflected = [0.0];
//! let last = pyramid.sizes().len() - 1;
//! Method::evaluator(&method, &lobe, &straight_up).evaluate(&pyramid.texel(last, 0, 0), &mut reflected);
//! // Both flanks of the groove lean away: far less light comes straight back than from a flat patch.
//! assert!(reflected[0] < 0.3 * lobe.evaluate(1.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bake;
pub mod brdf;
pub mod compact;
pub mod fit;
pub mod grid;
pub mod light;
pub mod lookup;
pub mod measure;
pub mod ndf;
pub mod observe;
pub mod procedural;
pub mod pyramid;
pub mod roughness;
pub mod shader;
pub mod sphere;
pub mod surface;
pub mod units;
pub mod words;
