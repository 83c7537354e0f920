//! Choice of a method: bakes a map with every candidate, measures each against the truth, and says which to
//! take.
//!
//! The measure is the error that a viewer meets: between texels, where a filter mixes, at levels 3 and 6, on
//! the map as it would be stored. A candidate's error is the worse of the two levels.

use ndfmap_core::bake::Bake;
use ndfmap_core::brdf::Lobe;
use ndfmap_core::compact::Storage;
use ndfmap_core::measure::{BakedMap, Estimate, FilteringError, TexelTruth, filtering_errors, lattice_for};
use ndfmap_core::observe::Observer;
use ndfmap_core::pyramid::level_sizes;
use ndfmap_core::surface::Surface;
use serde::Serialize;

use crate::Error;
use ndfmap_core::ndf::{AnyMethod, Shows};

/// Methods to choose from: one of each kind and size that is the best of its size on some map.
const CANDIDATES: [&str; 13] = [
    "naive",
    "toksvig",
    "slopes",
    "ndm:plane",
    "sh:4",
    "sh:7",
    "vmf:1",
    "vmf:2",
    "vmf:3",
    "vmf:4",
    "vmf:6",
    "vmf:8",
    "gmm:4",
];

/// Levels at which candidates are measured; on small maps the coarsest that has neighbours.
const LEVELS: [usize; 2] = [3, 6];

/// Bound on the choice.
#[derive(Clone, Copy, Debug)]
pub enum Limit {
    /// Largest error.
    Error(f64),
    /// Most bytes a texel of the finest level, before compression.
    Bytes(usize),
}

/// Choice to be made.
pub struct Auto<'a> {
    /// The map.
    pub surface: &'a dyn Surface,
    /// Lobe that errors are measured with.
    pub lobe: &'a dyn Lobe,
    /// Storage of a channel.
    pub storage: Storage,
    /// Choose only among methods whose lobes carry attributes.
    pub lobes_only: bool,
}

/// Candidate, measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Spelling of the method.
    pub method: String,
    /// Bytes of a texel of the finest level, before compression.
    #[serde(rename = "bytes_per_texel")]
    pub bytes: usize,
    /// Error between texels, the worse of the levels.
    pub error: f64,
    /// Standard error of that, 0 where all corners were measured.
    pub standard_error: f64,
}

/// Choice that was made, with its reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// Spelling of the method.
    #[serde(skip)]
    pub method: String,
    /// Reason, in words.
    pub why: String,
    /// Lobe that errors were measured with.
    #[serde(rename = "brdf")]
    pub lobe: String,
    /// Levels at which errors were measured.
    pub levels: Vec<usize>,
    /// Every candidate, those of fewer bytes first.
    pub candidates: Vec<Candidate>,
}

