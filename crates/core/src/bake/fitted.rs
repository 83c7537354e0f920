//! Baking of fitted methods: lobes come level by level from `fit`, and are stored as RGBA layers, one a lobe.

use rayon::prelude::*;

use super::{Bake, BakeReport, LevelSink, write_rows};
use crate::fit::{Fit, FitJob, FittedRows, Four, fit_levels};
use crate::grid::Grid;

impl Bake<'_> {
    /// Fits every level and stores its lobes, and after them those of each attribute.
    pub(super) fn run_fitted<S: LevelSink>(
        &self,
        fit: &Fit,
        attributes: &[Grid<Four>],
        sink: &mut S,
    ) -> Result<BakeReport, S::Error> {
        let mut report = BakeReport::default();
        let job = FitJob { surface: self.surface, attributes, progress: self.progress };
        fit_levels(fit, &job, &mut |rows: &FittedRows<'_>| {
            let store = |lobe: &Four| self.method.store_lobe(lobe);
            let mut layers = self.layers_of(fit.lobes, rows.sums, store);
            for carried in rows.attributes {
                layers.extend(self.layers_of(fit.lobes, carried, |value| *value));
            }
            report.overflowed += layers.iter().map(|l| l.1).sum::<usize>();
            let bytes: Vec<&[u8]> = layers.iter().map(|l| l.0.as_slice()).collect();
            write_rows(sink, rows.level, rows.rows.start, &bytes)
        })?;
        Ok(report)
    }

    /// Bytes of each lobe's layer, and how many of its channels overflowed.
    fn layers_of(
        &self,
        lobes: usize,
        sums: &[Four],
        store: impl Fn(&Four) -> Four + Sync,
    ) -> Vec<(Vec<u8>, usize)> {
        let layer = |j: usize| {
            let values: Vec<f32> = sums.iter().skip(j).step_by(lobes).flat_map(&store).collect();
            let mut bytes = Vec::new();
            let overflowed = self.precision.pack(&values, &mut bytes);
            (bytes, overflowed)
        };
        (0..lobes).into_par_iter().map(layer).collect()
    }
}
