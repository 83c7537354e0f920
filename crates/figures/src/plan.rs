//! Plan of a figure: how large and how long.

use ndfmap::core::grid::Size;
use ndfmap::core::observe::Observer;
use ndfmap::render::Device;
use ndfmap::scene::Effort;

/// Plan that figures are drawn by.
pub struct Plan<'a> {
    /// True for small pictures and maps: a look at every figure in a minute or two, with numbers that are
    /// rough.
    pub quick: bool,
    /// Seed of the truths' rays.
    pub seed: u64,
    /// Device of `tan-speed`'s frame rates; all else is made on the processor.
    pub device: &'a Device,
    /// Observer of progress, who may cancel.
    pub observer: &'a dyn Observer,
}

impl Plan<'_> {
    /// Picture of `side × side` pixels, or a quarter of that.
    pub(crate) fn picture(&self, side: usize) -> Size {
        square(if self.quick { (side / 4).max(48) } else { side })
    }

    /// Map of `side × side` texels, or an eighth of that.
    pub(crate) fn map(&self, side: usize) -> Size {
        square(if self.quick { (side / 8).max(64) } else { side })
    }

    /// Effort of a truth of so many rays a pixel, or of the fewest.
    pub(crate) fn effort(&self, rays: usize) -> Effort {
        Effort { rays: if self.quick { 32 } else { rays }, noise: 0.0, seed: self.seed }
    }
}

fn square(side: usize) -> Size {
    Size { width: side, height: side }
}
