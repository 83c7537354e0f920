//! Identity of a picture: normals, heights, roughness, colours or light, by what its texels and its name say.
//!
//! Thresholds stand between the measures of real maps and of real colours: `docs/pictures.md`.

use std::path::Path;

use glam::Vec3;
use ndfmap_core::words;
use serde::Serialize;

use crate::environment::is_environment_size;
use crate::{Image, Samples};

/// Kind of a picture, by its texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// Normals of a surface in its own frame.
    Normal,
    /// Normals in the frame of a whole object, which point all ways.
    ObjectNormal,
    /// Heights, or depths.
    Height,
    /// Roughness, alone or beside occlusion and metalness.
    Roughness,
    /// Colours.
    Colour,
    /// Light from everywhere.
    Environment,
}

words!(PictureKind {
    Normal => "normal",
    ObjectNormal => "object-normal",
    Height => "height",
    Roughness => "roughness",
    Colour => "colour",
    Environment => "environment",
});

/// Channels that hold a normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NormalLayout {
    /// x, y and z in red, green and blue.
    Xyz,
    /// x and y in red and green; blue is missing, or something else.
    Xy,
    /// x and y in red and green, and z in blue from 0 to 1.
    XyPositiveZ,
    /// x in alpha and y in green (DXT5nm).
    Swizzled,
}

words!(NormalLayout {
    Xyz => "xyz",
    Xy => "xy",
    XyPositiveZ => "xy-positive-z",
    Swizzled => "swizzled",
});

/// Identity of a picture, and what tells it.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Kind.
    pub kind: PictureKind,
    /// Channels of a normal, for normals.
    pub layout: Option<NormalLayout>,
    /// Stored values are components from -1 to 1, for normals; else they run from 0 to 1.
    pub signed: bool,
    /// Sentences that tell it.
    pub evidence: Vec<String>,
}

impl PictureKind {
    /// Words of a sentence for it.
    #[must_use]
    pub fn described(self) -> &'static str {
        match self {
            Self::Normal => "normals",
            Self::ObjectNormal => "normals of an object's own space",
            Self::Height => "heights",
            Self::Roughness => "roughness or a mask",
            Self::Colour => "colours",
            Self::Environment => "an environment",
        }
    }
}

