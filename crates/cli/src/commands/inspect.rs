//! `ndfmap inspect`: describes a file, and decodes one of its texels.

use std::path::PathBuf;

use clap::Args;
use ndfmap::maps::NdfMap;
use ndfmap::maps::formats::{read_file, read_ndf};
use ndfmap::maps::model::is_model;
use ndfmap::maps::source::BUILTIN_PREFIX;
use ndfmap::{Error, inspect};
use serde_json::{Map, Value};

use super::arguments::{BuiltinSize, SourceArguments};
use super::{print, print_json, to_value};
use crate::voice::warn;

/// Say what a file is; decode one texel of a baked map
#[derive(Debug, Args)]
pub(super) struct Inspect {
    /// A baked map, a picture, a model, or `builtin:NAME`
    file: PathBuf,
    /// Decode one texel of a baked map: level, column, row, as in `3,10,12` or `3 10 12`
    #[arg(long, num_args = 1..=3, value_names = ["L", "X", "Y"], value_delimiter = ',')]
    texel: Option<Vec<usize>>,
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    builtin: BuiltinSize,
}

impl Inspect {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let value = match (self.baked()?, &self.texel) {
            (None, Some(_)) => {
                let why = "is no baked map: it has no texels to decode";
                return Err(Error::Request(format!("{}: {why}", self.file.display())));
            }
            (Some(map), Some(texel)) => {
                let place: [usize; 3] = texel[..].try_into().map_err(|_| {
                    Error::Request("--texel takes three numbers: level, column, row".to_owned())
                })?;
                to_value(&inspect::describe_texel(&self.file, &map, place)?)?
            }
            (Some(map), None) => {
                self.source.warn_if_given(&self.file, "a baked map");
                to_value(&inspect::describe_map(&map))?
            }
            (None, _) if is_model(&self.file) => {
                self.source.warn_if_given(&self.file, "a model");
                let report = inspect::describe_model(&self.file)?;
                report.warnings.iter().for_each(|warning| warn(&self.file, warning));
                to_value(&report)?
            }
            (None, _) => {
                let report = self.source.describe(&self.file, &self.builtin)?;
                report.warnings.iter().for_each(|warning| warn(&self.file, warning));
                to_value(&report)?
            }
        };
        if json { print_json(&value) } else { print(&as_lines(&value)) }
    }

    /// The file as a baked map; `None` for one that is none.
    fn baked(&self) -> Result<Option<NdfMap>, Error> {
        let builtin = self.file.to_str().is_some_and(|file| file.starts_with(BUILTIN_PREFIX));
        if builtin || is_model(&self.file) {
            return Ok(None);
        }
        Ok(read_ndf(&self.file, &read_file(&self.file)?)?)
    }
}

/// Spells a JSON object as lines for people, one key each; what is inside an object or a list is set in.
fn as_lines(value: &Value) -> String {
    let empty = Map::new();
    let all = value.as_object().unwrap_or(&empty);
    let name = all.keys().map(String::len).max().unwrap_or(0);
    let line = |(key, value): (&String, &Value)| match value {
        Value::Array(levels) if key == "levels" => {
            let size = |s: &Value| format!("{} × {}", s["width"], s["height"]);
            format!("{key:name$}  {}", levels.iter().map(size).collect::<Vec<_>>().join(", "))
        }
        Value::Array(items) if items.iter().any(|item| item.is_object() || item.is_string()) => {
            let indent = format!("\n{:name$}  ", "");
            let words = items.iter().map(words).collect::<Vec<_>>().join(&indent);
            format!("{key:name$}  {words}")
        }
        other => format!("{key:name$}  {}", words(other)),
    };
    // Warnings have already gone to stderr; what a picture does not have is left out.
    let shown = |(key, value): &(&String, &Value)| *key != "warnings" && !value.is_null() && !is_empty(value);
    all.iter().filter(shown).map(line).collect::<Vec<_>>().join("\n")
}

fn is_empty(value: &Value) -> bool {
    value.as_array().is_some_and(Vec::is_empty) || value.as_str().is_some_and(str::is_empty)
}

/// Spells a value in one line, numbers to four digits.
fn words(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => match (number.as_u64(), number.as_f64()) {
            (None, Some(float)) => short(float),
            _ => number.to_string(),
        },
        Value::Array(items) => items.iter().map(words).collect::<Vec<_>>().join(", "),
        Value::Object(object) => {
            let pair = |(key, value): (&String, &Value)| format!("{key} {}", words(value));
            object
                .iter()
                .filter(|(_, value)| !value.is_null() && !is_empty(value))
                .map(pair)
                .collect::<Vec<_>>()
                .join(", ")
        }
        other => other.to_string(),
    }
}

/// A number to four digits, as people write it.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        v if !(1e-3..1e5).contains(&v) => format!("{value:.3e}"),
        v => {
            let digits = (3 - v.log10().floor() as i32).max(0) as usize;
            let text = format!("{value:.digits$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
    }
}
