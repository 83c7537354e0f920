//! Textures that are mirrored beyond their edges, as larger ones that repeat: each beside its own image.

use std::sync::Arc;

use glam::DVec2;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::surface::{Surface, SurfaceRow, Wraps};

/// Axes of a texture that are mirrored beyond its edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Mirrors {
    pub(super) x: bool,
    pub(super) y: bool,
}

impl Mirrors {
    /// Size of the texture and its images together.
    fn doubled(self, size: Size) -> Size {
        let times = |mirrored: bool| if mirrored { 2 } else { 1 };
        Size { width: size.width * times(self.x), height: size.height * times(self.y) }
    }

    /// Scale from the texture's coordinates to those of the texture and its images together.
    pub(super) fn scale(self) -> DVec2 {
        let half = |mirrored: bool| if mirrored { 0.5 } else { 1.0 };
        DVec2::new(half(self.x), half(self.y))
    }

    /// A texture's values with their images beside them.
    pub(super) fn values(self, values: Grid<[f32; 4]>) -> Grid<[f32; 4]> {
        if self == Self::default() {
            return values;
        }
        let size = values.size();
        Grid::from_fn(self.doubled(size), |x, y| values.row(folded(y, size.height))[folded(x, size.width)])
    }

    /// A normal map with its images beside it. Normals keep their directions: samplers mirror places alone.
    pub(super) fn surface(self, inner: Arc<dyn Surface>) -> Arc<dyn Surface> {
        if self == Self::default() {
            return inner;
        }
        Arc::new(Mirrored { inner, mirrors: self })
    }
}

/// Texel under texel `i` of a texture of length `n` and its image.
fn folded(i: usize, n: usize) -> usize {
    if i < n { i } else { 2 * n - 1 - i }
}

/// A normal map and its images.
struct Mirrored {
    inner: Arc<dyn Surface>,
    mirrors: Mirrors,
}

impl Surface for Mirrored {
    fn size(&self) -> Size {
        self.mirrors.doubled(self.inner.size())
    }

    fn wraps(&self) -> Wraps {
        self.inner.wraps()
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        let size = self.inner.size();
        let mut stored = SurfaceRow::flat(size.width);
        self.inner.read_row(folded(y, size.height), &mut stored);
        for x in 0..row.width() {
            row.set_normal(x, stored.normal(folded(x, size.width)));
        }
        row.height.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use ndfmap_core::surface::NormalGrid;

    #[test]
    fn images_lie_beside_the_texture() {
        let mirrors = Mirrors { x: true, y: false };
        let values = Grid::from_fn(Size { width: 2, height: 1 }, |x, _| [x as f32; 4]);
        let row = mirrors.values(values).row(0).iter().map(|v| v[0]).collect::<Vec<_>>();
        assert_eq!(row, [0.0, 1.0, 1.0, 0.0]);
        let normal = |y: usize| Vec3::new(0.0, 0.6 * y as f32, 0.8).normalize();
        let normals = Grid::from_fn(Size { width: 1, height: 2 }, |_, y| normal(y));
        let map = NormalGrid { normals, wraps: Wraps::default() };
        let surface = Mirrors { x: false, y: true }.surface(Arc::new(map));
        let mut row = SurfaceRow::flat(1);
        for (y, stored) in [0, 1, 1, 0].into_iter().enumerate() {
            surface.read_row(y, &mut row);
            assert_eq!(row.normal(0), normal(stored));
        }
    }
}
