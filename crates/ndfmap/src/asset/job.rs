//! The work on an asset: pairs that are alike are baked once, judged as they are compressed, and kept or not.

use std::path::Path;

use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::observe::Observer;
use ndfmap_core::roughness::{EngineMaterial, PLAIN, RoughSurface, Widening};
use ndfmap_core::surface::{Surface, unit_or_up};
use ndfmap_maps::MapError;
use ndfmap_maps::asset::{Appearance, Asset, Layer, MaterialLayer, MaterialPair, Pair, Reason};
use ndfmap_maps::formats::ktx2::{Texture, Transcoded};

use super::{
    AssetFix, AssetJob, AssetReport, Gain, LEAST_GAIN, LayerReport, LayerViews, NewTexture, Outcome,
    fits_blocks,
};
use crate::Error;
use crate::roughness::{
    Errors, Judge, LevelReport, ROUGHNESS_IMPORTANCE, RoughnessJob, RoughnessMips, channel_mips, mean,
    mean_ratios, ratios,
};

/// Layers that share all that their roughness mips depend on.
struct Group {
    layers: Vec<MaterialPair>,
    name: String,
    /// Material that they are judged as.
    judged_as: EngineMaterial,
    /// Places of their accounts.
    reports: Vec<usize>,
}

/// Outcome of a group.
struct Grouped {
    outcome: Outcome,
    views: Option<LayerViews>,
    texture: Option<NewTexture>,
}

