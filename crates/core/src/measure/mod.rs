//! Errors of a baked map against the truth: at its texels, level by level, and between them.

mod between;
mod texels;

pub use between::{
    Corner, FilteringError, SITES, TrueCorners, evaluate_neighbours, filtering_error, true_corners,
};
pub use texels::{
    DISK_RADIUS, MAX_TEXELS, SAMPLED_TEXELS, TexelTruth, TrueLevel, lattice_for, level_error, true_levels,
};
