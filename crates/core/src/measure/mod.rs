//! Errors of a baked map against the truth: at its texels, level by level, and between them.

mod aspect;
mod between;
mod estimate;
mod texels;

pub use between::{FilteringError, MOST_SITES, SITES, evaluate_neighbours, filtering_errors};
pub use estimate::{Estimate, SURE, UNSEEN};
pub use texels::{
    BakedMap, DISK_RADIUS, LevelErrors, MAX_TEXELS, MOST_SAMPLED, SAMPLED_TEXELS, TexelTruth, TooNarrow,
    lattice_for, level_errors,
};
