//! `ndfmap inspect`: describes a file, and decodes one of its texels.

use std::path::PathBuf;

use clap::Args;
use ndfmap::maps::formats::{read_file, read_ndf};
use ndfmap::maps::source::BUILTIN_PREFIX;
use ndfmap::{Error, inspect};
use serde_json::{Map, Value};

use super::arguments::{BuiltinSize, SourceArguments};
use super::{print, print_json, to_value};
use crate::voice::warn;

/// Say what a file is; decode one texel of a baked map
#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// A baked map, or a normal or height map
    file: PathBuf,
    /// Decode one texel of a baked map: level, column, row
    #[arg(long, num_args = 3, value_names = ["L", "X", "Y"])]
    texel: Option<Vec<usize>>,
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    builtin: BuiltinSize,
}

impl Inspect {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let builtin = self.file.to_str().is_some_and(|f| f.starts_with(BUILTIN_PREFIX));
        let baked = if builtin { None } else { read_ndf(&self.file, &read_file(&self.file)?)? };
        let value = match (&baked, &self.texel) {
            (Some(map), Some(texel)) => {
                to_value(&inspect::describe_texel(&self.file, map, [texel[0], texel[1], texel[2]])?)?
            }
            (Some(map), None) => to_value(&inspect::describe_map(map))?,
            (None, Some(_)) => {
                let file = self.file.display();
                return Err(Error::Request(format!("{file}: is no baked map: it has no texels to decode")));
            }
            (None, None) => {
                let report = self.source.describe(&self.file, &self.builtin)?;
                report.warnings.iter().for_each(|warning| warn(&self.file, warning));
                to_value(&report)?
            }
        };
        if json { print_json(&value) } else { print(&as_lines(&value)) }
    }
}

/// Spells a JSON object as lines for people, one key each.
fn as_lines(value: &Value) -> String {
    let empty = Map::new();
    let all = value.as_object().unwrap_or(&empty);
    let name = all.keys().map(String::len).max().unwrap_or(0);
    let line = |(key, value): (&String, &Value)| match value {
        Value::String(text) => format!("{key:name$}  {text}"),
        Value::Array(levels) if key == "levels" => {
            let size = |s: &Value| format!("{}×{}", s["width"], s["height"]);
            format!("{key:name$}  {}", levels.iter().map(size).collect::<Vec<_>>().join(" "))
        }
        other => format!("{key:name$}  {other}"),
    };
    // Warnings have already gone to stderr.
    all.iter().filter(|(key, _)| *key != "warnings").map(line).collect::<Vec<_>>().join("\n")
}
