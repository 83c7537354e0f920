//! `ndfmap roughness`: a normal map and a roughness in, roughness mips for any engine out.

use std::path::{Path, PathBuf};
use std::str::FromStr as _;

use clap::{Args, ValueEnum};
use ndfmap::Error;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::pyramid::level_sizes;
use ndfmap::core::roughness::{EngineMaterial, RoughSurface, TABLE};
use ndfmap::maps::attribute::{Transfer, attribute_of_image};
use ndfmap::maps::formats::ktx2::{Texture, TextureEncoding};
use ndfmap::maps::formats::{read_file, read_image};
use ndfmap::maps::{MapError, atomic};
use ndfmap::roughness::{Origin, ROUGHNESS_IMPORTANCE, RoughnessJob, RoughnessMips, channel_mips};

use super::arguments::{BuiltinSize, SourceArguments, ZSTD};
use super::{make_way, print, print_json, say_written, to_value};
use crate::tables;
use crate::terminal::Terminal;

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
    /// Fit or formula of an engine in place of what is measured to be best; `--help` lists them
    #[arg(long, value_name = "NAME", value_parser = Origin::from_str)]
    rule: Option<Origin>,
    /// Material that the mips are judged by
    #[arg(long, value_enum, ignore_case = true, default_value_t = Material::Metal)]
    material: Material,
    /// The file to write: `.ktx2` with all levels, or `.png`, one for each level as in `NAME.3.png`
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// For `.png`: this level alone, under the name as it is
    #[arg(long, value_name = "N")]
    level: Option<usize>,
    /// For `.ktx2`: `uastc`, the format of glTF's `KHR_texture_basisu`; for desktop cards `bc7` or, for one
    /// channel, `bc4`; or `rgba8`, four bytes a texel [default: uastc]
    #[arg(long, value_parser = TextureEncoding::from_str)]
    encoding: Option<TextureEncoding>,
    /// For `.ktx2`: level of Zstandard, from 1 (fast) to 22; 0 writes it plain [default: 3]
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, require_equals = true, default_missing_value = "3",
        value_parser = clap::value_parser!(i32).range(0..=22))]
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

pub(super) fn rules_help() -> String {
    let rows = TABLE.iter().map(|row| format!("  {:9} {}", row.name, row.summary));
    format!(
        "Rules:\n{}\n  fit:P     the lobe nearest to all of a texel's, in brightness to the power P\n  fit:P:S   \
         a share S of the way to it, from plain mips",
        rows.collect::<Vec<_>>().join("\n")
    )
}

/// Roughness as it was given.
struct Given {
    /// Values of the picture, or the number in every channel.
    values: Grid<[f32; 4]>,
    /// Channel of them that is roughness.
    channel: usize,
    /// True where the other channels are to be kept.
    keeps_others: bool,
}

