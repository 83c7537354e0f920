//! Normal maps in the precision of their files, and what they say of the direction of green.

use std::fmt;
use std::path::Path;

use fearless_simd::{Level, dispatch};
use glam::Vec3;
use ndfmap_core::grid::Size;
use ndfmap_core::surface::{MAX_SLOPE, Surface, SurfaceRow, Wraps, integrability, unit_or_up};

use super::Convention;
use super::identity::{Identity, Named, NormalLayout, PictureKind};
use crate::{Image, MapError, Samples};

/// Evidence of the direction of green in a normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConventionEvidence {
    /// [`integrability`] with green up: 1 for the gradient of some height, -1 for one that is upside down.
    pub integrability: f64,
    /// Convention that the file's name says.
    pub named: Option<Convention>,
    /// Texels of the map.
    pub texels: usize,
    /// Some normal leans up or down the picture; without any, both conventions are right.
    pub leans: bool,
}

/// Least size of an integrability that tells the convention. Maps whose convention is known have 0.39 and
/// more; those that tell nothing at most 0.22 (linen).
const CLEAR: f64 = 0.25;

/// Deviations of chance that an integrability must be away from 0: once in 16 000 maps by chance.
const SIGNIFICANT: f64 = 4.0;

/// Largest y of a flat map of 8 bits, whose codes have no middle.
const LEVEL: f32 = 2.5 / 255.0;

impl fmt::Display for ConventionEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "integrability {:.2} with green up", self.integrability)?;
        if let Some(named) = self.named {
            write!(f, ", named {named}")?;
        }
        if self.leans { Ok(()) } else { write!(f, ", level up and down the picture") }
    }
}

impl ConventionEvidence {
    /// Evidence of a map that was read with green up.
    pub(super) fn of(path: &Path, map: &EncodedNormals) -> Self {
        let named = match Named::of(path) {
            Named { opengl: true, directx: false, .. } => Some(Convention::OpenGl),
            Named { opengl: false, directx: true, .. } => Some(Convention::DirectX),
            _ => None,
        };
        let mut row = SurfaceRow::flat(map.image.size.width);
        let leans = (0..map.image.size.height).any(|y| {
            map.read_row(y, &mut row);
            row.y.iter().any(|y| y.abs() > LEVEL)
        });
        Self { integrability: integrability(map), named, texels: map.image.size.area(), leans }
    }

    /// Convention that the slopes tell; `None` where they are not clear.
    #[must_use]
    pub fn by_slopes(&self) -> Option<Convention> {
        // Of slopes that have nothing to do with each other, the correlation's deviation is 1 over the root
        // of their number: few texels tell less.
        let clear = CLEAR.max(SIGNIFICANT / (self.texels.max(1) as f64).sqrt());
        match self.integrability {
            i if i >= clear => Some(Convention::OpenGl),
            i if i <= -clear => Some(Convention::DirectX),
            _ => None,
        }
    }

    /// Convention that follows, where the evidence is clear and agrees.
    #[must_use]
    pub fn verdict(&self) -> Option<Convention> {
        match (self.by_slopes(), self.named) {
            _ if !self.leans => Some(Convention::OpenGl),
            (Some(slopes), Some(name)) if slopes != name => None,
            (slopes, name) => slopes.or(name),
        }
    }

    /// The convention asked for, with a warning where the slopes speak against it; without one, the verdict.
    pub(super) fn follow(
        &self,
        path: &Path,
        asked: Option<Convention>,
        warnings: &mut Vec<String>,
    ) -> Result<Convention, MapError> {
        if let Some(asked) = asked {
            if let Some(other) = self.by_slopes().filter(|other| self.leans && *other != asked) {
                let name = other.name();
                warnings.push(format!(
                    "is taken as {}, but looks like {name} ({self}): try `--convention {name}`",
                    asked.name()
                ));
            }
            return Ok(asked);
        }
        let Some(convention) = self.verdict() else {
            let why = match (self.by_slopes(), self.named) {
                (Some(slopes), Some(name)) => {
                    format!("has slopes that say {} and a name that says {}", slopes.name(), name.name())
                }
                _ => "does not tell whether green points up or down".to_owned(),
            };
            let reason =
                format!("{why} ({self}): say `--convention opengl` (up) or `--convention directx` (down)");
            return Err(MapError::unsupported(path, reason));
        };
        if convention == Convention::DirectX {
            warnings.push(format!("is taken as directx, green down ({self})"));
        }
        Ok(convention)
    }
}

/// A normal map in the precision of its file, decoded a row at a time.
pub(super) struct EncodedNormals {
    image: Image,
    wraps: Wraps,
    layout: NormalLayout,
    /// True when stored values run from 0 to 1 and stand for -1 to 1.
    positive: bool,
    /// Sign of green: 1, or -1 to turn DirectX's.
    green: f32,
}

impl EncodedNormals {
    /// A map with green up, as its identity says.
    pub(super) fn new(
        path: &Path,
        image: Image,
        identity: &Identity,
        wraps: Wraps,
    ) -> Result<Self, MapError> {
        if image.channels < 2 {
            return Err(MapError::unsupported(
                path,
                "has one channel: no normal map. `--from height` takes it as heights",
            ));
        }
        let layout = identity.layout.unwrap_or(NormalLayout::Xyz);
        let image = match layout {
            NormalLayout::Swizzled => image.channels(&[3, 1]),
            _ => image,
        };
        Ok(Self { image, wraps, layout, positive: !identity.signed, green: 1.0 })
    }

