//! Blocks of 4 × 4 texels that desktop cards read, by a library: BC4 and BC7.

use std::num::NonZero;

use block_compression::encode::compress_rgba8;
use block_compression::{BC7Settings, CompressionVariant};
use ndfmap_core::grid::Grid;
use rayon::prelude::*;

/// Texels a side of a block.
const SIDE: usize = 4;

/// Kinds of blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blocks {
    /// Red alone, in eight bytes.
    Bc4,
    /// Red, green and blue, in sixteen bytes.
    Bc7,
}

impl Blocks {
    /// Bytes of a block.
    pub(super) fn bytes(self) -> NonZero<usize> {
        match self {
            Self::Bc4 => const { NonZero::new(8).unwrap() },
            Self::Bc7 => const { NonZero::new(16).unwrap() },
        }
    }

    /// Blocks of a level, row by row; texels beyond its edges repeat the last.
    pub(super) fn pack(self, level: &Grid<[u8; 4]>) -> Vec<u8> {
        let size = level.size();
        let width = size.width.next_multiple_of(SIDE);
        let variant = || match self {
            Self::Bc4 => CompressionVariant::BC4,
            Self::Bc7 => CompressionVariant::BC7(BC7Settings::opaque_slow()),
        };
        let row = |j: usize| {
            let texel = |i: usize| {
                let (x, y) = (i % width, SIDE * j + i / width);
                level.row(y.min(size.height - 1))[x.min(size.width - 1)]
            };
            let texels: Vec<[u8; 4]> = (0..width * SIDE).map(texel).collect();
            let mut blocks = vec![0; width / SIDE * self.bytes().get()];
            let (width, rows, stride) = (width as u32, SIDE as u32, 4 * width as u32);
            compress_rgba8(variant(), texels.as_flattened(), &mut blocks, width, rows, stride);
            blocks
        };
        (0..size.height.div_ceil(SIDE)).into_par_iter().flat_map_iter(row).collect()
    }
}