impl Roughness {
    pub(super) fn run(self, json: bool) -> Result<(), Error> {
        let png = self.check()?;
        let map = self.source.read(&self.map, &self.builtin)?;
        let given = self.given(map.surface.size())?;
        let stored = |x: usize, y: usize| given.values.row(y)[x][given.channel];
        let roughness = Grid::from_fn(given.values.size(), |x, y| self.rough(stored(x, y)));
        let surface = RoughSurface::new(&*map.surface, &roughness)
            .map_err(|e| MapError::invalid(Path::new(&self.roughness), e.to_string()))?;
        let material = match self.material {
            Material::Metal => EngineMaterial::METAL,
            Material::Dielectric => EngineMaterial::DIELECTRIC,
        };
        // Before the work, which takes seconds.
        let outputs = if png { self.pictures(surface.size())? } else { vec![(0, self.output.clone())] };
        outputs.iter().try_for_each(|(_, path)| make_way(path))?;
        let mips = RoughnessJob { surface: &surface, material, by: self.rule }.run(&Terminal::default())?;
        let texture = self.texture(&mips, given);
        if png {
            for (level, path) in &outputs {
                atomic::write(path, &texture.to_png(path, *level)?)?;
            }
        } else {
            let zstd = Some(self.zstd.unwrap_or(ZSTD)).filter(|level| *level > 0);
            texture.save(&self.output, self.encoding.unwrap_or_default(), zstd)?;
        }
        let written: Vec<PathBuf> = outputs.into_iter().map(|(_, path)| path).collect();
        say_written(&written);
        if !json {
            return print(&tables::roughness(&mips));
        }
        let mut value = to_value(&mips.report)?;
        value["files"] = written.iter().map(|f| f.display().to_string()).collect();
        print_json(&value)
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
            _ if self.encoding == Some(TextureEncoding::Bc4) && self.packing == Packing::Orm => {
                refuse("bc4 holds one channel, and `--packing orm` writes three".to_owned())
            }
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
            return Ok(Given {
                values: Grid::from_fn(size, |_, _| [number; 4]),
                channel: 0,
                keeps_others: false,
            });
        }
        let path = Path::new(&self.roughness);
        let image = read_image(path, &read_file(path)?)?;
        let values = attribute_of_image(path, &image, Transfer::Linear)?.values;
        let colours = image.channels.min(3);
        let is_grey = values.texels().iter().all(|texel| texel[..colours].iter().all(|v| *v == texel[0]));
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
        let keeps_others = self.channel.is_some() && image.channels > 1;
        if keeps_others && self.packing == Packing::Orm {
            return Err(Error::Request(
                "`--packing orm` is for a roughness without other channels; this picture keeps its own"
                    .to_owned(),
            ));
        }
        let has_alpha = channel == 3 || values.texels().iter().any(|texel| texel[3] != 1.0);
        let encoding = self.encoding.unwrap_or_default();
        let is_packed = self.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("ktx2"))
            && encoding != TextureEncoding::Rgba8;
        if keeps_others && has_alpha && is_packed {
            return Err(Error::Request(format!(
                "{}: has an alpha channel, which is not written as {encoding}: add `--encoding rgba8`",
                path.display()
            )));
        }
        if keeps_others && encoding == TextureEncoding::Bc4 {
            let why = "keeps its other channels, and bc4 holds one: add `--encoding bc7`";
            return Err(Error::Request(format!("{}: {why}", path.display())));
        }
        Ok(Given { values, channel, keeps_others })
    }

    /// Texels of every level.
    fn texture(&self, mips: &RoughnessMips, given: Given) -> Texture {
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let (channel, size) = (given.channel, mips.levels[0].size());
        let others = given.keeps_others.then(|| channel_mips(given.values, size));
        let level = |(l, roughness): (usize, &Grid<f32>)| {
            Grid::from_fn(roughness.size(), |x, y| {
                // The way back is the way there.
                let stored = byte(self.rough(roughness.row(y)[x]));
                match (&others, self.packing) {
                    (Some(others), _) => {
                        let mut texel = others[l].row(y)[x].map(byte);
                        texel[channel] = stored;
                        texel
                    }
                    (None, Packing::Grey) => [stored, stored, stored, 255],
                    (None, Packing::Orm) => [255, stored, 255, 255],
                }
            })
        };
        let importance = std::array::from_fn(|c| if c == channel { ROUGHNESS_IMPORTANCE } else { 1.0 });
        Texture { levels: mips.levels.iter().enumerate().map(level).collect(), importance }
    }

    /// Levels that are written as pictures, and the file of each.
    fn pictures(&self, size: Size) -> Result<Vec<(usize, PathBuf)>, Error> {
        let count = level_sizes(size).len();
        match self.level {
            Some(level) if level >= count => {
                Err(Error::Request(format!("there is no level {level}; the last is {}", count - 1)))
            }
            Some(level) => Ok(vec![(level, self.output.clone())]),
            None => Ok((0..count).map(|l| (l, self.output.with_extension(format!("{l}.png")))).collect()),
        }
    }
}
