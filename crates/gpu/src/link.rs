//! Linking shaders: the text of core's twins and a pass of ours, checked before any device sees it.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use ndfmap_core::brdf::Lobe;
use ndfmap_core::ndf::Method;
use ndfmap_core::shader::{self, LOOKUP};

use crate::GpuError;

/// Pass that draws, with an entry point for each way to look maps up.
pub const DRAW: &str = include_str!("passes/draw.wgsl");

/// Common part of the draw passes: the camera, the lights, the triangles.
const SCENE: &str = concat!(include_str!("passes/vertices.wgsl"), "\n", include_str!("passes/scene.wgsl"));

/// Material, as the passes that shade know it.
const MATERIAL: &str = include_str!("passes/material.wgsl");

/// Bindings that the pass that draws brings to an environment's shading.
const SURROUNDINGS: &str = include_str!("passes/environment.wgsl");

/// Pass that draws the truth.
const TRUTH: &str = include_str!("passes/truth.wgsl");

/// Pass that draws places and faces.
#[cfg(feature = "render")]
const PLACE: &str = include_str!("passes/place.wgsl");

/// Checked shader.
pub struct Linked {
    /// Text of the shader.
    pub text: String,
    /// Text parsed by naga.
    pub module: naga::Module,
    /// Facts that naga's validation found.
    pub info: ModuleInfo,
}

/// Parses and validates a shader.
///
/// # Errors
/// [`GpuError::Shader`], with the place.
pub fn check(text: String) -> Result<Linked, GpuError> {
    let module =
        naga::front::wgsl::parse_str(&text).map_err(|e| GpuError::Shader(e.emit_to_string(&text)))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::default())
        .validate(&module)
        .map_err(|e| GpuError::Shader(e.emit_to_string(&text)))?;
    Ok(Linked { text, module, info })
}

/// Links the shader that draws a method with a lobe; see [`shader::link`] for `attributes`.
///
/// # Errors
/// [`GpuError::Shader`].
pub fn draw(method: &dyn Method, lobe: &dyn Lobe, attributes: usize) -> Result<Linked, GpuError> {
    let (own, lit) = (shader::link(method, lobe, attributes), shader::link_environment(method, lobe));
    check([&own, &lit, LOOKUP, SCENE, MATERIAL, SURROUNDINGS, DRAW].join("\n"))
}

/// Links the shader that draws the truth of a lobe, without any method.
///
/// # Errors
/// [`GpuError::Shader`].
pub fn truth(lobe: &dyn Lobe) -> Result<Linked, GpuError> {
    check([&shader::link_lobe(lobe), SCENE, MATERIAL, TRUTH].join("\n"))
}

/// Links the shader that draws places and faces, for outlines.
#[cfg(feature = "render")]
pub(crate) fn place() -> Result<Linked, GpuError> {
    check([SCENE, PLACE].join("\n"))
}
