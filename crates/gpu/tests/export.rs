//! Exported shaders are taken by compilers that are not ours, for every method and language.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;
use std::process::Command;

use ndfmap_core::brdf::{AnyLobe, Brdf, ShadingModel};
use ndfmap_core::compact::{Bits, Compact, Range};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::{brdf, ndf};
use ndfmap_gpu::export::{CONVENTIONS, Export, Language, Shading, TABLE};

/// True when there is a compiler of this name; without one a test is skipped, visibly, unless told to insist.
fn has(compiler: &str) -> bool {
    let found = Command::new(compiler).arg("--version").output().is_ok();
    if !found {
        // No package has tint: nobody can insist on it.
        let insist = if compiler == "tint" { "NDFMAP_REQUIRE_TINT" } else { "NDFMAP_REQUIRE_INTEROP" };
        common::skipped(&format!("there is no {compiler}"), insist);
    }
    found
}

fn run(compiler: &str, arguments: &[&str], file: &Path) {
    let output = Command::new(compiler).args(arguments).arg(file).output().unwrap();
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{compiler} {arguments:?} {}: {said}", file.display());
}

/// A row of the table.
fn find(name: &str) -> &'static Language {
    TABLE.iter().find(|row| row.name == name).unwrap()
}

/// Every method in a language, each in a file of its own in `folder`: its name, and the bytes.
fn all(language: &str) -> Vec<(String, Vec<u8>)> {
    let language = find(language);
    let mut shaders = Vec::new();
    for (at, spelling) in ndf::TABLE.iter().flat_map(|row| row.samples).enumerate() {
        // Every lobe and model comes up, though not with every method.
        let lobes: Vec<&str> = brdf::TABLE.iter().map(|row| row.samples[0]).collect();
        let lobe = lobes[at % lobes.len()].parse::<AnyLobe>().unwrap();
        let brdf = Brdf { lobe, shading: ShadingModel::ALL[at % ShadingModel::ALL.len()] };
        let method = spelling.parse::<AnyMethod>().unwrap();
        // Floats, and integers of every number of bits.
        let ranges = vec![Range { low: -0.25, high: 1.5 }; 4 * method.layers()];
        let bits = Bits::ALL.get(at % 4).filter(|_| method.filterable());
        let compact = bits.map(|bits| Compact::new(*bits, ranges, method.encoding()));
        let export = Export { method: &*method, shading: Shading::Lobe(&brdf), compact: compact.as_ref() };
        let bytes = export.to(language).unwrap_or_else(|e| panic!("{spelling}: {e}"));
        shaders.push((format!("{at}"), bytes));
    }
    shaders
}

/// Every method that has lobes, in a language, for one convention after the other; and one method for every
/// convention with every number of attributes, in floats and in integers.
fn materials(language: &Language) -> Vec<(String, Vec<u8>)> {
    let methods: Vec<AnyMethod> =
        ndf::TABLE.iter().flat_map(|row| row.samples).map(|spelling| spelling.parse().unwrap()).collect();
    let lobed = methods
        .iter()
        .filter(|method| method.filterable() && method.shader().form() == ndf::FormKind::Lobes)
        .enumerate()
        .map(|(at, method)| (method.clone(), at, 0));
    let two = "vmf:2".parse::<AnyMethod>().unwrap();
    let all = (0..CONVENTIONS.len()).flat_map(|at| (0..3).map(move |attributes| (at, attributes)));
    let mut shaders = Vec::new();
    for (method, at, attributes) in lobed.chain(all.map(|(at, attributes)| (two.clone(), at, attributes))) {
        let convention = &CONVENTIONS[at % CONVENTIONS.len()];
        let ranges = vec![Range { low: -0.25, high: 1.5 }; 4 * method.layers_with(attributes)];
        let bits = Bits::ALL.get((at + attributes) % 4);
        let compact = bits.map(|bits| Compact::new(*bits, ranges, method.encoding()));
        let shading = Shading::Materials { convention, attributes, from_level: at % 2 };
        let bytes = Export { method: &*method, shading, compact: compact.as_ref() }
            .to(language)
            .unwrap_or_else(|e| panic!("{method} for {}: {e}", convention.name));
        shaders.push((format!("{}_{}", shaders.len(), convention.name), bytes));
    }
    shaders
}

