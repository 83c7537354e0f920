//! Shaders for other programs: decoding and shading of one method, in several languages, with one lobe or for
//! the materials of a renderer.
//!
//! In [`TABLE`] a row is a language. WGSL is our own text, comments and all; the others are written by naga
//! from the same text, as a library of functions whose names begin with `ndf_`, so that they stand in an
//! engine's own shader without a clash. SPIR-V is no text to include: it is a whole fragment shader.

mod conventions;
mod names;
mod prune;

use std::fmt::Write as _;

use naga::back;
use naga::compact::{KeepUnused, compact};
use ndfmap_core::brdf::{Brdf, Lambert};
use ndfmap_core::compact::{Bits, Compact};
use ndfmap_core::ndf::{FormKind, Method};
use ndfmap_core::shader::{self, LOOKUP};
use ndfmap_core::units::SlopeVariance;

pub use self::conventions::{Convention, TABLE as CONVENTIONS};
use self::names::{PREFIX, foreign, is_own, prefixed};
use self::prune::{declares, pruned};
use crate::GpuError;
use crate::link::{Linked, check};

/// A row of [`TABLE`].
pub struct Language {
    /// Spelling on the command line.
    pub name: &'static str,
    /// Other names that people know it by.
    pub aliases: &'static [&'static str],
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Way of handing textures to the library; `None` for a language without text to include, and so without
    /// a library.
    textures: Option<Textures>,
    /// True for a language without variables at module scope: functions that need one take it as their last
    /// argument.
    passes_variables: bool,
    /// True for a language whose text is handed out as it is; naga writes the others, and wants an entry
    /// point.
    own_text: bool,
    /// Writes a linked library.
    write: fn(&Linked) -> Result<Vec<u8>, String>,
}

/// A way of handing textures to functions.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Textures {
    /// Texture and sampler apart.
    WithSampler,
    /// Samplers that are textures too.
    Combined,
}

impl Textures {
    /// Arguments for a texture of this name.
    fn arguments(self, name: &str) -> String {
        match self {
            Self::WithSampler => format!("{name}, {name}_sampler"),
            Self::Combined => name.to_owned(),
        }
    }
}

/// Sentence about a measured lobe in a language without variables at module scope.
const OWN_VARIABLE: &str = "\n\nThe last argument, after the place, is a `thread uint` of the caller's own that is 0: the functions count \
                            channels in it.";

/// Every language.
pub static TABLE: &[Language] = &[
    Language {
        name: "wgsl",
        aliases: &["webgpu"],
        summary: "WebGPU Shading Language: our own text, with its comments",
        textures: Some(Textures::WithSampler),
        passes_variables: false,
        own_text: true,
        write: |linked| {
            let text = pruned(&linked.text);
            // A local may have the name of what was left out: it keeps its own.
            let mut names = foreign(&linked.module);
            names.retain(|name| declares(&text, name));
            Ok(prefixed(&text, &names).into_bytes())
        },
    },
    Language {
        name: "glsl",
        aliases: &["opengl", "vulkan-glsl"],
        summary: "GLSL 4.50, to be included after `#version`",
        textures: Some(Textures::Combined),
        passes_variables: false,
        own_text: false,
        write: |linked| glsl(linked, back::glsl::Version::Desktop(450), ""),
    },
    Language {
        name: "glsl-es",
        aliases: &["webgl", "essl"],
        summary: "GLSL ES 3.00 (WebGL 2), to be included after `#version`",
        textures: Some(Textures::Combined),
        passes_variables: false,
        own_text: false,
        write: |linked| glsl(linked, back::glsl::Version::new_gles(300), ES_PRECISION),
    },
    Language {
        name: "hlsl",
        aliases: &["directx", "d3d"],
        summary: "HLSL, shader model 5.1 and up",
        textures: Some(Textures::WithSampler),
        passes_variables: false,
        own_text: false,
        write: hlsl,
    },
    Language {
        name: "msl",
        aliases: &["metal"],
        summary: "Metal Shading Language 2.4",
        textures: Some(Textures::WithSampler),
        passes_variables: true,
        own_text: false,
        write: msl,
    },
    Language {
        name: "spirv",
        aliases: &["spir-v", "spv", "vulkan"],
        summary: "SPIR-V 1.3: a fragment shader `main`, map and sampler at set 0, bindings 0 and 1",
        textures: None,
        passes_variables: false,
        own_text: false,
        write: spirv,
    },
];