impl AssetJob<'_> {
    /// Bakes and measures every pair of the asset.
    ///
    /// # Errors
    /// [`Error`] when a map cannot be read, and when the observer cancels.
    pub fn run(&self, observer: &dyn Observer) -> Result<AssetFix, Error> {
        let mut groups: Vec<Group> = Vec::new();
        let layers = self.asset.layers();
        let report = |i: usize, outcome: Outcome, texture: Option<String>| {
            let MaterialLayer { material, name, layer, .. } = &layers[i];
            LayerReport { material: *material, name: name.clone(), layer: *layer, texture, outcome }
        };
        let mut reports = vec![None; layers.len()];
        for (i, found) in layers.iter().enumerate() {
            let pair = match &found.pair {
                Ok(pair) => pair,
                Err(reason) => {
                    reports[i] = Some(report(i, Outcome::LeftAlone(reason.clone()), None));
                    continue;
                }
            };
            let layer = MaterialPair { material: found.material, pair: pair.clone() };
            let judged_as = engine_material(self.asset, found.material, found.layer)?;
            let is_same =
                |group: &&mut Group| group.judged_as == judged_as && are_alike(&group.layers[0].pair, pair);
            match groups.iter_mut().find(is_same) {
                Some(group) => {
                    group.layers.push(layer);
                    group.reports.push(i);
                }
                None => {
                    let name = match found.layer {
                        Layer::Base => found.name.clone(),
                        Layer::Clearcoat => format!("{} clearcoat", found.name),
                    };
                    groups.push(Group { layers: vec![layer], name, judged_as, reports: vec![i] });
                }
            }
        }
        let mut textures: Vec<NewTexture> = Vec::new();
        let (mut warnings, mut views) = (Vec::new(), Vec::new());
        for group in groups {
            observer.begin(&format!("roughness of `{}`", group.name));
            let Grouped { outcome, views: seen, texture } = self.group(&group, &mut warnings, observer)?;
            for i in group.reports {
                let texture = matches!(outcome, Outcome::Fixed(_)).then(|| group.name.clone());
                reports[i] = Some(report(i, outcome.clone(), texture));
            }
            views.extend(seen);
            textures.extend(texture);
        }
        let layers = reports.into_iter().flatten().collect();
        Ok(AssetFix { report: AssetReport { layers, warnings }, views, textures })
    }

    fn group(
        &self,
        group: &Group,
        warnings: &mut Vec<String>,
        observer: &dyn Observer,
    ) -> Result<Grouped, Error> {
        let (asset, pair) = (self.asset, &group.layers[0].pair);
        let (normals, told) = asset.normals(pair)?;
        warnings.extend(told.iter().map(|w| format!("normal map of `{}` {w}", group.name)));
        let values = asset.roughness(pair)?;
        let surface = surface(asset.path(), &*normals, values.as_ref(), pair.factor)?;
        let size = surface.size();
        if !fits_blocks(size) {
            let reason = Reason::OddSize(size);
            return Ok(Grouped { outcome: Outcome::LeftAlone(reason), views: None, texture: None });
        }
        let stock = surface.bake(Widening::Rule(&PLAIN), observer)?;
        let job = RoughnessJob { surface: &surface, material: group.judged_as, by: self.by };
        let judge = Judge::new(&surface, group.judged_as, &observer.part(0.0, 0.35))?;
        let mips = job.make(&judge, &observer.part(0.35, 0.85))?;
        let holds_occlusion = group.layers.iter().any(|layer| layer.pair.holds_occlusion);
        let channels = Channels { old: values.as_ref(), holds_occlusion };
        let texture = channels.texture(&mips.levels);
        let compressed = self.compressed(&stock, &judge, &texture, &observer.part(0.85, 1.0))?;
        let gain = Gain {
            width: size.width,
            height: size.height,
            levels: mips.report.levels.clone(),
            of_stock: mips.report.of_stock,
            compressed_of_stock: compressed,
        };
        let is_better = compressed.relative_l2 <= 1.0
            && compressed.flip <= 1.0
            && 1.0 - (compressed.relative_l2 + compressed.flip) / 2.0 >= LEAST_GAIN;
        let is_fixed = self.by.is_some() || is_better;
        let roughness = if is_fixed { texture } else { channels.texture(&stock) };
        let fallback = fallback(&values, pair.factor, asset.has_core_picture(pair));
        let new = NewTexture {
            layers: group.layers.clone(),
            name: group.name.clone(),
            roughness,
            fallback,
            is_fixed,
        };
        let views = if is_fixed { views(&group.name, &judge, &stock, &mips) } else { None };
        let outcome = if is_fixed { Outcome::Fixed(gain) } else { Outcome::NoBetter(gain) };
        Ok(Grouped { outcome, views, texture: Some(new) })
    }

    /// Errors over those of stock mips once the texture is compressed: the worse of both kinds of blocks.
    fn compressed(
        &self,
        stock: &[Grid<f32>],
        judge: &Judge<'_>,
        texture: &Texture,
        observer: &dyn Observer,
    ) -> Result<Errors, Error> {
        if texture.levels.len() < 2 {
            return Ok(Errors { relative_l2: 1.0, flip: 1.0 });
        }
        let filtered = Texture { levels: texture.levels[1..].to_vec(), importance: texture.importance };
        let roughness = |blocks: Transcoded| -> Result<Vec<Grid<f32>>, Error> {
            let levels = filtered.transcoded(self.asset.path(), blocks)?;
            let green = |level: &Grid<[u8; 4]>| {
                Grid::from_fn(level.size(), |x, y| f32::from(level.row(y)[x][1]) / 255.0)
            };
            Ok(std::iter::once(stock[0].clone()).chain(levels.iter().map(green)).collect())
        };
        let (astc, bc7) = (roughness(Transcoded::Astc)?, roughness(Transcoded::Bc7)?);
        let judged = judge.errors(&[stock, &astc, &bc7], observer)?;
        let of_stock = |i: usize| {
            mean_ratios(judged.iter().map(|level| (mean(&level.candidates[i]), mean(&level.candidates[0]))))
        };
        let (astc, bc7) = (of_stock(1), of_stock(2));
        Ok(Errors { relative_l2: astc.relative_l2.max(bc7.relative_l2), flip: astc.flip.max(bc7.flip) })
    }
}

/// Pictures of the level that gains most; none where there is only one level.
fn views(name: &str, judge: &Judge<'_>, stock: &[Grid<f32>], mips: &RoughnessMips) -> Option<LayerViews> {
    let gain = |level: &&LevelReport| {
        let Errors { relative_l2, flip } = ratios((level.made, level.stock));
        relative_l2 + flip
    };
    let best = mips.report.levels.iter().min_by(|a, b| gain(a).total_cmp(&gain(b)));
    let LevelReport { level, .. } = best?;
    let views = judge.views(*level, &[&stock[*level], &mips.levels[*level]]);
    Some(LayerViews { name: name.to_owned(), level: *level, views })
}

/// True for pairs of the same maps and factors.
fn are_alike(a: &Pair, b: &Pair) -> bool {
    // A coat has no occlusion and no metal, but its channels are kept all the same.
    Pair { layer: a.layer, holds_occlusion: a.holds_occlusion, ..b.clone() } == *a
}

