//! `ndfmap inspect`: what a file is, and one of its texels decoded.

use std::path::PathBuf;

use clap::Args;
use ndfmap_core::ndf::{Decoded, LobeLayout, NormalLobe};
use ndfmap_core::surface::{SurfaceRow, integrability, slope_of_normal};
use ndfmap_maps::formats::{read_file, read_ndf};
use ndfmap_maps::source::{BUILTIN_PREFIX, read_source};
use ndfmap_maps::{NdfMap, SourceKind};
use serde_json::{Map, Value, json};

use super::arguments::{BuiltinSize, SourceArguments};
use super::{print, print_json, warn};
use crate::Failure;

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
    pub(super) fn run(self, json: bool) -> Result<(), Failure> {
        let builtin = self.file.to_str().is_some_and(|f| f.starts_with(BUILTIN_PREFIX));
        let baked = if builtin { None } else { read_ndf(&self.file, &read_file(&self.file)?)? };
        let value = match (&baked, &self.texel) {
            (Some(map), Some(texel)) => self.texel(map, [texel[0], texel[1], texel[2]])?,
            (Some(map), None) => describe_baked(map)?,
            (None, Some(_)) => {
                let file = self.file.display();
                return Err(Failure::Usage(format!("{file}: is no baked map: it has no texels to decode")));
            }
            (None, None) => self.describe_source()?,
        };
        if json { print_json(&value) } else { print(&as_lines(&value)) }
    }

    fn texel(&self, map: &NdfMap, [level, x, y]: [usize; 3]) -> Result<Value, Failure> {
        let sizes = map.pyramid.sizes();
        let inside = sizes.get(level).is_some_and(|s| x < s.width && y < s.height);
        if !inside {
            let range = match sizes.get(level) {
                Some(s) => format!("level {level} is {} × {}", s.width, s.height),
                None => format!("levels run from 0 to {}", sizes.len() - 1),
            };
            return Err(Failure::Usage(format!(
                "{}: has no texel {level} {x} {y}: {range}",
                self.file.display()
            )));
        }
        let method = map.method(&self.file)?;
        let mut value = json!({ "level": level, "x": x, "y": y, "method": map.header.method });
        let channels = map.pyramid.texel(level, x, y);
        let mut decoded = describe(method.describe(&channels[..4 * method.layers()]));
        let lobes = decoded.get_mut("lobes").and_then(Value::as_array_mut);
        if let (Some(lobes), Some(layout)) = (lobes, method.lobe_layout()) {
            lobes.iter_mut().for_each(|lobe| add_attributes(lobe, map, &channels, layout));
        }
        let (Value::Object(all), Value::Object(decoded)) = (&mut value, decoded) else {
            unreachable!("both are written as objects");
        };
        all.extend(decoded);
        Ok(value)
    }

    fn describe_source(&self) -> Result<Value, Failure> {
        let map = read_source(&self.file, &self.source.options(self.builtin.size))?;
        for warning in &map.warnings {
            warn(&self.file, warning);
        }
        let size = map.surface.size();
        let (mut mean, mut slopes) = (glam::DVec3::ZERO, [0.0_f64; 4]);
        let mut row = SurfaceRow::flat(size.width);
        for y in 0..size.height {
            map.surface.read_row(y, &mut row);
            for x in 0..size.width {
                let (n, s) = (row.normal(x), slope_of_normal(row.normal(x)).as_dvec2());
                mean += n.as_dvec3();
                for (sum, v) in slopes.iter_mut().zip([s.x, s.y, s.x * s.x, s.y * s.y]) {
                    *sum += v;
                }
            }
        }
        let texels = size.area() as f64;
        let [x, y, xx, yy] = slopes.map(|s| s / texels);
        let kind = match map.source.kind {
            SourceKind::Normal => "normal",
            SourceKind::Height => "height",
        };
        Ok(json!({
            "kind": kind,
            "width": size.width,
            "height": size.height,
            "source": map.source,
            "mean_normal_length": (mean / texels).length(),
            "slope_variance": [xx - x * x, yy - y * y],
            "integrability": integrability(&*map.surface),
            "warnings": map.warnings,
        }))
    }
}

/// Adds to a lobe what it carries: the mean of each attribute over its normals, by the attribute's name.
fn add_attributes(lobe: &mut Value, map: &NdfMap, channels: &[f32], layout: LobeLayout) {
    let index = lobe["layer"].as_u64().unwrap_or(0) as usize;
    let mut carried = Map::new();
    for (k, attribute) in map.header.attributes.iter().enumerate() {
        let Some(mean) = layout.attribute(channels, k, index) else { continue };
        carried.insert(attribute.name.clone(), json!(mean[..attribute.channels.min(4)]));
    }
    if !carried.is_empty() {
        lobe["attributes"] = carried.into();
    }
}

fn describe_baked(map: &NdfMap) -> Result<Value, Failure> {
    let mut value = serde_json::to_value(&map.header).map_err(|e| Failure::Failed(e.to_string()))?;
    let levels: Vec<Value> =
        map.pyramid.sizes().iter().map(|s| json!({ "width": s.width, "height": s.height })).collect();
    if let Value::Object(all) = &mut value {
        all.insert("layers".to_owned(), map.pyramid.layers().into());
        all.insert("precision".to_owned(), format!("{:?}", map.pyramid.precision()).to_lowercase().into());
        all.insert("levels".to_owned(), levels.into());
    }
    Ok(value)
}

fn describe(decoded: Decoded) -> Value {
    match decoded {
        Decoded::Mean(mean) => json!({ "mean": mean.to_array() }),
        Decoded::Gaussian { mean, covariance } => {
            json!({ "mean": mean.to_array(), "covariance": covariance.to_cols_array_2d() })
        }
        Decoded::Slopes { height, mean, covariance: [xx, yy, xy] } => {
            json!({ "mean": mean.to_array(), "covariance": [[xx, xy], [xy, yy]], "height": height })
        }
        Decoded::Coefficients(gamma) => json!({ "coefficients": gamma }),
        Decoded::Lobes(lobes) => {
            let lobe = |l: &NormalLobe| {
                let kappa = l.variance.get().recip().min(MOST_KAPPA);
                json!({ "layer": l.index, "weight": l.weight, "mean": l.mean.to_array(), "kappa": kappa })
            };
            json!({ "lobes": lobes.iter().map(lobe).collect::<Vec<_>>() })
        }
        Decoded::Peaks(peaks) => {
            let peak = |p: &NormalLobe| {
                let exponent = p.variance.get().recip().min(MOST_KAPPA);
                json!({ "layer": p.index, "weight": p.weight, "mean": p.mean.to_array(), "exponent": exponent })
            };
            json!({ "peaks": peaks.iter().map(peak).collect::<Vec<_>>() })
        }
        Decoded::PlanarLobes(lobes) => {
            let lobe = |l: &NormalLobe| {
                let (mean, variance) = (l.mean.truncate().to_array(), l.variance.get());
                json!({ "layer": l.index, "weight": l.weight, "mean": mean, "variance": variance })
            };
            json!({ "lobes": lobes.iter().map(lobe).collect::<Vec<_>>() })
        }
    }
}

/// `kappa` of a lobe whose stored form can tell no spread; JSON has no infinity.
const MOST_KAPPA: f64 = 1e6;

/// A JSON object as lines for people, one key each.
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
    // Warnings have been said already, on stderr.
    all.iter().filter(|(key, _)| *key != "warnings").map(line).collect::<Vec<_>>().join("\n")
}
