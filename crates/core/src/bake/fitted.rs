//! Baking of fitted methods: lobes come level by level from `fit`, and are stored as RGBA layers, one a lobe.

use rayon::prelude::*;

use super::{Bake, BakeError, BakeReport, LevelSink, write_rows};
use crate::fit::{Fit, FitJob, FittedRows, Rgba, fit_levels};

impl Bake<'_> {
    /// Fits every level and stores its lobes, and after them those of each attribute.
    pub(super) fn run_fitted<S: LevelSink>(
        &self,
        fit: &Fit,
        sink: &mut S,
    ) -> Result<BakeReport, BakeError<S::Error>> {
        let mut report = BakeReport::default();
        let job = FitJob { surface: self.surface, attributes: self.attributes, observer: self.observer };
        fit_levels(fit, &job, &mut |rows: &FittedRows<'_>| {
            let mut layers = self.layers_of_lobes(fit.lobes, rows);
            for carried in rows.attributes {
                layers.extend(self.layers_of_attribute(fit.lobes, carried));
            }
            report.overflowed += layers.iter().map(|l| l.1).sum::<usize>();
            let bytes: Vec<&[u8]> = layers.iter().map(|l| l.0.as_slice()).collect();
            write_rows(sink, rows.level, rows.rows.start, &bytes).map_err(BakeError::Sink)
        })?;
        Ok(report)
    }

    /// Bytes of the layers of each lobe, one lobe after another, and how many of their channels overflowed.
    fn layers_of_lobes(&self, lobes: usize, rows: &FittedRows<'_>) -> Vec<(Vec<u8>, usize)> {
        let each = rows.statistics.div_ceil(4);
        let layer = |i: usize| {
            let (lobe, part) = (i / each, i % each);
            let mut channels = vec![1.0; 4 * each];
            let texels = rows.sums.chunks_exact(rows.statistics).skip(lobe).step_by(lobes);
            let values: Vec<f32> = texels
                .flat_map(|sums| {
                    self.method.store_lobe(sums, &mut channels);
                    [0, 1, 2, 3].map(|c| channels[4 * part + c])
                })
                .collect();
            self.packed(&values)
        };
        (0..lobes * each).into_par_iter().map(layer).collect()
    }

    /// Bytes of the layers of an attribute, one a lobe.
    fn layers_of_attribute(&self, lobes: usize, carried: &[Rgba]) -> Vec<(Vec<u8>, usize)> {
        let layer = |lobe: usize| {
            let values: Vec<f32> = carried.iter().skip(lobe).step_by(lobes).flatten().copied().collect();
            self.packed(&values)
        };
        (0..lobes).into_par_iter().map(layer).collect()
    }

    fn packed(&self, values: &[f32]) -> (Vec<u8>, usize) {
        let mut bytes = Vec::new();
        let overflowed = self.precision.pack(values, &mut bytes);
        (bytes, overflowed)
    }
}
