//! Shaders: the text that shades a filtered texel, for one method and one lobe.
//!
//! Beside each Rust function that a shader needs lies its twin in WGSL, of the same name. Declarations in
//! WGSL may stand in any order, so linking is concatenation: constants, the texts that all shaders share, the
//! lobe, the method. The text has no bindings and no entry points; textures, samplers and parameters come as
//! arguments.

use std::fmt::Display;

use crate::brdf::{Lobe, Microfacets};
use crate::ndf::{FormKind, Method};

/// A method's own part of a shader.
#[derive(Clone, Debug, PartialEq)]
pub struct Shader {
    form: FormKind,
    constants: String,
    entries: usize,
    sources: &'static [&'static str],
}

/// Directions and spherical harmonics, which some methods and all environments need.
const SPHERE: &str = include_str!("sphere.wgsl");

impl Shader {
    /// Text of a method whose texels are shaded in this form, without constants or a table.
    ///
    /// The file of the form, `ndf/mixture.wgsl` or `ndf/whole.wgsl`, says what the text must hold besides
    /// `decode`.
    #[must_use]
    pub fn new(form: FormKind, sources: &'static [&'static str]) -> Self {
        Self { form, constants: String::new(), entries: 1, sources }
    }

    /// Returns it with a constant that the text refers to.
    #[must_use]
    pub fn constant(mut self, name: &str, value: impl Constant) -> Self {
        self.constants += &value.declare(name);
        self
    }

    /// Returns it with a table of so many entries, which [`Method::shader_table`] makes.
    #[must_use]
    pub fn table(self, entries: usize) -> Self {
        Self { entries, ..self }
    }

    /// Form that the text shades.
    #[must_use]
    pub fn form(&self) -> FormKind {
        self.form
    }

    /// Entries of the table; one at least, of zeros for a method without a table.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.entries
    }

    /// Texts that shade texels of the form.
    fn form_sources(&self) -> &'static [&'static str] {
        const PLAIN: &str = include_str!("ndf/undisplaced.wgsl");
        const WHOLE: &str = include_str!("ndf/whole.wgsl");
        match self.form {
            FormKind::Lobes => &[include_str!("ndf/mixture.wgsl"), PLAIN],
            FormKind::Slopes => &[WHOLE, include_str!("ndf/leadr.wgsl")],
            FormKind::Whole => &[WHOLE, PLAIN],
        }
    }

    /// Text that lights texels of the form by an environment.
    fn environment_source(&self) -> &'static str {
        match self.form {
            FormKind::Lobes => include_str!("ndf/mixture_environment.wgsl"),
            FormKind::Slopes => include_str!("ndf/leadr_environment.wgsl"),
            FormKind::Whole => include_str!("ndf/whole_environment.wgsl"),
        }
    }
}

/// Roughnesses for which a [`LobeTable`] holds a lobe's numbers.
pub const TABLE_ROUGHNESSES: usize = 11;

/// Numbers of a lobe that a method's shader wants, entry by entry: each at [`TABLE_ROUGHNESSES`] roughnesses,
/// and of the diffuse lobe.
#[derive(Clone, Debug, PartialEq)]
pub struct LobeTable {
    entries: Vec<[f32; TABLE_ROUGHNESSES + 1]>,
}

impl LobeTable {
    /// Table of zeros.
    #[must_use]
    pub fn new(entries: usize) -> Self {
        Self { entries: vec![[0.0; TABLE_ROUGHNESSES + 1]; entries] }
    }

    /// Tables one after the other.
    pub(crate) fn concat(tables: &[Self]) -> Self {
        Self { entries: tables.iter().flat_map(|table| table.entries.clone()).collect() }
    }

    /// Sets the numbers of the lobe at a roughness, counted from the least.
    pub fn set(&mut self, roughness: usize, numbers: &[f64]) {
        self.entries.iter_mut().zip(numbers).for_each(|(entry, number)| entry[roughness] = *number as f32);
    }

