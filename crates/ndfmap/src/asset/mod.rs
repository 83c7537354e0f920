//! glTF assets that keep their look with distance: roughness mips in the place of roughness textures, where
//! they are measured to be better, as they will be compressed.
//!
//! ```no_run
//! use ndfmap::asset::AssetJob;
//! use ndfmap::core::observe::Unobserved;
//! use ndfmap::maps::asset::{Asset, Form};
//!
//! let asset = Asset::read("helmet.glb".as_ref())?;
//! let fix = AssetJob { asset: &asset, by: None }.run(&Unobserved)?;
//! for layer in &fix.report.layers {
//!     println!("{}: {}", layer.name, layer.outcome);
//! }
//! fix.save(&asset, Form::Web, Some(3), "helmet-fixed.glb".as_ref())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod job;

use std::fmt;
use std::path::{Path, PathBuf};

use ndfmap_core::grid::{Grid, Size};
use ndfmap_maps::MapError;
use ndfmap_maps::asset::{Asset, AssetFile, Form, Layer, MaterialPair, Reason, Replacement, Slot};
use ndfmap_maps::atomic;
use ndfmap_maps::formats::ktx2::{Texture, TextureEncoding};
use serde::{Serialize, Serializer};

use crate::Error;
use crate::draw::{Panel, Sheet, SheetRow, enlarged};
use crate::roughness::{Errors, LevelReport, Origin, View};

/// Change of a glTF asset to be made.
#[derive(Clone, Copy, Debug)]
pub struct AssetJob<'a> {
    /// Asset to be changed.
    pub asset: &'a Asset,
    /// Fit or formula for every material, whatever it does, in place of what is measured to be best.
    pub by: Option<Origin>,
}

/// Least gain, as a part of the sum of both errors, for which a texture is exchanged: what is smaller is not
/// worth its bytes.
pub const LEAST_GAIN: f64 = 0.02;

/// Changed asset, ready to be written.
#[derive(Clone, Debug)]
pub struct AssetFix {
    /// Account of it.
    pub report: AssetReport,
    /// Pictures of every layer whose texture is exchanged, at the level that gains most.
    pub views: Vec<LayerViews>,
    /// New textures.
    textures: Vec<NewTexture>,
}

/// Pictures of a layer, and of those that share its textures.
#[derive(Clone, Debug)]
pub struct LayerViews {
    /// Name of the layer.
    pub name: String,
    /// Level that is shown.
    pub level: usize,
    /// Pictures of it by stock mips and by ours, in this order.
    pub views: Vec<View>,
}

/// New textures of layers that share them.
#[derive(Clone, Debug)]
struct NewTexture {
    layers: Vec<MaterialPair>,
    name: String,
    roughness: Texture,
    /// Finest level, for engines without KTX2, where the old picture says something else.
    fallback: Option<Texture>,
    /// False for plain mips, which only an engine needs that makes none.
    is_fixed: bool,
}

/// Account of a changed asset.
#[derive(Clone, Debug, Serialize)]
pub struct AssetReport {
    /// Every layer of every material.
    pub layers: Vec<LayerReport>,
    /// Warnings about its maps.
    pub warnings: Vec<String>,
}

/// Account of a layer of a material.
#[derive(Clone, Debug, Serialize)]
pub struct LayerReport {
    /// Index of the material.
    pub material: usize,
    /// Name of the material, or its index where it has none.
    pub name: String,
    /// Layer of it.
    pub layer: Layer,
    /// Name of its new texture; layers that are alike share one.
    pub texture: Option<String>,
    /// Measurement and change of it.
    pub outcome: Outcome,
}

/// Outcome for a layer.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Its roughness texture is exchanged.
    Fixed(Gain),
    /// Nothing that was tried is better than what it has, or by too little.
    NoBetter(Gain),
    /// Its maps are such that it cannot be judged.
    LeftAlone(#[serde(serialize_with = "spelled")] Reason),
}

fn spelled<S: Serializer>(reason: &Reason, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(reason)
}

/// Gain of a layer, measured.
#[derive(Clone, Debug, Serialize)]
pub struct Gain {
    /// Width of the textures, in texels.
    pub width: usize,
    /// Height of the textures, in texels.
    pub height: usize,
    /// Every level but the finest, before compression.
    pub levels: Vec<LevelReport>,
    /// Errors over those of stock mips, before compression.
    pub of_stock: Errors,
    /// Errors over those of stock mips after compression: the worse of ASTC and BC7, measure by measure.
    pub compressed_of_stock: Errors,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gain = |f: &mut fmt::Formatter<'_>, gain: &Gain| {
            let Errors { relative_l2, flip } = gain.compressed_of_stock;
            write!(f, "relative L2 {relative_l2:.2}, FLIP {flip:.2} of stock")
        };
        match self {
            Self::Fixed(of) => {
                f.write_str("fixed: ")?;
                gain(f, of)
            }
            Self::NoBetter(of) => {
                f.write_str("left alone: at best ")?;
                gain(f, of)
            }
            Self::LeftAlone(reason) => write!(f, "left alone: {reason}"),
        }
    }
}

impl AssetReport {
    /// Number of layers whose texture is exchanged.
    #[must_use]
    pub fn fixed(&self) -> usize {
        self.layers.iter().filter(|layer| matches!(layer.outcome, Outcome::Fixed(_))).count()
    }
}

/// Files that were written.
#[derive(Clone, Debug, Serialize)]
pub struct Written {
    /// Names of the files, the document last.
    pub files: Vec<PathBuf>,
    /// Bytes of all of them.
    pub bytes: u64,
}

