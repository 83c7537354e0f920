//! Shaders: the text that shades a filtered texel, for one method and one lobe.
//!
//! Beside each Rust function that a shader needs lies its twin in WGSL, of the same name. Declarations in WGSL may stand in any
//! order, so linking is concatenation: constants, what all shaders share, the lobe, the method. There are no bindings and no
//! entry points in it; textures, samplers and parameters come as arguments.

use std::fmt::Display;

use crate::brdf::{Lobe, Microfacets};
use crate::ndf::Method;

/// A method's own part of a shader.
#[derive(Clone, Debug, PartialEq)]
pub struct Shader {
    /// Constants that its text refers to, as declarations.
    pub constants: String,
    /// Entries of the table that [`Method::shader_table`] makes.
    pub table: usize,
    /// Its text.
    pub sources: &'static [&'static str],
    /// True when its text has `reflect_displaced` for itself: it knows of displacement.
    pub displaces: bool,
    /// What lights its texels by an environment: `reflect_environment`.
    pub environment: &'static str,
}

/// What makes a method's texels sums of isotropic lobes.
const MIXTURE: &str = include_str!("ndf/mixture.wgsl");

/// What some methods and all environments have.
const SPHERE: &str = include_str!("sphere.wgsl");

impl Shader {
    /// One without constants or a table.
    #[must_use]
    pub(crate) fn new(sources: &'static [&'static str]) -> Self {
        let environment = if sources.contains(&MIXTURE) {
            include_str!("ndf/mixture_environment.wgsl")
        } else {
            include_str!("ndf/whole_environment.wgsl")
        };
        Self { constants: String::new(), table: 1, sources, displaces: false, environment }
    }

    /// One whose text has `reflect_displaced`.
    #[must_use]
    pub(crate) fn displaces(self) -> Self {
        Self { displaces: true, environment: include_str!("ndf/leadr_environment.wgsl"), ..self }
    }

    /// Adds a constant.
    #[must_use]
    pub(crate) fn constant(mut self, name: &str, value: impl Constant) -> Self {
        self.constants += &value.declare(name);
        self
    }
}

/// A value that WGSL has a type for.
pub(crate) trait Constant: Display {
    /// Name of the type.
    const TYPE: &str;
    /// What follows a number of this type.
    const SUFFIX: &str;

    /// The declaration.
    fn declare(&self, name: &str) -> String {
        format!("const {name}: {} = {self}{};\n", Self::TYPE, Self::SUFFIX)
    }
}

impl Constant for bool {
    const TYPE: &str = "bool";
    const SUFFIX: &str = "";
}

impl Constant for u32 {
    const TYPE: &str = "u32";
    const SUFFIX: &str = "u";
}

impl Constant for f32 {
    const TYPE: &str = "f32";
    const SUFFIX: &str = "f";
}

/// What every shader has: [`crate::brdf`], [`crate::brdf`], [`crate::ndf`] in common.
const SHARED: [&str; 4] = [
    include_str!("brdf/shading.wgsl"),
    include_str!("brdf/lambert.wgsl"),
    include_str!("brdf/masking.wgsl"),
    include_str!("ndf/reflect.wgsl"),
];

/// Filtered look-ups, the twin of [`crate::lookup`].
pub const LOOKUP: &str = include_str!("lookup.wgsl");

/// The text that decodes and shades texels of a method with a lobe.
///
/// `attributes` (0 to 2) is how many colours each lobe carries: albedo with roughness, and specular colour.
///
/// # Panics
/// When there are attributes and the method has no fitted lobes to carry them.
#[must_use]
pub fn link(method: &dyn Method, lobe: &dyn Lobe, attributes: usize) -> String {
    assert!(attributes == 0 || method.fit().is_some(), "only fitted lobes carry attributes");
    let own = method.shader();
    let layers = method.layers() as u32;
    let constants = [
        ("LAYERS", layers),
        ("ATTRIBUTES", attributes as u32),
        ("ALL_LAYERS", layers * (1 + attributes as u32)),
        ("TABLE", own.table as u32),
    ];
    let mut text: String = constants.iter().map(|(name, value)| value.declare(name)).collect();
    text += &own.displaces.declare("DISPLACES");
    text += &own.constants;
    let plain: &[&str] = if own.displaces { &[] } else { &[include_str!("ndf/undisplaced.wgsl")] };
    let lobe = lobe.shader();
    for source in SHARED.iter().chain([&&*lobe]).chain(own.sources).chain(plain) {
        text.push('\n');
        text += source;
    }
    text
}

/// What environments share: [`crate::light`], [`crate::ndf`] under them.
const ENVIRONMENT: [&str; 6] = [
    include_str!("light/environment/environment.wgsl"),
    include_str!("light/environment/cube.wgsl"),
    include_str!("light/environment/harmonics.wgsl"),
    include_str!("light/environment/half_vectors.wgsl"),
    include_str!("light/split_sum.wgsl"),
    include_str!("ndf/environment.wgsl"),
];

/// The text that lights texels by an environment, to stand beside what [`link`] makes: `reflect_environment`. What the host brings besides is
/// said in `light/environment/environment.wgsl`.
#[must_use]
pub fn link_environment(method: &dyn Method, lobe: &dyn Lobe) -> String {
    let own = method.shader();
    let mut text = (lobe.microfacets() == Microfacets::Beckmann).declare("GAUSSIAN_FACETS");
    let sphere = (!own.sources.contains(&SPHERE)).then_some(SPHERE);
    for source in ENVIRONMENT.iter().copied().chain(sphere).chain([own.environment]) {
        text.push('\n');
        text += source;
    }
    text
}

/// The text of one normal's reflection by a lobe, without a method: what a truth is made of.
#[must_use]
pub fn link_lobe(lobe: &dyn Lobe) -> String {
    let [brdf, lambert, masking, _] = SHARED;
    [&1u32.declare("TABLE"), brdf, lambert, masking, &*lobe.shader()].join("\n")
}
