//! Effective lobes of an engine's own material: one lobe about the mean normal, made unit, as wide as the
//! roughness beside it.
//!
//! Formulas are measured so beside the methods, at texels and between them.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::RoughSurface;
use crate::brdf::Lobe;
use crate::grid::Grid;
use crate::ndf::{Evaluator, Shows};
use crate::pyramid::{Layout, LevelMismatch, Precision, Pyramid};
use crate::surface::{Wraps, unit_or_up};
use crate::units::{Alpha, PerceptualRoughness, SlopeVariance};

/// Reader of maps whose texels hold a normal and a perceptual roughness, which an engine filters apart.
#[derive(Clone, Copy, Debug)]
pub struct EngineLobe;

impl EngineLobe {
    /// Map of the normals of a surface and the roughness of every level: a layer of x, y, z and roughness.
    /// Normals are unit, as those of a picture are.
    ///
    /// # Errors
    /// [`LevelMismatch`] where the roughness is not as large as the surface.
    pub fn map(
        surface: &RoughSurface,
        roughness: &[Grid<f32>],
        precision: Precision,
        wraps: Wraps,
    ) -> Result<Pyramid, LevelMismatch> {
        let layout = Layout { size: surface.size(), layers: 1, precision, wraps };
        let stored = |(level, roughness): (usize, &Grid<f32>)| {
            let size = roughness.size();
            let row = |y: usize| {
                let texel = |x: usize| {
                    let normal: Vec3 = unit_or_up(surface.mean(level, x, y).normal);
                    normal.extend(roughness.row(y)[x]).to_array()
                };
                let values: Vec<f32> = (0..size.width).flat_map(texel).collect();
                let mut bytes = Vec::new();
                precision.pack(&values, &mut bytes);
                bytes
            };
            (0..size.height).into_par_iter().map(row).collect::<Vec<_>>().concat()
        };
        Pyramid::new(layout, roughness.iter().enumerate().map(stored).collect())
    }
}

impl Shows for EngineLobe {
    fn show<'a>(&'a self, lobe: &'a dyn Lobe, directions: &'a [DVec3]) -> Box<dyn Evaluator + 'a> {
        Box::new(OneLobe { lobe, directions })
    }
}

struct OneLobe<'a> {
    lobe: &'a dyn Lobe,
    directions: &'a [DVec3],
}

impl Evaluator for OneLobe<'_> {
    fn evaluate(&self, channels: &[f32], out: &mut [f64]) {
        let normal = unit_or_up(Vec3::from_slice(channels)).as_dvec3();
        let width = PerceptualRoughness::new(f64::from(channels[3]).clamp(0.0, 1.0)).map(Alpha::from);
        let width = width.map_or(SlopeVariance::ZERO, SlopeVariance::from);
        // The lobe is widened to that width: what a map stores is never narrower, but for rounding.
        let own = self.lobe.slope_variance().unwrap_or(SlopeVariance::ZERO);
        let widened = self.lobe.widen(SlopeVariance::clamped(width.get() - own.get()));
        for (out, w) in out.iter_mut().zip(self.directions) {
            *out = widened.evaluate(w.dot(normal));
        }
    }
}