/// Shading that a shader does.
#[derive(Clone, Copy)]
pub enum Shading<'a> {
    /// Lobe in a model, the same everywhere: `ndf_shade` looks up and shades.
    Lobe(&'a Brdf),
    /// Materials of a renderer: `ndf_decode_lobes` looks up, `ndf_shade` and `ndf_shade_environment` take a
    /// material.
    Materials {
        /// Renderer whose light it is.
        convention: &'a Convention,
        /// Attributes that the map's lobes carry, 0 to 2: matt albedo, and reflectance at normal incidence.
        attributes: usize,
        /// Levels of the normal map that the map leaves out.
        from_level: usize,
    },
}

/// A shader to be exported.
pub struct Export<'a> {
    /// Method whose baked map the shader reads.
    pub method: &'a dyn Method,
    /// Shading around the map.
    pub shading: Shading<'a>,
    /// Ranges of the map's integers; `None` for a map in floats.
    pub compact: Option<&'a Compact>,
}

impl Export<'_> {
    /// Writes the shader in a language.
    ///
    /// # Errors
    /// [`GpuError::Shader`] when the language cannot express the shader; [`GpuError::Unsuited`] for integers
    /// of a method that is read texel by texel, for materials of one whose texels are no sums of lobes, and
    /// for materials in a language that is no text.
    pub fn to(&self, language: &Language) -> Result<Vec<u8>, GpuError> {
        if self.compact.is_some() && !self.method.filterable() {
            let reason = "is read texel by texel, of a map in floats: bake it with `--precision half`";
            return Err(GpuError::Unsuited { subject: self.method.to_string(), reason });
        }
        let (library, entry) = match self.shading {
            Shading::Lobe(brdf) => (self.lobe_library(brdf), include_str!("entry.wgsl")),
            Shading::Materials { convention, attributes, .. } => {
                if self.method.shader().form() != FormKind::Lobes || !self.method.filterable() {
                    let reason = "has no lobes that a renderer could shade one by one: `vmf:J` has";
                    return Err(GpuError::Unsuited { subject: self.method.to_string(), reason });
                }
                if language.textures.is_none() {
                    let reason = "is a whole shader, where materials are a renderer's own: take glsl, and compile both";
                    return Err(GpuError::Unsuited { subject: language.name.to_owned(), reason });
                }
                (self.material_library(convention, attributes), include_str!("material_entry.wgsl"))
            }
        };
        // Our own text needs no entry point; naga wants one, to see which functions are used.
        let linked = if language.own_text { check(library)? } else { check(library + "\n" + entry)? };
        let body = (language.write)(&linked)
            .map_err(|e| GpuError::Shader(format!("{} cannot say it: {e}", language.name)))?;
        let Some(textures) = language.textures else { return Ok(body) };
        let head: String = self.head(textures, language).lines().fold(String::new(), |mut head, line| {
            // Writing to a string cannot fail.
            let _ = writeln!(head, "{}", format!("// {line}").trim_end());
            head
        });
        Ok([head.into_bytes(), body].concat())
    }

    /// Linked text of a library for one lobe, without an entry point.
    fn lobe_library(&self, brdf: &Brdf) -> String {
        let lobe = &*brdf.lobe;
        let (least, most) = (SlopeVariance::ZERO, SlopeVariance::ZERO);
        let table = self.method.shader_table(brdf, least, most);
        let entry = |(i, (lobe, diffuse)): (usize, (&[f32], f32))| {
            let (first, last, lobe) = (3 * i, 3 * i + 2, lobe[0]);
            format!("    brdf.table[{first}].x = {lobe:?};\n    brdf.table[{last}].w = {diffuse:?};\n")
        };
        let text = format!(
            "// The lobe {}, in the model `{}`.\nfn ndf_brdf() -> Brdf {{\n    var brdf: Brdf;\n    \
             brdf.base = {:?};\n    brdf.shading = {}u;\n{}    return brdf;\n}}\n",
            lobe,
            brdf.shading,
            lobe.base() as f32,
            brdf.shading.index(),
            table.lobe().zip(table.diffuse()).enumerate().map(entry).collect::<String>()
        );
        let method = shader::link(self.method, lobe, 0);
        let library = include_str!("library.wgsl");
        if self.method.filterable() {
            [&method, &*self.look_up(0), &text, library, include_str!("shaded.wgsl")].join("\n")
        } else {
            [&method, LOOKUP, &text, library, include_str!("texels.wgsl")].join("\n")
        }
    }

    /// Linked text of a library for materials, without an entry point.
    fn material_library(&self, convention: &Convention, attributes: usize) -> String {
        // A method's text wants a lobe beside it, which materials do without.
        let method = shader::link(self.method, &Lambert::SHARP, attributes);
        let [lobes, material] = [include_str!("lobes.wgsl"), include_str!("material.wgsl")];
        [&method, &*self.look_up(attributes), lobes, convention.text, material].join("\n")
    }

    /// Text that looks up the channels of a method whose channels may be mixed.
    fn look_up(&self, attributes: usize) -> String {
        match self.compact {
            None => include_str!("filtered.wgsl").to_owned(),
            Some(compact) => {
                channels_of(compact, self.method.layers_with(attributes))
                    + "\n"
                    + include_str!("integers.wgsl")
            }
        }
    }

    /// Text at the head of the file.
    fn head(&self, textures: Textures, language: &Language) -> String {
        let sampler = if self.method.filterable() {
            "a sampler that filters linearly on all three axes"
        } else {
            "any sampler: this method reads texels one by one, of a map that repeats"
        };
        let method = self.method.to_string();
        let (subject, attributes) = match self.shading {
            Shading::Lobe(brdf) => (format!("lobe {}, model {}", brdf.lobe, brdf.shading.name()), 0),
            Shading::Materials { convention, attributes, .. } => {
                (format!("for {} ({})", convention.name, convention.summary), attributes)
            }
        };
        let all = self.method.layers_with(attributes);
        let (layers, texels) = match self.compact.map(Compact::bits) {
            None => (all, "half floats"),
            Some(bits) => (bits.layers(all), texels_of(bits)),
        };
        let map = textures.arguments("map");
        let calls = match self.shading {
            Shading::Lobe(brdf) => {
                let own = language.passes_variables && brdf.lobe.measured().is_some();
                format!(
                    "ndf_shade({map}, uv, place)\n\n\
                     with uv from 0 to 1 over the map, v down its rows, and a place in the tangent frame (x along u, y against v, z out):\n\
                     unit vectors to light and eye, albedo, reflectance at normal incidence. It returns the radiance to the eye, for each\n\
                     unit of the light's irradiance on a plane that faces it. Call it once a light, and add.{}",
                    if own { OWN_VARIABLE } else { "" }
                )
            }
            Shading::Materials { from_level, .. } => {
                let calls = [
                    ("lobes = ndf_decode_lobes(", format!("{map}, uv)"), "once a place"),
                    ("ndf_shade(", "lobes, material, wi, wo)".to_owned(), "once a light"),
                    (
                        "ndf_shade_environment(",
                        format!("lobes, material, wo, frame, {}, levels)", textures.arguments("room")),
                        "",
                    ),
                ];
                let lines = calls.map(|(name, arguments, when)| {
                    format!("{:64}{when}", format!("{name}{arguments}")).trim_end().to_owned()
                });
                let share = if from_level == 0 {
                    String::new()
                } else {
                    format!(
                        "\nThe map's finest level is level {from_level} of the normal map: it counts for `ndf_share(dx, dy, \
                         {from_level}.0, taps)` of the light,\nand the normal map for the rest."
                    )
                };
                format!(
                    "{}\n\n\
                     with uv from 0 to 1 over the map, v down its rows, and directions in the tangent frame (x along u, y against v, z\n\
                     out). A material is a matt albedo, a reflectance at normal incidence, and a width `alpha`, the square of glTF's\n\
                     roughness. A light's radiance comes for each unit of its irradiance on a plane that faces it; an environment's is\n\
                     the mirrored light alone: matt light goes by `ndf_normal(lobes)`.{share}",
                    lines.join("\n    "),
                )
            }
        };
        format!(
            "Normal distribution map, method {method}, {subject}. Made by ndfmap {}.\n\
             \n\
             Bind the map that `ndfmap bake --method {method}` made as a 2-D array texture of {layers} layers, {texels}, with all\n\
             its levels and no sRGB decoding, and {sampler}. Then call\n\
             \n    {calls}",
            env!("CARGO_PKG_VERSION"),
        )
    }
}