impl Serialize for PictureKind {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl Serialize for NormalLayout {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Least share of vectors of length one in a normal map. Maps that are JPEGs have 0.69 and more, colours at
/// most 0.46.
const UNIT_SHARE: f64 = 0.6;

/// Mean of x and of y beyond which vectors of length one are light greys, which have 0.58: the normals of no
/// surface lean so far both ways at once. Maps have at most 0.06.
const GREY: f64 = 0.3;

/// Largest mean of x and of y where length does not tell, as blue is not z: detail leans nowhere. Maps have
/// at most 0.06, colours and packed values 0.2 and more.
const LEANING_XY: f64 = 0.1;

/// Largest correlation of red with green where length does not tell. Colours have 0.79 and more.
const CORRELATION: f64 = 0.3;

/// Correlation of red with green below which colours are no colours, but packed values. Albedo has 0.79 and
/// more, packed roughness at most 0.48.
const PACKED: f64 = 0.6;

/// Evidence of a grey picture without a telling name.
pub(super) const GREY_ALONE: &str = "is grey: nothing tells heights from roughness or a mask";

/// Says what a picture is. The path lends its name as evidence, where texels tell nothing.
#[must_use]
pub fn identify(path: &Path, image: &Image) -> Identity {
    let named = Named::of(path);
    let plain = |kind: PictureKind, evidence: String| Identity {
        kind,
        layout: None,
        signed: false,
        evidence: vec![evidence],
    };
    if is_grey(image) {
        return match named {
            Named { height: true, .. } => plain(PictureKind::Height, "is grey, and named so".to_owned()),
            Named { roughness: true, .. } => {
                plain(PictureKind::Roughness, "is grey, and named so".to_owned())
            }
            _ => plain(PictureKind::Height, GREY_ALONE.to_owned()),
        };
    }
    if let Some(identity) = normals(image) {
        return identity;
    }
    let statistics = Statistics::of(image, true);
    let length = statistics.unit_sentence("0 to 1");
    if let Samples::F32(values) = &image.samples
        && is_environment_size(image.size)
        && values.iter().all(|v| *v >= 0.0 || v.is_nan())
        && values.iter().any(|v| *v > 1.0)
    {
        let shape = "holds light brighter than 1, in the shape of a panorama or a cube".to_owned();
        return plain(PictureKind::Environment, shape);
    }
    let alike = statistics.correlation;
    if named.roughness || alike.is_finite() && alike.abs() < PACKED {
        let packed = format!("{length}; {}, as packed values are", alike_words(alike));
        return plain(PictureKind::Roughness, packed);
    }
    plain(PictureKind::Colour, format!("{length}; {}", alike_words(alike)))
}

/// Words for the correlation of red with green.
fn alike_words(correlation: f64) -> String {
    match correlation.is_nan() {
        true => "red or green is the same everywhere".to_owned(),
        false => format!("red and green correlate by {correlation:.2}"),
    }
}

/// Identity of a picture that is taken as normals, whatever it is: the channels that a normal has in it.
pub(super) fn identify_normals(path: &Path, image: &Image) -> Identity {
    normals(image).unwrap_or_else(|| {
        let layout = if image.channels == 2 { NormalLayout::Xy } else { NormalLayout::Xyz };
        Identity {
            layout: Some(layout),
            signed: is_signed(image, image.channels == 2),
            ..identify(path, image)
        }
    })
}

/// Identity of normals; `None` for a picture that is none.
fn normals(image: &Image) -> Option<Identity> {
    let made = |layout: NormalLayout, signed: bool, evidence: String| {
        Some(Identity { kind: PictureKind::Normal, layout: Some(layout), signed, evidence: vec![evidence] })
    };
    if is_swizzled(image) {
        return made(
            NormalLayout::Swizzled,
            false,
            "is full in red: x is taken from alpha and y from green (DXT5nm)".to_owned(),
        );
    }
    let blue = |i: usize| image.samples.get(i * image.channels + 2);
    let no_blue = image.channels > 2 && (0..image.size.area()).all(|i| blue(i) == 0.0);
    if image.channels == 2 || no_blue {
        let signed = is_signed(image, true);
        let statistics = Statistics::of(image, !signed);
        if no_blue && statistics.leans() {
            return None;
        }
        let why = if no_blue { "has no blue" } else { "has two channels" };
        return made(NormalLayout::Xy, signed, format!("{why}: z is rebuilt from red and green"));
    }
    let signed = is_signed(image, false);
    let range = if signed { "-1 to 1" } else { "0 to 1" };
    let statistics = Statistics::of(image, !signed);
    if statistics.unit >= UNIT_SHARE {
        let below = statistics.below;
        if below < 0.1 {
            let grey = !signed && statistics.mean.x.min(statistics.mean.y) > GREY;
            return match grey {
                true => None,
                false => made(NormalLayout::Xyz, signed, statistics.unit_sentence(range)),
            };
        }
        // Vectors that point all ways are an object's; colours lie on one side.
        if statistics.mean.length() < 0.5 && below < 0.9 {
            let evidence = format!(
                "{}, and {:.0} % point below the horizon",
                statistics.unit_sentence(range),
                100.0 * below
            );
            return Some(Identity {
                kind: PictureKind::ObjectNormal,
                layout: Some(NormalLayout::Xyz),
                signed,
                evidence: vec![evidence],
            });
        }
        return None;
    }
    if signed || statistics.leans() || statistics.inside < 0.98 {
        return None;
    }
    if statistics.unit_positive_z >= UNIT_SHARE {
        let share = 100.0 * statistics.unit_positive_z;
        let evidence = format!("{share:.0} % of its vectors have length one where blue is z from 0 to 1");
        return made(NormalLayout::XyPositiveZ, false, evidence);
    }
    if statistics.correlation.abs() < CORRELATION || statistics.correlation.is_nan() {
        let share = 100.0 * statistics.unit;
        let evidence = format!(
            "holds few vectors of length one ({share:.0} %): blue is not z, which is rebuilt from red and green"
        );
        return made(NormalLayout::Xy, false, evidence);
    }
    None
}

/// True for one channel, or three that never differ by more than JPEG's colour noise (8 of 255).
pub(super) fn is_grey(image: &Image) -> bool {
    if image.channels < 3 {
        return image.channels == 1;
    }
    let texel = |i: usize| [0, 1, 2].map(|c| image.samples.get(i * image.channels + c));
    (0..image.size.area()).map(texel).all(|[r, g, b]| r.max(g).max(b) - r.min(g).min(b) <= 8.0 / 255.0)
}

/// True where red is full everywhere and alpha is not the same everywhere: no normals of a surface all point
/// along x, but DXT5nm has its x in alpha and its y in green.
fn is_swizzled(image: &Image) -> bool {
    let sample = |i: usize, c: usize| image.samples.get(i * image.channels + c);
    let mut texels = 0..image.size.area();
    image.channels == 4
        && texels.clone().all(|i| sample(i, 0) == 1.0)
        && texels.any(|i| sample(i, 3) != sample(0, 3))
}

/// True where stored values are the components themselves, from -1 to 1; else they run from 0 to 1. Floats of
/// which the format says nothing may be either: the decoding that makes more vectors of length one is right.
/// Without z, values from 0 to 1 lie around a half, and components around 0.
fn is_signed(image: &Image, two_channels: bool) -> bool {
    let Samples::F32(values) = &image.samples else { return false };
    if image.signed {
        return true;
    }
    if two_channels {
        let xy = values.chunks_exact(image.channels).flat_map(|texel| &texel[..2]);
        let (sum, count) =
            xy.filter(|v| v.is_finite()).fold((0.0, 0), |(s, n), v| (s + f64::from(*v), n + 1));
        return sum < 0.25 * f64::from(count);
    }
    let [signed, positive] = [false, true].map(|positive| Statistics::of(image, positive).unit);
    signed > positive || signed == positive && values.iter().any(|v| *v < 0.0)
}

/// Texels that tell what a picture holds: more would tell no more.
const WITNESSES: usize = 1 << 16;

/// Statistics of vectors in red, green and blue. Black texels and those that are not finite do not count.
struct Statistics {
    /// Share of vectors of length one, to a tenth: more than 8 bits and JPEG move it.
    unit: f64,
    /// The same with blue as z from 0 to 1.
    unit_positive_z: f64,
    /// Share whose z is below 0.
    below: f64,
    /// Share whose x and y lie in the unit disk, to 1 %.
    inside: f64,
    mean: glam::DVec3,
    /// Correlation of red with green; NaN where one is the same everywhere.
    correlation: f64,
}

impl Statistics {
    /// Statistics of a picture, whose values run from 0 to 1 where `positive`.
    fn of(image: &Image, positive: bool) -> Self {
        let (mut all, mut unit, mut unit_positive_z, mut below, mut inside) = (0, 0, 0, 0, 0);
        let (mut sum, mut squares) = (glam::DVec3::ZERO, [0.0_f64; 3]);
        let near_one = |length: f32| usize::from((length - 1.0).abs() < 0.1);
        // An odd step goes over all columns of a map whose width is a power of two.
        for i in (0..image.size.area()).step_by((image.size.area() / WITNESSES) | 1) {
            let channel =
                |c: usize| if c < image.channels { image.samples.get(i * image.channels + c) } else { 0.0 };
            let stored = Vec3::from_array([0, 1, 2].map(channel));
            if stored == Vec3::ZERO || !stored.is_finite() {
                continue;
            }
            let v = if positive { 2.0 * stored - 1.0 } else { stored };
            all += 1;
            unit += near_one(v.length());
            unit_positive_z += near_one(Vec3::new(v.x, v.y, stored.z).length());
            below += usize::from(v.z < 0.0);
            inside += usize::from(v.truncate().length() <= 1.01);
            let v = v.as_dvec3();
            sum += v;
            squares = [squares[0] + v.x * v.x, squares[1] + v.y * v.y, squares[2] + v.x * v.y];
        }
        let share = |count: usize| if all == 0 { 1.0 } else { count as f64 / all as f64 };
        let mean = sum / all.max(1) as f64;
        let [xx, yy, xy] = squares.map(|s| s / all.max(1) as f64);
        let variances = (xx - mean.x * mean.x) * (yy - mean.y * mean.y);
        Self {
            unit: share(unit),
            unit_positive_z: share(unit_positive_z),
            below: if all == 0 { 0.0 } else { share(below) },
            inside: share(inside),
            mean,
            // Rounding leaves some 1e-16 of channels that are the same everywhere.
            correlation: if variances < 1e-24 { f64::NAN } else { (xy - mean.x * mean.y) / variances.sqrt() },
        }
    }

