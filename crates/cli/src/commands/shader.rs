//! `ndfmap shader`: decoding and shading of one method, in the language of another program.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use ndfmap::core::brdf::{Brdf, ShadingModel};
use ndfmap::core::compact::Compact;
use ndfmap::core::ndf::{AnyMethod, DEFAULT_METHOD};
use ndfmap::gpu::export::{CONVENTIONS, Convention, Export, Language, Shading, TABLE};
use ndfmap::maps::NdfMap;
use serde_json::json;

use super::arguments::{STANDARD, brdf_spelling, brdfs_help, method_spelling, methods_help, read_brdf};
use super::{make_way, print_bytes, print_json, say_written, warn_of_missing_levels};
use crate::voice::warn;
use ndfmap::Error;

/// Write the shader of a method, for other programs
#[derive(Debug, Args)]
#[command(after_long_help = format!("{}\n\n{}\n\n{}\n\n{}", languages_help(), renderers_help(), methods_help(), brdfs_help()))]
pub(super) struct Shader {
    /// The baked map that the shader is for: its method, and the ranges of its integers
    #[arg(value_name = "MAP")]
    map: Option<PathBuf>,
    #[arg(short, long, value_parser = method_spelling, conflicts_with = "map", help = format!(
        "The method that the map is baked with [default: {DEFAULT_METHOD}]"))]
    method: Option<String>,
    /// The renderer whose materials and lights the shader is for; without one it shades one lobe
    #[arg(long = "for", value_name = "RENDERER", value_parser = convention, conflicts_with_all = ["brdf", "model"])]
    renderer: Option<&'static Convention>,
    /// The reflectance lobe
    #[arg(long, default_value = "ggx:0.2", value_parser = brdf_spelling)]
    brdf: String,
    /// Shading model around the lobe: the factor of Tan et al., of Han et al. or of Smith (tan, han, smith)
    #[arg(long, default_value = "smith", value_parser = ShadingModel::from_str)]
    model: ShadingModel,
    /// The language [default: that of the output's ending, else wgsl]
    #[arg(short, long, value_parser = language)]
    lang: Option<&'static str>,
    /// The file to write [default: stdout]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

fn languages_help() -> String {
    let rows = TABLE.iter().map(|row| {
        let also = row.aliases.join(", ");
        format!("  {:8} {}; also {also}", row.name, row.summary)
    });
    format!("Languages:\n{}", rows.collect::<Vec<_>>().join("\n"))
}

fn renderers_help() -> String {
    let rows = CONVENTIONS.iter().map(|row| format!("  {:8} {}", row.name, row.summary));
    format!("Renderers:\n{}", rows.collect::<Vec<_>>().join("\n"))
}

fn convention(text: &str) -> Result<&'static Convention, String> {
    let names = || CONVENTIONS.iter().map(|row| row.name);
    let small = text.to_lowercase();
    CONVENTIONS.iter().find(|row| row.name == small).ok_or_else(|| super::arguments::unknown(text, names()))
}

fn find(name: &str) -> Option<&'static Language> {
    let small = name.to_lowercase();
    TABLE.iter().find(|row| row.name == small || row.aliases.contains(&small.as_str()))
}

fn language(text: &str) -> Result<&'static str, String> {
    let names = || TABLE.iter().map(|row| row.name);
    find(text).map(|row| row.name).ok_or_else(|| super::arguments::unknown(text, names()))
}

/// Kind of map that a shader is for.
struct Subject {
    method: AnyMethod,
    /// Ranges of its integers.
    compact: Option<Compact>,
    /// Attributes that its lobes carry.
    attributes: usize,
    /// Levels of the normal map that it leaves out.
    from_level: usize,
}

impl Shader {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let Subject { method, compact, attributes, from_level } = match &self.map {
            None => {
                let method = self.method.as_deref().unwrap_or(DEFAULT_METHOD).parse()?;
                Subject { method, compact: None, attributes: 0, from_level: 0 }
            }
            Some(path) => {
                let map = NdfMap::open(path)?;
                let attributes = map.header.attributes.len();
                if attributes > 0 && self.renderer.is_none() {
                    let why = "the attributes that its lobes carry are not used: a place brings its own colours, or `--for`";
                    warn(path, why);
                }
                if attributes > 2 && self.renderer.is_some() {
                    let why = format!(
                        "has {attributes} attributes, where shaders know two, albedo and specular colour"
                    );
                    return Err(Error::Request(format!("{}: {why}", path.display())));
                }
                if self.renderer.is_none() {
                    warn_of_missing_levels(path, &map);
                }
                let (method, compact) = (map.method(path)?, map.compact(path)?);
                Subject { method, compact, attributes, from_level: map.header.from_level }
            }
        };
        let lobe = read_brdf(&self.brdf)?;
        let brdf = Brdf { lobe, shading: self.model };
        let shading = match self.renderer {
            None => Shading::Lobe(&brdf),
            Some(convention) => Shading::Materials { convention, attributes, from_level },
        };
        let layers = method.layers_with(if self.renderer.is_some() { attributes } else { 0 });
        let output = self.output.as_ref().filter(|path| path.as_os_str() != STANDARD);
        let ending = output.and_then(|path| Some(path.extension()?.to_str()?.to_owned()));
        let language = self.lang.or(ending.as_deref()).and_then(find).unwrap_or(&TABLE[0]);
        let bytes = Export { method: &*method, shading, compact: compact.as_ref() }.to(language)?;
        if let Some(file) = output {
            make_way(file)?;
            ndfmap::maps::atomic::write(file, &bytes)?;
            say_written(std::slice::from_ref(file));
        }
        if json {
            // Without a file the text goes into the document; a shader that is not text needs a file.
            let text = if output.is_some() { None } else { Some(String::from_utf8(bytes.clone())) };
            let text = text.transpose().map_err(|_| {
                Error::Request(format!("{} is no text: name a file with `-o`", language.name))
            })?;
            return print_json(&json!({
                "method": method.to_string(),
                "renderer": self.renderer.map(|row| row.name),
                "brdf": self.renderer.is_none().then(|| brdf.lobe.to_string()),
                "model": self.renderer.is_none().then(|| self.model.name()),
                "language": language.name,
                "layers": compact.as_ref().map_or(layers, |compact| compact.bits().layers(layers)),
                "bytes": bytes.len(),
                "output": self.output,
                "text": text,
            }));
        }
        if output.is_some() {
            return Ok(());
        }
        if std::io::stdout().is_terminal() && str::from_utf8(&bytes).is_err() {
            let why = "is no text for a terminal: name a file with `-o`, or send it to another program";
            return Err(Error::Request(format!("{} {why}", language.name)));
        }
        print_bytes(&bytes)
    }
}
