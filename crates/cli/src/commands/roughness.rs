//! `ndfmap roughness`: a normal map and a roughness in, roughness mips for any engine out.

use std::path::{Path, PathBuf};

use super::arguments::{BuiltinSize, SourceArguments};
use super::{make_way, print, print_json, say_written, to_value};
use crate::tables;
use crate::terminal::Terminal;
use clap::{Args, ValueEnum};
use ndfmap::Error;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::roughness::{EngineMaterial, RoughSurface, TABLE, find};
use ndfmap::maps::formats::ktx2::{Texture, TextureEncoding};
use ndfmap::maps::formats::{read_file, read_image};
use ndfmap::maps::{Image, MapError, atomic};
use ndfmap::roughness::{Method, RoughnessJob, RoughnessMips, channel_mips};

/// Make roughness mips that keep a material's look with distance, for any engine
#[derive(Debug, Args)]
#[command(after_long_help = rules_help())]
pub(super) struct Roughness {
    /// Normal map: a picture file, or `builtin:NAME`
    #[arg(value_name = "NORMAL")]
    map: PathBuf,
    /// Roughness: a number from 0 to 1, or a picture whose size may be another
    #[arg(long, value_name = "R|FILE", default_value = "0.5")]
    roughness: String,
    /// Channel of the picture that holds roughness; the others keep plain mips. glTF's is `g`
    #[arg(long, value_enum, ignore_case = true)]
    channel: Option<Channel>,
    /// White is smooth: the values are glossiness, or smoothness, and stay so
    #[arg(long)]
    gloss: bool,
    /// Channels that are written for a roughness without others: `grey`, or glTF's `orm` (no occlusion, all
    /// metal)
    #[arg(long, value_enum, ignore_case = true, default_value_t = Packing::Grey)]
    packing: Packing,
    /// Formula of an engine in place of the fit; `--help` lists them
    #[arg(long, value_name = "NAME", value_parser = rule_name)]
    rule: Option<String>,
    /// Material that the mips are judged by
    #[arg(long, value_enum, ignore_case = true, default_value_t = Material::Metal)]
    material: Material,
    /// The file to write: `.ktx2` with all levels, or `.png`, one for each level as in `NAME.3.png`
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// For `.png`: this level alone, under the name as it is
    #[arg(long, value_name = "N")]
    level: Option<usize>,
    /// For `.ktx2`: UASTC, the format of glTF's `KHR_texture_basisu`, or four bytes a texel [default: uastc]
    #[arg(long, value_enum, ignore_case = true)]
    encoding: Option<Encoding>,
    /// For `.ktx2`: level of Zstandard, from 1 (fast) to 22; 0 writes it plain [default: 3]
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(i32).range(0..=22))]
    zstd: Option<i32>,
    #[command(flatten)]
    source: SourceArguments,
    #[command(flatten)]
    builtin: BuiltinSize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Channel {
    R,
    G,
    B,
    A,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Packing {
    Grey,
    Orm,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Material {
    Metal,
    Dielectric,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Encoding {
    Uastc,
    Rgba8,
}

/// Level of Zstandard, unless told otherwise.
const ZSTD: i32 = 3;

fn rule_name(text: &str) -> Result<String, String> {
    find(text).map(|row| row.name.to_owned()).ok_or_else(|| {
        let names: Vec<&str> = TABLE.iter().map(|row| row.name).collect();
        format!("no rule of this name; there are {}", names.join(", "))
    })
}

fn rules_help() -> String {
    let rows = TABLE.iter().map(|row| format!("  {:9} {}", row.name, row.summary));
    format!("Rules:\n{}", rows.collect::<Vec<_>>().join("\n"))
}

/// Roughness as it was given.
struct Given {
    /// Values of the channel, as stored.
    values: Grid<f32>,
    /// Picture whose other channels are kept, and the channel.
    others: Option<(Image, usize)>,
}

impl Roughness {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let png = self.check()?;
        let map = self.source.read(&self.map, &self.builtin)?;
        let given = self.given(map.surface.size())?;
        let roughness = Grid::from_fn(given.values.size(), |x, y| self.rough(given.values.row(y)[x]));
        let surface = RoughSurface::new(&*map.surface, &roughness)
            .map_err(|e| MapError::invalid(Path::new(&self.roughness), e.to_string()))?;
        let material = match self.material {
            Material::Metal => EngineMaterial::METAL,
            Material::Dielectric => EngineMaterial::DIELECTRIC,
        };
        let method = self.rule.as_deref().and_then(find).map_or(Method::Measured, Method::Rule);
        let terminal = Terminal::default();
        let mips = RoughnessJob { surface: &surface, material, method }.run(&terminal)?;
        let texture = self.texture(&mips, &given);
        let written = if png { self.save_png(&texture)? } else { vec![self.save_ktx2(&texture)?] };
        say_written(&written);
        self.tell(&mips, &written, json)
    }

    /// Refuses options that do nothing; true for PNG.
    fn check(&self) -> Result<bool, Error> {
        let extension = self.output.extension().map(|e| e.to_string_lossy().to_lowercase());
        let refuse = |why: String| Err(Error::Request(format!("{}: {why}", self.output.display())));
        match extension.as_deref() {
            Some("png") if self.encoding.is_some() || self.zstd.is_some() => {
                refuse("a PNG has neither `--encoding` nor `--zstd`".to_owned())
            }
            Some("png") => Ok(true),
            Some("ktx2") if self.level.is_some() => {
                refuse("a KTX2 holds all levels; `--level` is for a PNG".to_owned())
            }
            Some("ktx2") => Ok(false),
            _ => refuse("roughness mips are written as .ktx2 or .png".to_owned()),
        }
    }

    /// Roughness of a stored value.
    fn rough(&self, stored: f32) -> f32 {
        if self.gloss { 1.0 - stored } else { stored }
    }

    fn given(&self, size: Size) -> Result<Given, Error> {
        if let Ok(number) = self.roughness.parse::<f32>() {
            if !(0.0..=1.0).contains(&number) {
                return Err(Error::Request(format!("`--roughness` must be between 0 and 1, not {number}")));
            }
            if self.channel.is_some() {
                return Err(Error::Request("`--channel` is for a picture of roughness".to_owned()));
            }
            return Ok(Given { values: Grid::from_fn(size, |_, _| number), others: None });
        }
        let path = Path::new(&self.roughness);
        let image = read_image(path, &read_file(path)?)?;
        let texel =
            |x: usize, y: usize, c: usize| image.samples.get((y * image.size.width + x) * image.channels + c);
        let colours = image.channels.min(3);
        let is_grey = (0..image.size.area()).all(|i| {
            let (x, y) = (i % image.size.width, i / image.size.width);
            (1..colours).all(|c| texel(x, y, c) == texel(x, y, 0))
        });
        let channel = match self.channel {
            Some(channel) if (channel as usize) < image.channels => channel as usize,
            Some(_) => {
                let reason =
                    format!("has {} channels, and not the one that `--channel` names", image.channels);
                return Err(MapError::invalid(path, reason).into());
            }
            None if is_grey => 0,
            None => {
                let reason = "holds different values in its channels: say by `--channel` which is roughness \
                              (glTF's is g)";
                return Err(Error::Request(format!("{}: {reason}", path.display())));
            }
        };
        let values = Grid::from_fn(image.size, |x, y| texel(x, y, channel));
        let others = (self.channel.is_some() && image.channels > 1).then_some((image, channel));
        if others.is_some() && self.packing == Packing::Orm {
            return Err(Error::Request(
                "`--packing orm` is for a roughness without other channels; this picture keeps its own"
                    .to_owned(),
            ));
        }
        Ok(Given { values, others })
    }

    /// Texels of every level.
    fn texture(&self, mips: &RoughnessMips, given: &Given) -> Texture {
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let others = given
            .others
            .as_ref()
            .map(|(image, channel)| (channel_mips(image, mips.levels[0].size()), *channel));
        let level = |(l, roughness): (usize, &Grid<f32>)| {
            Grid::from_fn(roughness.size(), |x, y| {
                // The way back is the way there.
                let stored = byte(self.rough(roughness.row(y)[x]));
                match (&others, self.packing) {
                    (Some((others, channel)), _) => {
                        let mut texel = others[l].row(y)[x].map(byte);
                        texel[*channel] = stored;
                        texel
                    }
                    (None, Packing::Grey) => [stored, stored, stored, 255],
                    (None, Packing::Orm) => [255, stored, 255, 255],
                }
            })
        };
        Texture { levels: mips.levels.iter().enumerate().map(level).collect() }
    }

    fn save_png(&self, texture: &Texture) -> Result<Vec<PathBuf>, Error> {
        let last = texture.levels.len() - 1;
        let levels = match self.level {
            Some(level) if level > last => {
                return Err(Error::Request(format!("there is no level {level}; the last is {last}")));
            }
            Some(level) => vec![(level, self.output.clone())],
            None => {
                (0..=last).map(|level| (level, self.output.with_extension(format!("{level}.png")))).collect()
            }
        };
        for (level, path) in &levels {
            make_way(path)?;
            atomic::write(path, &texture.to_png(path, *level)?)?;
        }
        Ok(levels.into_iter().map(|(_, path)| path).collect())
    }

    fn save_ktx2(&self, texture: &Texture) -> Result<PathBuf, Error> {
        let encoding = match self.encoding {
            Some(Encoding::Rgba8) => TextureEncoding::Rgba8,
            _ => TextureEncoding::Uastc,
        };
        let zstd = Some(self.zstd.unwrap_or(ZSTD)).filter(|level| *level > 0);
        make_way(&self.output)?;
        texture.save(&self.output, encoding, zstd)?;
        Ok(self.output.clone())
    }

    fn tell(&self, mips: &RoughnessMips, written: &[PathBuf], json: bool) -> Result<(), Error> {
        if !json {
            return print(&tables::roughness(mips));
        }
        let mut value = to_value(&mips.report)?;
        value["files"] = written.iter().map(|f| f.display().to_string()).collect();
        print_json(&value)
    }
}