impl Auto<'_> {
    /// Measures and chooses.
    ///
    /// # Errors
    /// [`Error::Failed`] where no candidate is within the limit, [`Error::Request`] for a map of one texel,
    /// and [`Error::Cancelled`].
    pub fn choose(&self, limit: Limit, observer: &dyn Observer) -> Result<Choice, Error> {
        // Known before anything is measured.
        let bytes_of = |method: &AnyMethod| self.storage.texel_bytes(method.layers());
        let mut methods = Vec::new();
        for spelling in CANDIDATES {
            let method = spelling.parse::<AnyMethod>()?;
            if !self.lobes_only || method.carries_attributes() {
                methods.push(method);
            }
        }
        let fewest = methods.iter().map(bytes_of).min().unwrap_or_default();
        if let Limit::Bytes(most) = limit {
            methods.retain(|method| bytes_of(method) <= most);
            if methods.is_empty() {
                let reason = format!("no method takes at most {most} bytes a texel; the least is {fewest}");
                return Err(Error::Request(reason));
            }
        }
        let sizes = level_sizes(self.surface.size());
        let last = sizes.iter().rposition(|s| s.area() > 1).ok_or_else(|| {
            Error::Request("a map of one texel has nothing to measure: name a method".to_owned())
        })?;
        let mut levels: Vec<usize> = LEVELS.iter().map(|l| *l.min(&last)).collect();
        levels.dedup();
        let lattice = lattice_for(self.lobe)?;
        let mut pyramids = Vec::new();
        for method in &methods {
            observer.begin(&method.to_string());
            let bake = Bake::new(self.surface, &**method).precision(self.storage.baked()).observer(observer);
            pyramids.push(self.storage.stored(bake.to_pyramid()?.0, method.encoding()));
        }
        observer.begin("errors");
        let truth = TexelTruth::new(self.surface, self.lobe, &lattice);
        let shown = methods.iter().map(|method| -> &dyn Shows { &**method });
        let map = |(pyramid, method)| BakedMap { pyramid, from_level: 0, method };
        let maps: Vec<BakedMap<'_>> = pyramids.iter().zip(shown).map(map).collect();
        let errors = filtering_errors(&truth, self.surface.wraps(), &levels, &maps, observer)?;
        let candidate = |(method, errors): (&AnyMethod, &Vec<FilteringError>)| {
            let worst = errors.iter().map(|e| e.filtered).max_by(|a, b| a.error.total_cmp(&b.error));
            let Estimate { error, standard_error, .. } = worst.unwrap_or_default();
            Candidate { method: method.to_string(), bytes: bytes_of(method), error, standard_error }
        };
        let mut candidates: Vec<Candidate> = methods.iter().zip(&errors).map(candidate).collect();
        candidates.sort_by(|a, b| {
            (a.bytes, a.error).partial_cmp(&(b.bytes, b.error)).unwrap_or(std::cmp::Ordering::Equal)
        });
        let (chosen, why) = pick(&candidates, limit)?;
        let method = candidates[chosen].method.clone();
        Ok(Choice { method, why, levels, lobe: self.lobe.to_string(), candidates })
    }
}

/// Picks a candidate among these, sorted by bytes; returns its index, and the reason in words.
fn pick(candidates: &[Candidate], limit: Limit) -> Result<(usize, String), Error> {
    let least = (0..candidates.len()).min_by(|a, b| candidates[*a].error.total_cmp(&candidates[*b].error));
    match limit {
        Limit::Error(most) => {
            if let Some(i) = candidates.iter().position(|c| c.error <= most) {
                let Candidate { bytes, error, .. } = &candidates[i];
                return Ok((
                    i,
                    format!(
                        "the cheapest whose error is at most {most}: {error:.3} at {bytes} bytes a texel"
                    ),
                ));
            }
            let best = least
                .map(|i| format!("; the least is {:.3}, by `{}`", candidates[i].error, candidates[i].method));
            let row =
                |c: &Candidate| format!("\n  {:10} {:>4} bytes a texel {:>7.3}", c.method, c.bytes, c.error);
            Err(Error::Failed(format!(
                "no method's error is at most {most} on this map{}:{}",
                best.unwrap_or_default(),
                candidates.iter().map(row).collect::<String>()
            )))
        }
        Limit::Bytes(most) => match least {
            Some(i) => {
                let Candidate { bytes, error, .. } = &candidates[i];
                Ok((i, format!("the least error within {most} bytes a texel: {error:.3} at {bytes}")))
            }
            None => Err(Error::Failed(format!("no method takes at most {most} bytes a texel"))),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates() -> Vec<Candidate> {
        [("naive", 8, 0.9), ("slopes", 16, 0.3), ("vmf:2", 16, 0.35), ("vmf:4", 32, 0.1)]
            .map(|(m, bytes, error)| Candidate { method: m.to_owned(), bytes, error, standard_error: 0.0 })
            .into()
    }

    #[test]
    fn the_cheapest_that_is_good_enough_or_the_best_that_fits() {
        let pick = |limit| pick(&candidates(), limit).map(|(i, _)| i).map_err(|e| e.to_string());
        assert_eq!(pick(Limit::Error(0.32)), Ok(1));
        assert_eq!(pick(Limit::Error(0.2)), Ok(3));
        assert_eq!(pick(Limit::Bytes(64)), Ok(3));
        assert!(pick(Limit::Error(0.01)).unwrap_err().contains("the least is 0.100, by `vmf:4`"));
    }
}