    /// Turns green to where the convention has it.
    pub(super) fn turn(&mut self, convention: Convention) {
        self.green = match convention {
            Convention::OpenGl => 1.0,
            Convention::DirectX => -1.0,
        };
    }

    /// True where z is rebuilt from x and y.
    fn without_z(&self) -> bool {
        matches!(self.layout, NormalLayout::Xy | NormalLayout::Swizzled)
    }

    /// Says what is odd: channels that are not x, y and z, and texels that hold no normal.
    pub(super) fn check(&self, identity: &Identity, warnings: &mut Vec<String>) {
        if self.layout != NormalLayout::Xyz && self.image.channels > 2
            || self.layout == NormalLayout::Swizzled
        {
            warnings.extend(identity.evidence.iter().cloned());
        } else if identity.kind != PictureKind::Normal {
            let (looks, why) = (identity.kind.described(), identity.evidence.join("; "));
            warnings.push(format!("looks like {looks}, and is taken as normals ({why})"));
        }
        let mut row = SurfaceRow::flat(self.image.size.width);
        let below: usize = (0..self.image.size.height)
            .map(|y| {
                self.read_row(y, &mut row);
                row.z.iter().filter(|z| **z <= 0.0).count()
            })
            .sum();
        let count = |is: fn(f32) -> bool, need_all: bool| {
            let at = |i: usize, c: usize| is(self.image.samples.get(i * self.image.channels + c));
            let texel = |i: &usize| match need_all {
                true => at(*i, 0) && at(*i, 1) && at(*i, 2),
                false => (0..self.image.channels).any(|c| at(*i, c)),
            };
            (0..self.image.size.area()).filter(texel).count()
        };
        // Black in two channels is a legal, if steep, normal.
        let black = if self.without_z() { 0 } else { count(|v| v == 0.0, true) };
        let broken =
            if matches!(self.image.samples, Samples::F32(_)) { count(|v| !v.is_finite(), false) } else { 0 };
        let texels = self.image.size.area() as f64;
        let mut say = |n: usize, what: &str| {
            if n > 0 {
                warnings.push(format!("{n} texels ({:.2} %) {what}", 100.0 * n as f64 / texels));
            }
        };
        say(black, "are black, no direction, and become (0, 0, 1)");
        say(broken, "are NaN or infinite and become (0, 0, 1)");
        say(below, &format!("point to or below the horizon; their slopes are held to {MAX_SLOPE}"));
    }

    /// Spreads a row of samples over the planes, each decoded to -1 .. 1.
    fn spread<T: Copy>(&self, samples: &[T], y: usize, row: &mut SurfaceRow, decode: impl Fn(T) -> f32) {
        let length = self.image.size.width * self.image.channels;
        let texels = samples[y * length..][..length].chunks_exact(self.image.channels);
        let planes = row.x.iter_mut().zip(&mut row.y).zip(&mut row.z);
        for (texel, ((x, y), z)) in texels.zip(planes) {
            (*x, *y) = (decode(texel[0]), decode(texel[1]));
            *z = if texel.len() > 2 { decode(texel[2]) } else { 0.0 };
        }
    }
}

impl EncodedNormals {
    /// Makes unit normals of decoded samples.
    #[inline(always)]
    fn normalise(&self, row: &mut SurfaceRow) {
        for ((x, y), z) in row.x.iter_mut().zip(&mut row.y).zip(&mut row.z) {
            match self.layout {
                NormalLayout::Xy | NormalLayout::Swizzled => *z = (1.0 - *x * *x - *y * *y).max(0.0).sqrt(),
                NormalLayout::XyPositiveZ => *z = 0.5 * (*z + 1.0),
                NormalLayout::Xyz => {}
            }
            // Black, three zeros, is no direction: unsigned values decode it to the corner below.
            let black = self.positive && self.layout == NormalLayout::Xyz && *x + *y + *z == -3.0;
            let v = if black { Vec3::ZERO } else { Vec3::new(*x, *y * self.green, *z) };
            let n = unit_or_up(v);
            (*x, *y, *z) = (n.x, n.y, n.z);
        }
    }
}

/// Values that the codes of an 8-bit channel stand for.
static DECODE_U8: std::sync::LazyLock<[f32; 256]> =
    std::sync::LazyLock::new(|| std::array::from_fn(|c| 2.0 * (c as f32 / 255.0) - 1.0));

impl Surface for EncodedNormals {
    fn size(&self) -> Size {
        self.image.size
    }

    fn wraps(&self) -> Wraps {
        self.wraps
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        row.height.fill(0.0);
        match &self.image.samples {
            Samples::U8(v) => {
                let table = &*DECODE_U8;
                self.spread(v, y, row, |c| table[usize::from(c)]);
            }
            Samples::U16(v) => self.spread(v, y, row, |c| 2.0 * (f32::from(c) / 65535.0) - 1.0),
            Samples::F32(v) if self.positive => self.spread(v, y, row, |c| 2.0 * c - 1.0),
            Samples::F32(v) => self.spread(v, y, row, |c| c),
        }
        dispatch!(Level::new(), _simd => self.normalise(row));
    }
}