    /// True where the mean leans to a side.
    fn leans(&self) -> bool {
        self.mean.x.abs().max(self.mean.y.abs()) > LEANING_XY
    }

    fn unit_sentence(&self, range: &str) -> String {
        format!("{:.0} % of its vectors have length one (values from {range})", 100.0 * self.unit)
    }
}

/// Content of a file, as its name says it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Named {
    height: bool,
    roughness: bool,
    pub(super) opengl: bool,
    pub(super) directx: bool,
}

impl Named {
    /// Reads the words of a name: `Rock_NormalGL.png` is rock, normal and gl.
    pub(super) fn of(path: &Path) -> Self {
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let mut words = vec![String::new()];
        let mut before = ' ';
        for c in stem.chars() {
            if !c.is_alphanumeric() || c.is_uppercase() && before.is_lowercase() {
                words.push(String::new());
            }
            if c.is_alphanumeric() {
                words.last_mut().into_iter().for_each(|word| word.extend(c.to_lowercase()));
            }
            before = c;
        }
        let any = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
        Self {
            height: any(&["height", "heightmap", "displacement", "disp", "depth", "bump", "dem"]),
            roughness: any(&[
                "roughness",
                "rough",
                "gloss",
                "glossiness",
                "smoothness",
                "occlusion",
                "ao",
                "metalness",
                "metallic",
                "orm",
                "arm",
                "rma",
                "specular",
                "mask",
                "opacity",
            ]),
            opengl: any(&["gl", "ogl", "opengl"]),
            directx: any(&["dx", "directx", "d3d"]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_by_their_words() {
        let of = |name: &str| Named::of(Path::new(name));
        for name in ["Rock058_NormalGL.jpg", "rough_linen_nor_gl_1k.jpg", "a-OGL.png"] {
            assert!(of(name).opengl && !of(name).directx, "{name}");
        }
        assert!(of("Rock058_NormalDX.jpg").directx && of("a_directx.png").directx);
        assert!(of("Metal_tiles_03_2K_Height.png").height && !of("Metal_tiles_03_2K_Height.png").roughness);
        assert!(of("Mat_OcclusionRoughMetal.png").roughness);
        // No word is found inside another.
        assert_eq!(of("jungle_throughput_display.png"), Named::default());
    }
}