/// Normals and roughness of a pair.
fn surface(
    path: &Path,
    normals: &dyn Surface,
    values: Option<&Grid<[f32; 4]>>,
    factor: f32,
) -> Result<RoughSurface, MapError> {
    let roughness = match values {
        Some(values) => Grid::from_fn(values.size(), |x, y| values.row(y)[x][1] * factor),
        None => Grid::from_fn(normals.size(), |_, _| factor),
    };
    RoughSurface::new(normals, &roughness).map_err(|e| MapError::invalid(path, e))
}

/// Material of a layer as it is judged: grey, and the same all over.
fn engine_material(asset: &Asset, material: usize, layer: Layer) -> Result<EngineMaterial, MapError> {
    /// Reflectance of an index of refraction of 1.5, glTF's dielectric and its clearcoat.
    const DIELECTRIC: f64 = 0.04;
    Ok(match layer {
        Layer::Clearcoat => EngineMaterial { specular: DIELECTRIC, diffuse: 0.0 },
        Layer::Base => {
            let Appearance { base, metallic } = asset.appearance(material)?;
            let (base, metallic) = (f64::from(base), f64::from(metallic));
            EngineMaterial {
                specular: DIELECTRIC * (1.0 - metallic) + base * metallic,
                diffuse: base * (1.0 - metallic),
            }
        }
    })
}

fn byte(v: f32) -> u8 {
    (v.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Importance of occlusion and of metal beside that of roughness: metal has edges that show, occlusion is a
/// soft shadow.
const OCCLUSION_IMPORTANCE: f32 = 0.25;
const METAL_IMPORTANCE: f32 = 1.0;

/// Channels of a roughness texture.
struct Channels<'a> {
    /// Old texture, whose red and blue are kept as plain mips; white where there is none.
    old: Option<&'a Grid<[f32; 4]>>,
    /// True where red is the occlusion.
    holds_occlusion: bool,
}

impl Channels<'_> {
    /// Texture with these levels of roughness in green.
    fn texture(&self, roughness: &[Grid<f32>]) -> Texture {
        let others = self.old.map(|old| channel_mips(old.clone(), roughness[0].size()));
        let level = |(l, roughness): (usize, &Grid<f32>)| {
            Grid::from_fn(roughness.size(), |x, y| {
                let [r, b] = match &others {
                    Some(others) => [0, 2].map(|c: usize| byte(others[l].row(y)[x][c])),
                    None => [u8::MAX; 2],
                };
                [r, byte(roughness.row(y)[x]), b, u8::MAX]
            })
        };
        // A red channel that nobody reads costs the others nothing.
        let red = if self.holds_occlusion { OCCLUSION_IMPORTANCE } else { 0.0 };
        Texture {
            levels: roughness.iter().enumerate().map(level).collect(),
            importance: [red, ROUGHNESS_IMPORTANCE, METAL_IMPORTANCE],
        }
    }
}

/// Finest level for engines without KTX2, where the old picture is none for them or lacks the factor.
fn fallback(values: &Option<Grid<[f32; 4]>>, factor: f32, has_core_picture: bool) -> Option<Texture> {
    let finest = match values {
        None => {
            let texel = [u8::MAX, byte(factor), u8::MAX, u8::MAX];
            Grid::from_fn(Size { width: 1, height: 1 }, |_, _| texel)
        }
        Some(_) if factor == 1.0 && has_core_picture => return None,
        Some(values) => Grid::from_fn(values.size(), |x, y| {
            let [r, g, b, _] = values.row(y)[x];
            [byte(r), byte(g * factor), byte(b), u8::MAX]
        }),
    };
    Some(Texture { levels: vec![finest], importance: [1.0; 3] })
}

/// Normals of a pair before their scale, with the mips that an engine would make, of unit length.
pub(super) fn normal_texture(asset: &Asset, pair: &Pair) -> Result<Texture, Error> {
    let (normals, _) = asset.normals(&Pair { scale: 1.0, ..pair.clone() })?;
    let smooth = Grid::from_fn(Size { width: 1, height: 1 }, |_, _| 0.0);
    let surface = RoughSurface::new(&*normals, &smooth).map_err(|e| Error::Failed(e.to_string()))?;
    let level = |(l, size): (usize, Size)| {
        Grid::from_fn(size, |x, y| {
            let n = unit_or_up(surface.mean(l, x, y).normal);
            [byte(0.5 * n.x + 0.5), byte(0.5 * n.y + 0.5), byte(0.5 * n.z + 0.5), u8::MAX]
        })
    };
    Ok(Texture { levels: surface.sizes().enumerate().map(level).collect(), importance: [1.0; 3] })
}
