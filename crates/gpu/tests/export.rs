//! Exported shaders are taken by compilers that are not ours, for every method and language.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;
use std::process::Command;

use ndfmap_core::brdf::{AnyLobe, Brdf, ShadingModel};
use ndfmap_core::compact::{Bits, Compact, Range};
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::{brdf, ndf};
use ndfmap_gpu::export::{Export, TABLE};

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

/// Every method in a language, each in a file of its own in `folder`: its name, and the bytes.
fn all(language: &str) -> Vec<(String, Vec<u8>)> {
    let language = TABLE.iter().find(|row| row.name == language).unwrap();
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
        let export = Export { method: &*method, brdf: &brdf, compact: compact.as_ref() };
        let bytes = export.to(language).unwrap_or_else(|e| panic!("{spelling}: {e}"));
        shaders.push((format!("{at}"), bytes));
    }
    shaders
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

fn glslang(language: &str, before: &str, after: &str, arguments: &[&str]) {
    let shaders = all(language);
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
    glslang("glsl", "#version 450", GLSL_MAIN, &["-S", "frag"]);
}

#[test]
fn glsl_es_compiles_in_a_shader_of_its_own() {
    glslang("glsl-es", "#version 300 es", GLSL_MAIN, &["-S", "frag"]);
}

#[test]
fn hlsl_compiles_in_a_shader_of_its_own() {
    glslang("hlsl", "", HLSL_MAIN, &["-D", "-S", "frag", "-e", "main", "-V", "-o", "/dev/null"]);
}

/// Hands every shader of a language to a compiler as it is.
fn compile(language: &str, compiler: &str, arguments: &[&str]) {
    let shaders = all(language);
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
    for (name, bytes) in all("msl") {
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.contains("metal::float3 ndf_shade("), "{name}");
        assert!(!text.contains("[[buffer(") && !text.contains("fragment "), "{name}");
    }
}

#[test]
fn wgsl_names_are_the_librarys_own() {
    for (name, bytes) in all("wgsl") {
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
    for (name, bytes) in all("hlsl") {
        assert!(!String::from_utf8(bytes).unwrap().contains("_pad"), "{name}");
    }
}
