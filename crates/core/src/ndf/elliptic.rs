//! Method of lobes with six statistics, which only the tests have: whatever is fitted, stored, filtered and
//! decoded asks a lobe how many statistics it has, and never assumes four.
//!
//! A lobe is a Gaussian of `n.xy` with a covariance of its own, `alpha (1, x, y, x², y², xy)` in two layers.
//! For shading it counts as the isotropic lobe of the same trace.

use std::fmt::{self, Display};

use glam::DVec3;

use super::mixture::{NormalLobe, Response, effective};
use super::{AnyMethod, Decoded, Describe, Encoding, Form, FormKind, Representation, Sample, StoredSums};
use crate::bake::Bake;
use crate::brdf::Lobe;
use crate::fit::{Alignment, Fit, LobeKind};
use crate::grid::{Grid, Size};
use crate::lookup::Texels;
use crate::pyramid::Precision;
use crate::shader::Shader;
use crate::surface::{NormalGrid, Wraps};
use crate::units::SlopeVariance;

/// Statistics of a lobe.
const STATISTICS: usize = 6;

/// Channels that a lobe's layers hold.
const CHANNELS: usize = 8;

/// Lobes of six statistics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Elliptic {
    lobes: usize,
}

impl Elliptic {
    pub(super) fn new(lobes: usize) -> Self {
        Self { lobes }
    }
}

/// Lobe with a covariance: xx, yy, xy.
struct EllipticLobe {
    lobe: NormalLobe,
    covariance: [f64; 3],
}

/// Mixture that a texel decodes to.
pub(super) struct EllipticMixture {
    lobes: Vec<EllipticLobe>,
}

impl EllipticMixture {
    fn isotropic(&self) -> Vec<NormalLobe> {
        self.lobes.iter().map(|l| l.lobe).collect()
    }
}

impl From<EllipticMixture> for Decoded {
    fn from(mixture: EllipticMixture) -> Self {
        Self::PlanarLobes(mixture.isotropic())
    }
}

impl Display for Elliptic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "elliptic:{}", self.lobes)
    }
}

impl Describe for Elliptic {
    fn encoding(&self) -> Encoding {
        Encoding::Lobes { kind: LobeKind::Elliptic, count: self.lobes, sums: StoredSums::Plain }
    }

    fn form_kind(&self) -> FormKind {
        FormKind::Lobes
    }

    fn shader(&self) -> Shader {
        Shader::new(FormKind::Lobes, &[])
    }

    fn fit(&self) -> Option<Fit> {
        Some(Fit { alignment: Alignment::Parent, ..Fit::new(LobeKind::Elliptic, self.lobes) })
    }
}

impl Representation for Elliptic {
    type Sums = Vec<[f32; STATISTICS]>;
    type Lobes = EllipticMixture;

    fn zero(&self) -> Self::Sums {
        vec![[0.0; STATISTICS]; self.lobes]
    }

    fn accumulate(&self, sums: &mut Self::Sums, sample: &Sample, weight: f32) {
        let [x, y, _] = sample.normal.to_array();
        let statistics = [1.0, x, y, x * x, y * y, x * y];
        sums[0].iter_mut().zip(statistics).for_each(|(sum, t)| *sum += weight * t);
    }

    fn blend(&self, sums: &mut Self::Sums, part: &Self::Sums, weight: f32) {
        let all = sums.as_flattened_mut().iter_mut().zip(part.as_flattened());
        all.for_each(|(sum, p)| *sum += weight * p);
    }

    fn pack(&self, sums: &Self::Sums, channels: &mut [f32]) {
        for (sums, channels) in sums.iter().zip(channels.as_chunks_mut::<CHANNELS>().0) {
            Representation::store_lobe(self, sums, channels);
        }
    }

    fn unpack(&self, channels: &[f32]) -> Self::Sums {
        let lobes = channels.as_chunks::<CHANNELS>().0[..self.lobes].iter();
        lobes.map(|lobe| std::array::from_fn(|i| lobe[i])).collect()
    }

    fn decode(&self, sums: &Self::Sums) -> EllipticMixture {
        let alive = || sums.iter().enumerate().filter(|(_, s)| s[0] > 1e-5);
        let total: f64 = alive().map(|(_, s)| f64::from(s[0])).sum();
        let lobe = |(index, sums): (usize, &[f32; STATISTICS])| {
            let [alpha, x, y, xx, yy, xy] = sums.map(f64::from);
            let (x, y) = (x / alpha, y / alpha);
            let covariance = [xx / alpha - x * x, yy / alpha - y * y, xy / alpha - x * y];
            let variance = SlopeVariance::clamped((covariance[0] + covariance[1]) / 2.0);
            let mean = DVec3::new(x.clamp(-1.5, 1.5), y.clamp(-1.5, 1.5), 0.0);
            EllipticLobe { lobe: NormalLobe { index, weight: alpha / total, mean, variance }, covariance }
        };
        EllipticMixture { lobes: alive().map(lobe).collect() }
    }