#[test]
fn what_has_no_materials_is_refused() {
    let to = |spelling: &str, language: &str| {
        let method = spelling.parse::<AnyMethod>().unwrap();
        let shading = Shading::Materials { convention: &CONVENTIONS[0], attributes: 0, from_level: 0 };
        Export { method: &*method, shading, compact: None }.to(find(language)).map_err(|e| e.to_string())
    };
    for spelling in ["sh:2", "leadr", "slopes", "ndm:gaussian"] {
        assert!(to(spelling, "wgsl").is_err_and(|e| e.contains("has no lobes")), "{spelling}");
    }
    assert!(to("vmf:2", "wgsl").is_ok() && to("toksvig", "hlsl").is_ok());
    assert!(to("vmf:2", "spirv").is_err_and(|e| e.contains("`spirv` is a whole shader")));
}

/// Shader that an engine would write around an included library.
const GLSL_MAIN: &str = "
uniform sampler2DArray map;
in vec2 uv;
in vec3 wi;
in vec3 wo;
out vec4 colour;
void main() {
    NdfPlace place = NdfPlace(normalize(wi), normalize(wo), vec3(0.5), vec3(0.04));
    colour = vec4(ndf_shade(map, uv, place), 1.0);
}
";

/// As [`GLSL_MAIN`], with a material.
const GLSL_MATERIAL: &str = "
uniform sampler2DArray map;
uniform samplerCube room;
in vec2 uv;
in vec3 wi;
in vec3 wo;
out vec4 colour;
void main() {
    NdfLobes lobes = ndf_decode_lobes(map, uv);
    NdfMaterial material = NdfMaterial(vec3(0.5), vec3(0.04), 0.25);
    NdfFrame frame = NdfFrame(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));
    vec3 light = ndf_shade(lobes, material, normalize(wi), normalize(wo));
    light += ndf_shade_environment(lobes, material, normalize(wo), frame, room, 8.0);
    light *= ndf_share(dFdx(uv), dFdy(uv), 1.0, 16.0);
    colour = vec4(light, ndf_normal(lobes).z);
}
";

/// As [`HLSL_MAIN`], with a material.
const HLSL_MATERIAL: &str = "
Texture2DArray<float4> map : register(t0);
SamplerState map_sampler : register(s0);
TextureCube<float4> room : register(t1);
SamplerState room_sampler : register(s1);
float4 main(float2 uv : TEXCOORD0, float3 wi : TEXCOORD1, float3 wo : TEXCOORD2) : SV_Target {
    NdfLobes lobes = ndf_decode_lobes(map, map_sampler, uv);
    NdfMaterial material = (NdfMaterial)0;
    material.diffuse = float3(0.5, 0.5, 0.5);
    material.specular = float3(0.04, 0.04, 0.04);
    material.alpha = 0.25;
    NdfFrame frame;
    frame.tangent = float3(1, 0, 0);
    frame.bitangent = float3(0, 1, 0);
    frame.normal = float3(0, 0, 1);
    float3 light = ndf_shade(lobes, material, normalize(wi), normalize(wo));
    light += ndf_shade_environment(lobes, material, normalize(wo), frame, room, room_sampler, 8.0);
    light *= ndf_share(ddx(uv), ddy(uv), 1.0, 16.0);
    return float4(light, ndf_normal(lobes).z);
}
";

const HLSL_MAIN: &str = "
Texture2DArray<float4> map : register(t0);
SamplerState map_sampler : register(s0);
float4 main(float2 uv : TEXCOORD0, float3 wi : TEXCOORD1, float3 wo : TEXCOORD2) : SV_Target {
    NdfPlace place = (NdfPlace)0;
    place.wi = normalize(wi);
    place.wo = normalize(wo);
    place.diffuse = float3(0.5, 0.5, 0.5);
    place.specular = float3(0.04, 0.04, 0.04);
    return float4(ndf_shade(map, map_sampler, uv, place), 1.0);
}
";