/// Kind of the texels of a map in integers, for people who bind it.
fn texels_of(bits: Bits) -> &'static str {
    match bits {
        Bits::Eight => "RGBA8 unorm",
        Bits::Ten => "RGB10A2 unorm",
        Bits::Sixteen => "RGBA16 unorm",
    }
}

/// Text of the function that takes filtered integers to their ranges, channel by channel.
fn channels_of(compact: &Compact, layers: usize) -> String {
    let bits = compact.bits();
    let stored = bits.layers(layers);
    let mut text = format!(
        "// Layers as they are stored. Ranges are affine, so that filtered integers become filtered sums.\n\
         const STORED_LAYERS = {stored}u;\n\
         fn ndf_channels(stored: array<vec4<f32>, STORED_LAYERS>) -> Channels {{\n    var channels: Channels;\n"
    );
    for layer in 0..layers {
        let four =
            |of: &dyn Fn(usize) -> String| (4 * layer..4 * layer + 4).map(of).collect::<Vec<_>>().join(", ");
        let range = |c: usize| compact.ranges()[c];
        let low = four(&|c| format!("{:?}", range(c).low));
        let span = four(&|c| format!("{:?}", range(c).high - range(c).low));
        let place = four(&|c| {
            format!("stored[{}].{}", c / bits.channels(), ["x", "y", "z", "w"][c % bits.channels()])
        });
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "    channels[{layer}] = vec4<f32>({low}) + vec4<f32>({span}) * vec4<f32>({place});"
        );
    }
    text + "    return channels;\n}\n"
}