impl AssetFix {
    /// Writes the changed asset, file by file, the document last: each is whole or not there.
    ///
    /// # Errors
    /// [`Error`] when a texture cannot be packed, or a file cannot be read or written.
    pub fn save(&self, asset: &Asset, form: Form, zstd: Option<i32>, out: &Path) -> Result<Written, Error> {
        write(self.files(asset, form, zstd, out)?)
    }

    /// Files of the changed asset, the document last.
    ///
    /// # Errors
    /// [`Error`] when a texture cannot be packed, or a file beside the asset cannot be read.
    pub fn files(
        &self,
        asset: &Asset,
        form: Form,
        zstd: Option<i32>,
        out: &Path,
    ) -> Result<Vec<AssetFile>, Error> {
        let mut replacements = Vec::new();
        for new in &self.textures {
            if !new.is_fixed && form != Form::Bevy {
                continue;
            }
            let replacement = |slot, texture: &Texture, fallback: Option<Vec<u8>>| {
                let name = match slot {
                    Slot::Roughness => format!("{} roughness", new.name),
                    Slot::Normals => format!("{} normals", new.name),
                };
                let ktx2 = texture.to_ktx2(out, TextureEncoding::Uastc, zstd)?;
                Ok::<_, MapError>(Replacement { slot, layers: new.layers.clone(), name, ktx2, fallback })
            };
            let fallback = new.fallback.as_ref().map(|finest| finest.to_png(out, 0)).transpose()?;
            // A single roughness all over needs no mips.
            if new.is_fixed || new.layers[0].pair.roughness.is_some() {
                replacements.push(replacement(Slot::Roughness, &new.roughness, fallback)?);
            }
            // Bevy makes no mips, so the normal map needs its own too.
            let has_normals = |done: &Replacement| {
                done.slot == Slot::Normals && done.layers[0].pair.normal == new.layers[0].pair.normal
            };
            if form == Form::Bevy {
                match replacements.iter_mut().find(|done| has_normals(done)) {
                    Some(done) => done.layers.extend(new.layers.iter().cloned()),
                    None => {
                        let normals = job::normal_texture(asset, &new.layers[0].pair)?;
                        if fits_blocks(normals.levels[0].size()) {
                            replacements.push(replacement(Slot::Normals, &normals, None)?);
                        }
                    }
                }
            }
        }
        Ok(asset.edited(&replacements, form, out)?.files)
    }

    /// Sheet of pictures before and after: a row an object, beside the truth.
    #[must_use]
    pub fn sheet(&self, title: &str) -> Sheet {
        /// Least side of a picture, in pixels.
        const SIDE: usize = 192;
        let row = |(layer, view): (&LayerViews, &View)| {
            let panel = |picture: &Grid<[u8; 3]>| Panel::of(enlarged(picture, SIDE));
            let shaded = view.shaded.iter().zip(&view.errors).map(|(picture, errors)| {
                let Errors { relative_l2, flip } = errors;
                panel(picture).said([format!("relative L2 {relative_l2:.2}, FLIP {flip:.2}")])
            });
            SheetRow {
                head: vec![layer.name.clone(), format!("level {}", layer.level), view.object.to_owned()],
                panels: std::iter::once(panel(&view.truth)).chain(shaded).map(Some).collect(),
            }
        };
        let views = self.views.iter().flat_map(|layer| layer.views.iter().map(move |view| (layer, view)));
        Sheet {
            title: title.to_owned(),
            columns: ["truth", "stock", "fixed"].map(str::to_owned).to_vec(),
            rows: views.map(row).collect(),
            scale: None,
        }
    }

    /// Files of every exchanged roughness texture by itself, for a folder: KTX2, and a PNG a level.
    ///
    /// # Errors
    /// [`Error`] when a texture cannot be packed.
    pub fn texture_files(&self, folder: &Path, zstd: Option<i32>) -> Result<Vec<AssetFile>, Error> {
        let mut files: Vec<AssetFile> = Vec::new();
        let mut names: Vec<String> = Vec::new();
        for new in self.textures.iter().filter(|new| new.is_fixed) {
            let plain = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
            let own: String = new.name.chars().map(plain).collect();
            let numbered = (2..).map(|number| format!("{own}-{number}"));
            let taken = |name: &String| names.iter().any(|other| other.to_lowercase() == name.to_lowercase());
            let name = std::iter::once(own.clone()).chain(numbered).find(|name| !taken(name));
            let name = name.unwrap_or_default();
            names.push(name.clone());
            let path = |extension: &str| folder.join(format!("{name}_roughness.{extension}"));
            let ktx2 = path("ktx2");
            files.push(AssetFile {
                bytes: new.roughness.to_ktx2(&ktx2, TextureEncoding::Uastc, zstd)?,
                path: ktx2,
            });
            for level in 0..new.roughness.levels.len() {
                let png = path(&format!("{level}.png"));
                files.push(AssetFile { bytes: new.roughness.to_png(&png, level)?, path: png });
            }
        }
        Ok(files)
    }
}

/// Writes files in turn, each whole or not at all; makes folders that there are not.
///
/// # Errors
/// [`Error`] when a file cannot be written; those before it stay.
pub fn write(files: Vec<AssetFile>) -> Result<Written, Error> {
    let mut written = Written { files: Vec::new(), bytes: 0 };
    for AssetFile { path, bytes } in files {
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|e| MapError::io(folder, e))?;
        }
        atomic::write(&path, &bytes)?;
        written.bytes += bytes.len() as u64;
        written.files.push(path);
    }
    Ok(written)
}

/// Size that fits blocks of 4 × 4 texels, which `KHR_texture_basisu` asks for.
fn fits_blocks(size: Size) -> bool {
    size.width.is_multiple_of(4) && size.height.is_multiple_of(4)
}