    fn form<'a>(&'a self, lobes: &EllipticMixture) -> Form<'a> {
        // Lifted to the sphere.
        let lifted = |lobe: NormalLobe| NormalLobe { mean: lobe.direction(), ..lobe };
        Form::Lobes(lobes.isotropic().into_iter().map(lifted).collect(), Response::Sphere)
    }

    fn effective<'a>(
        &'a self,
        lobes: &EllipticMixture,
        lobe: &'a dyn Lobe,
    ) -> Box<dyn Fn(DVec3) -> f64 + 'a> {
        let Form::Lobes(lobes, response) = self.form(lobes) else { unreachable!("said so above") };
        effective(&lobes, lobe, response)
    }
}

/// Four by four blocks of a map: each half full of normals around one of two means, strewn along its own
/// line, red under the one and blue under the other.
fn two_kinds() -> (NormalGrid, Grid<[f32; 4]>) {
    let size = Size { width: 32, height: 16 };
    let kind = |x: usize| (x / 2) % 2;
    let normal = |x: usize, y: usize| {
        // One of -0.06, -0.02, 0.02, 0.06.
        let along = 0.04 * ((2 * (y % 2) + x % 2) as f32 - 1.5);
        let (nx, ny) = if kind(x) == 0 { (0.4 + along, 0.0) } else { (-0.3, 0.1 + along) };
        glam::Vec3::new(nx, ny, (1.0 - nx * nx - ny * ny).sqrt())
    };
    let colour = |x: usize, _| if kind(x) == 0 { [1.0, 0.0, 0.0, 0.5] } else { [0.0, 0.0, 1.0, 0.25] };
    let normals = NormalGrid { normals: Grid::from_fn(size, normal), wraps: Wraps::default() };
    (normals, Grid::from_fn(size, colour))
}

/// The covariance along the one line, and none across it: mean square of (-1.5, -0.5, 0.5, 1.5) times 0.04.
const ALONG: f64 = 1.25 * 0.04 * 0.04;

#[test]
fn six_statistics_are_fitted_stored_filtered_and_decoded() {
    let (surface, colours) = two_kinds();
    let elliptic = Elliptic::new(2);
    let method = AnyMethod::from(elliptic);
    assert_eq!((method.layers(), method.layers_with(1)), (4, 6));
    let bake = Bake::new(&surface, &*method).precision(Precision::Single);
    let (pyramid, report) = bake.attributes(&[colours]).to_pyramid().unwrap();
    assert_eq!((pyramid.layers(), report.overflowed), (6, 0));
    let layout = method.lobe_layout().unwrap();
    for level in 2..pyramid.sizes().len() {
        let channels = pyramid.texel(level, 0, 0);
        let decoded = elliptic.decode(&elliptic.unpack(&channels[..4 * method.layers()]));
        assert_eq!(decoded.lobes.len(), 2, "level {level}");
        for EllipticLobe { lobe, covariance: [xx, yy, xy] } in &decoded.lobes {
            let first = lobe.mean.x > 0.0;
            let (mean, expected, colour) = if first {
                (DVec3::new(0.4, 0.0, 0.0), [ALONG, 0.0], [1.0, 0.0, 0.0, 0.5])
            } else {
                (DVec3::new(-0.3, 0.1, 0.0), [0.0, ALONG], [0.0, 0.0, 1.0, 0.25])
            };
            // Sums of single floats: a step of 1 is 1.2e-7.
            assert!((lobe.mean - mean).length() < 1e-5 && (lobe.weight - 0.5).abs() < 1e-5, "{lobe:?}");
            let off = [xx - expected[0], yy - expected[1], *xy];
            assert!(off.iter().all(|c| c.abs() < 1e-6), "level {level}: {off:?}");
            let carried = layout.attribute(&channels, 0, lobe.index).unwrap();
            assert!(carried.iter().zip(colour).all(|(c, k)| (c - k).abs() < 1e-5), "{carried:?}");
        }
    }
    // Filtered: a point between two texels decodes to what both hold.
    let mut between = vec![0.0; pyramid.channels()];
    pyramid.bilinear(2, glam::DVec2::new(0.25, 0.5), 1.0, &mut between);
    let decoded = elliptic.decode(&elliptic.unpack(&between[..4 * method.layers()]));
    let widths: Vec<f64> = decoded.lobes.iter().map(|l| l.covariance[0].max(l.covariance[1])).collect();
    assert!(widths.iter().all(|w| (w - ALONG).abs() < 1e-6), "{widths:?}");
}