    /// Sets the numbers of the diffuse lobe.
    pub fn set_diffuse(&mut self, numbers: &[f64]) {
        self.set(TABLE_ROUGHNESSES, numbers);
    }

    /// Every entry: the lobe's number at each roughness.
    pub fn lobe(&self) -> impl Iterator<Item = &[f32]> {
        self.entries.iter().map(|entry| &entry[..TABLE_ROUGHNESSES])
    }

    /// Every entry's number of the diffuse lobe.
    pub fn diffuse(&self) -> impl Iterator<Item = f32> {
        self.entries.iter().map(|entry| entry[TABLE_ROUGHNESSES])
    }

    /// All numbers as shaders lay them out, entry by entry, the diffuse lobe's last in each.
    #[must_use]
    pub fn as_flat(&self) -> &[f32] {
        self.entries.as_flattened()
    }
}

/// A value that WGSL has a type for.
pub trait Constant: Display {
    /// Name of the type.
    const TYPE: &str;
    /// Suffix of a number of this type.
    const SUFFIX: &str;

    /// Declaration of a constant of this name.
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

/// Texts of every shader: those that all of [`crate::brdf`] and [`crate::ndf`] have in common.
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
/// When there are attributes and the method has no lobes to carry them.
#[must_use]
pub fn link(method: &dyn Method, lobe: &dyn Lobe, attributes: usize) -> String {
    assert!(attributes == 0 || method.carries_attributes(), "only fitted lobes carry attributes");
    let own = method.shader();
    let layers = method.layers() as u32;
    let (lobes, layers_each) =
        method.lobe_layout().map_or((0, 0), |layout| (layout.count as u32, layout.layers_each as u32));
    let constants = [
        ("LAYERS", layers),
        ("LOBES", lobes),
        ("LAYERS_EACH", layers_each),
        ("ATTRIBUTES", attributes as u32),
        ("ALL_LAYERS", method.layers_with(attributes) as u32),
        ("TABLE", own.entries as u32),
    ];
    let mut text: String = constants.iter().map(|(name, value)| value.declare(name)).collect();
    text += &method.knows_displacement().declare("KNOWS_DISPLACEMENT");
    text += &own.constants;
    let lobe = lobe.shader();
    for source in SHARED.iter().chain([&&*lobe]).chain(own.sources).chain(own.form_sources()) {
        text.push('\n');
        text += source;
    }
    text
}

/// Texts of every environment: [`crate::light`], and [`crate::ndf`] under environments.
const ENVIRONMENT: [&str; 6] = [
    include_str!("light/environment/environment.wgsl"),
    include_str!("light/environment/cube.wgsl"),
    include_str!("light/environment/harmonics.wgsl"),
    include_str!("light/environment/half_vectors.wgsl"),
    include_str!("light/split_sum.wgsl"),
    include_str!("ndf/environment.wgsl"),
];

/// The text that lights texels by an environment, to stand beside what [`link`] makes: `reflect_environment`.
/// The file `light/environment/environment.wgsl` says what else the host must bring.
#[must_use]
pub fn link_environment(method: &dyn Method, lobe: &dyn Lobe) -> String {
    let own = method.shader();
    let mut text = (lobe.microfacets() == Microfacets::Beckmann).declare("GAUSSIAN_FACETS");
    let sphere = (!own.sources.contains(&SPHERE)).then_some(SPHERE);
    for source in ENVIRONMENT.iter().copied().chain(sphere).chain([own.environment_source()]) {
        text.push('\n');
        text += source;
    }
    text
}

/// The text of one normal's reflection by a lobe, without a method, for truths.
#[must_use]
pub fn link_lobe(lobe: &dyn Lobe) -> String {
    let [brdf, lambert, masking, _] = SHARED;
    [&1u32.declare("TABLE"), brdf, lambert, masking, &*lobe.shader()].join("\n")
}