fn glslang(shaders: Vec<(String, Vec<u8>)>, before: &str, after: &str, arguments: &[&str]) {
    if !has("glslangValidator") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in shaders {
        let library = String::from_utf8(bytes).unwrap();
        // Microsoft's compilers take a cast of 0 to an array for its initial value; glslang's HLSL does not
        // know of it.
        let zeroed = |line: &str| {
            line.split_once(" = (").filter(|(_, cast)| cast.ends_with("])0;")).map(|(v, _)| format!("{v};"))
        };
        let library: Vec<String> =
            library.lines().map(|l| zeroed(l).unwrap_or_else(|| l.to_owned())).collect();
        let text = format!("{before}\n{}\n{after}", library.join("\n"));
        let file = folder.path().join(name + ".frag");
        std::fs::write(&file, text).unwrap();
        run("glslangValidator", arguments, &file);
    }
}

#[test]
fn glsl_compiles_in_a_shader_of_its_own() {
    glslang(all("glsl"), "#version 450", GLSL_MAIN, &["-S", "frag"]);
    glslang(materials(find("glsl")), "#version 450", GLSL_MATERIAL, &["-S", "frag"]);
}

#[test]
fn glsl_es_compiles_in_a_shader_of_its_own() {
    glslang(all("glsl-es"), "#version 300 es", GLSL_MAIN, &["-S", "frag"]);
    // Lines that a WebGL 2 shader begins with.
    let head = "#version 300 es\nprecision highp float;";
    glslang(materials(find("glsl-es")), head, GLSL_MATERIAL, &["-S", "frag"]);
}

#[test]
fn hlsl_compiles_in_a_shader_of_its_own() {
    let arguments = ["-D", "-S", "frag", "-e", "main", "-V", "-o", "/dev/null"];
    glslang(all("hlsl"), "", HLSL_MAIN, &arguments);
    glslang(materials(find("hlsl")), "", HLSL_MATERIAL, &arguments);
}

/// Hands every shader of a language to a compiler as it is.
fn compile(language: &str, compiler: &str, arguments: &[&str]) {
    let whole = find(language).name == "spirv";
    let shaders = all(language).into_iter().chain(if whole { Vec::new() } else { materials(find(language)) });
    if !has(compiler) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in shaders {
        let file = folder.path().join(format!("{name}.{language}"));
        std::fs::write(&file, bytes).unwrap();
        run(compiler, arguments, &file);
    }
}

#[test]
fn spirv_is_valid() {
    compile("spirv", "spirv-val", &["--target-env", "vulkan1.1"]);
}

#[test]
fn wgsl_is_valid_to_another_front_end() {
    compile("wgsl", "tint", &["--format", "wgsl", "-o", "/dev/null"]);
}

#[test]
fn metal_has_no_bindings_and_our_names() {
    // There is no compiler for it outside Apple's machines: what can be seen is that it is a library, and
    // called as promised.
    for (name, bytes) in all("msl").into_iter().chain(materials(find("msl"))) {
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.contains("metal::float3 ndf_shade("), "{name}");
        assert!(!text.contains("[[buffer(") && !text.contains("fragment "), "{name}");
    }
}

#[test]
fn wgsl_names_are_the_librarys_own() {
    for (name, bytes) in all("wgsl").into_iter().chain(materials(find("wgsl"))) {
        let text = String::from_utf8(bytes).unwrap();
        let module = naga::front::wgsl::parse_str(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let functions = module.functions.iter().filter_map(|(_, function)| function.name.as_ref());
        let constants = module.constants.iter().filter_map(|(_, constant)| constant.name.as_ref());
        let types = module.types.iter().filter_map(|(_, ty)| ty.name.as_ref());
        for item in functions.chain(constants).chain(types) {
            assert!(item.to_lowercase().starts_with("ndf"), "{name}: {item}");
        }
    }
}

#[test]
fn hlsl_structs_have_no_padding() {
    for (name, bytes) in all("hlsl").into_iter().chain(materials(find("hlsl"))) {
        assert!(!String::from_utf8(bytes).unwrap().contains("_pad"), "{name}");
    }
}