/// Returns the module under names that clash with nobody's, without unused parts.
fn private(linked: &Linked) -> Result<(naga::Module, naga::valid::ModuleInfo), String> {
    let mut module = linked.module.clone();
    compact(&mut module, KeepUnused::No);
    let own = |name: &mut Option<String>| {
        if let Some(name) = name
            && !is_own(name)
        {
            name.insert_str(0, PREFIX);
        }
    };
    module.functions.iter_mut().for_each(|(_, function)| own(&mut function.name));
    module.constants.iter_mut().for_each(|(_, constant)| own(&mut constant.name));
    module.global_variables.iter_mut().for_each(|(_, global)| own(&mut global.name));
    let types: Vec<_> = module.types.iter().map(|(handle, ty)| (handle, ty.clone())).collect();
    for (handle, mut ty) in types {
        let before = ty.name.clone();
        own(&mut ty.name);
        if ty.name != before {
            module.types.replace(handle, ty);
        }
    }
    let flags = naga::valid::ValidationFlags::all();
    let info = naga::valid::Validator::new(flags, naga::valid::Capabilities::default())
        .validate(&module)
        .map_err(|e| e.to_string())?;
    Ok((module, info))
}

/// Returns the module as a library: without the entry point, which only told what is used, and without its
/// bindings.
fn library(linked: &Linked) -> Result<(naga::Module, naga::valid::ModuleInfo), String> {
    let (mut module, _) = private(linked)?;
    module.entry_points.clear();
    // Nothing but the entry point refers to bindings, which are declared with it, last.
    let mut kept = naga::Arena::new();
    for (handle, global) in module.global_variables.iter() {
        if global.space == naga::AddressSpace::Private {
            let same = kept.append(global.clone(), module.global_variables.get_span(handle)) == handle;
            if !same {
                return Err("a private variable is declared after a binding".to_owned());
            }
        }
    }
    module.global_variables = kept;
    let flags = naga::valid::ValidationFlags::all();
    let info = naga::valid::Validator::new(flags, naga::valid::Capabilities::default())
        .validate(&module)
        .map_err(|e| e.to_string())?;
    Ok((module, info))
}

/// Precision of array textures, for which GLSL ES has no default.
const ES_PRECISION: &str = "precision highp sampler2DArray;\n";

fn glsl(linked: &Linked, version: back::glsl::Version, before: &str) -> Result<Vec<u8>, String> {
    let (module, info) = private(linked)?;
    let mut text = String::new();
    let options = back::glsl::Options { version, ..back::glsl::Options::default() };
    let pipeline = back::glsl::PipelineOptions {
        shader_stage: naga::ShaderStage::Fragment,
        entry_point: "main".to_owned(),
        multiview: None,
    };
    let policies = naga::proc::BoundsCheckPolicies::default();
    back::glsl::Writer::new(&mut text, &module, &info, &options, &pipeline, policies)
        .and_then(|mut writer| writer.write())
        .map_err(|e| e.to_string())?;
    // Only the functions: the text before `main`, without the version and all that only `main` binds, reads
    // and writes.
    let functions = text.split("void main()").next().unwrap_or_default();
    let own = |line: &&str| {
        let bound = ["#version", "uniform ", "layout(", "smooth in ", "in ", "out "];
        !bound.iter().any(|word| line.trim_start().starts_with(word))
    };
    let functions = functions.lines().filter(own).collect::<Vec<_>>().join("\n");
    Ok(format!("{before}{functions}\n").into_bytes())
}

