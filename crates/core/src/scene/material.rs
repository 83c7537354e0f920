//! Materials: a normal or height map, what lies under it, and how it reflects.

use std::sync::Arc;

use crate::grid::Grid;
use crate::reflection::{Finish, Reflection};
use crate::surface::Surface;

/// A [`Finish`] for each texel.
#[derive(Clone, Debug)]
pub struct FinishMap {
    /// Diffuse albedo, and the gloss as a slope variance.
    pub diffuse_gloss: Arc<Grid<[f32; 4]>>,
    /// Specular colour, where it changes from place to place; the fourth is 1.
    pub specular: Option<Arc<Grid<[f32; 4]>>>,
}

/// What an object is made of.
pub struct Material {
    /// What it is called.
    pub name: String,
    /// Its normals and heights.
    pub surface: Arc<dyn Surface>,
    /// What is the same everywhere; `finish_map`, where there is one, is in its place.
    pub finish: Finish,
    /// Colours and gloss of each texel, of the surface's size.
    pub finish_map: Option<FinishMap>,
    /// Lobe and model.
    pub reflection: Reflection,
}