fn hlsl(linked: &Linked) -> Result<Vec<u8>, String> {
    let (module, info) = library(linked)?;
    let mut text = String::new();
    let options =
        back::hlsl::Options { shader_model: back::hlsl::ShaderModel::V5_1, ..back::hlsl::Options::default() };
    let pipeline = back::hlsl::PipelineOptions::default();
    back::hlsl::Writer::new(&mut text, &options, &pipeline)
        .write(&module, &info, None)
        .map_err(|e| e.to_string())?;
    // Structs are filled by their callers, and in no buffer: the members that would align them are no use.
    let padding =
        |line: &&str| ["int _pad", "int _end_pad"].iter().any(|pad| line.trim_start().starts_with(pad));
    Ok(text
        .lines()
        .filter(|line| !padding(line))
        .fold(String::new(), |text, line| text + line + "\n")
        .into_bytes())
}

fn msl(linked: &Linked) -> Result<Vec<u8>, String> {
    let (module, info) = library(linked)?;
    let options = back::msl::Options { lang_version: (2, 4), ..back::msl::Options::default() };
    let pipeline = back::msl::PipelineOptions::default();
    let (text, _) =
        back::msl::write_string(&module, &info, &options, &pipeline).map_err(|e| e.to_string())?;
    Ok(text.into_bytes())
}

fn spirv(linked: &Linked) -> Result<Vec<u8>, String> {
    let (module, info) = private(linked)?;
    let options = back::spv::Options { lang_version: (1, 3), ..back::spv::Options::default() };
    let words = back::spv::write_vec(&module, &info, &options, None).map_err(|e| e.to_string())?;
    Ok(words.iter().flat_map(|word| word.to_le_bytes()).collect())
}

#[cfg(test)]
mod tests {
    use ndfmap_core::compact::Range;
    use ndfmap_core::ndf::AnyMethod;

    use super::*;

    /// Numbers of a vector in WGSL.
    fn vector(text: &str) -> Vec<f32> {
        text.split(", ").map(|number| number.parse().unwrap_or(f32::NAN)).collect()
    }

    #[test]
    fn integers_come_to_the_values_that_they_stand_for() {
        let method = "vmf:3".parse::<AnyMethod>().expect("a method");
        let layers = method.layers();
        let range = |c: usize| Range { low: -0.125 * c as f32, high: 0.5 + 0.25 * c as f32 };
        for bits in Bits::ALL {
            let compact = Compact::new(bits, (0..4 * layers).map(range).collect(), method.encoding());
            // Integers as a sampler reads them: channel c holds 7 c + 3.
            let integer = |c: usize| (7 * c + 3) as u16;
            let unorm = |c: usize| f32::from(integer(c)) / f32::from(bits.most());
            let text = channels_of(&compact, layers);
            assert!(text.contains(&format!("STORED_LAYERS = {}u", bits.layers(layers))));
            let lines = text.lines().filter(|line| line.trim_start().starts_with("channels["));
            for (layer, line) in lines.enumerate() {
                let parts: Vec<&str> = line.split("vec4<f32>(").skip(1).collect();
                let inside = |k: usize| parts[k].split(')').next().unwrap_or_default();
                let (low, span) = (vector(inside(0)), vector(inside(1)));
                for (k, place) in inside(2).split(", ").enumerate() {
                    let (stored, component) = place.split_once("].").expect("stored[i].x");
                    let stored: usize = stored["stored[".len()..].parse().expect("a layer");
                    let component = "xyzw".find(component).expect("a component");
                    let got = low[k] + span[k] * unorm(stored * bits.channels() + component);
                    let c = 4 * layer + k;
                    // Single precision, of numbers up to 3.
                    assert!((got - compact.value(c, integer(c))).abs() < 1e-6, "{bits} {c}: {got}");
                }
            }
        }
    }
}
