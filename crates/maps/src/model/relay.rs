//! Textures that lie on a mesh otherwise than the map that the mesh is shaded with, laid as that map lies.
//!
//! A texture goes over into the map's unit square when an affine transform takes the map's coordinates to
//! its own and the transform's linear part is of whole numbers: then it repeats wherever the map does.

use std::sync::Arc;

use glam::{DAffine2, DMat2, DVec2, IVec2};
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::lookup::area_mean;
use ndfmap_core::surface::{Surface, SurfaceRow, Wraps};

/// Most texels of a map that is made of a texture's repetitions: those of 8192 × 8192.
const MAX_TEXELS: usize = 1 << 26;

/// Most repetitions of a texture along one side of the map.
const MAX_TIMES: f64 = 64.0;

/// Distance from a whole number that counts as rounding of a file's numbers.
const ROUNDING: f64 = 1e-3;

/// True for transforms that differ by the rounding of a file's numbers.
pub(super) fn is_near(a: DAffine2, b: DAffine2) -> bool {
    a.abs_diff_eq(b, ROUNDING)
}

/// Placing of a texture as seen from a material's map: the transform from the map's coordinates to the
/// texture's, of whole numbers but for a move within the unit square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placing(DAffine2);

impl Placing {
    /// Placing of a texture that lies as the map does.
    pub(super) const ALIKE: Self = Self(DAffine2::IDENTITY);

    /// Placing of a texture whose coordinates, and whose map's, are transforms of the same others; `None`
    /// where it does not repeat with the map.
    pub(super) fn between(map: DAffine2, texture: DAffine2) -> Option<Self> {
        let between = texture * map.inverse();
        if !between.is_finite() {
            return None;
        }
        let [a, b, c, d] = between.matrix2.to_cols_array();
        let whole = |v: f64| v.abs() <= MAX_TIMES && (v - v.round()).abs() <= ROUNDING;
        if ![a, b, c, d].into_iter().all(whole) {
            return None;
        }
        let matrix = DMat2::from_cols_array(&[a, b, c, d].map(f64::round));
        let away = between.translation - between.translation.floor();
        let away = DVec2::select(away.cmpgt(DVec2::splat(1.0 - ROUNDING)), DVec2::ZERO, away);
        let away = DVec2::select(away.cmplt(DVec2::splat(ROUNDING)), DVec2::ZERO, away);
        (matrix.determinant() != 0.0).then_some(Self(DAffine2::from_mat2_translation(matrix, away)))
    }

    /// Repetitions along the sides of the map, for a texture that is neither turned nor mirrored against it.
    fn times(self) -> Option<IVec2> {
        let [a, b, c, d] = self.0.matrix2.to_cols_array();
        (b == 0.0 && c == 0.0 && a >= 1.0 && d >= 1.0).then(|| IVec2::new(a as i32, d as i32))
    }
}

/// Values of a texture, and its placing.
pub(super) struct Laid {
    pub(super) values: Grid<[f32; 4]>,
    pub(super) placing: Placing,
}

impl Laid {
    /// Size of a map whose texels are the texture's, or smaller.
    pub(super) fn size(&self) -> Size {
        let own = self.values.size();
        let texels = self.texels_per_map();
        let along = |axis: DVec2| axis.abs().max_element().round() as usize;
        let size = Size { width: along(texels.x_axis), height: along(texels.y_axis) };
        if size.width.saturating_mul(size.height) <= MAX_TEXELS { size } else { own }
    }

    /// Mean over texel (`x`, `y`) of a map of the given size.
    pub(super) fn at(&self, size: Size, x: usize, y: usize) -> [f32; 4] {
        if self.placing == Placing::ALIKE {
            return area_mean(&self.values, size, x, y);
        }
        let own = self.values.size();
        let cells = DVec2::new(size.width as f64, size.height as f64);
        let texels = self.texels_per_map();
        let step = (texels.x_axis.abs() / cells.x).max(texels.y_axis.abs() / cells.y).max_element();
        // Two samples across each texel find the middle of every one, where the two grids agree.
        let n = 2 * (step - ROUNDING).ceil().max(1.0) as usize;
        let mut sum = [0.0; 4];
        for i in 0..n * n {
            let within = DVec2::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5) / n as f64;
            let uv = self.placing.0.transform_point2((DVec2::new(x as f64, y as f64) + within) / cells);
            let texel = |v: f64, length: usize| (v.rem_euclid(1.0) * length as f64) as usize % length;
            let value = self.values.row(texel(uv.y, own.height))[texel(uv.x, own.width)];
            sum.iter_mut().zip(value).for_each(|(s, v)| *s += f64::from(v));
        }
        sum.map(|s| (s / (n * n) as f64) as f32)
    }

    /// Columns: texels of the texture passed along the width, and along the height, of the map.
    fn texels_per_map(&self) -> DMat2 {
        let own = self.values.size();
        let own = DVec2::new(own.width as f64, own.height as f64);
        let linear = self.placing.0.matrix2;
        DMat2::from_cols(linear.x_axis * own, linear.y_axis * own)
    }
}

/// Normal map that repeats within a material's map, moved by whole texels.
pub(super) struct Repeated {
    inner: Arc<dyn Surface>,
    size: Size,
    shift: IVec2,
}

impl Repeated {
    /// The normals laid as the map lies; `None` where they are turned or mirrored against it, or would have
    /// more than 8192 × 8192 texels. A move that is no whole number of texels is rounded to one.
    pub(super) fn surface(inner: &Arc<dyn Surface>, placing: Placing) -> Option<Arc<dyn Surface>> {
        if placing == Placing::ALIKE {
            return Some(inner.clone());
        }
        let (own, times) = (inner.size(), placing.times()?);
        let size = Size { width: own.width * times.x as usize, height: own.height * times.y as usize };
        if size.width.saturating_mul(size.height) > MAX_TEXELS {
            return None;
        }
        let shift = placing.0.translation * DVec2::new(own.width as f64, own.height as f64);
        Some(Arc::new(Self { inner: inner.clone(), size, shift: shift.round().as_ivec2() }))
    }
}

impl Surface for Repeated {
    fn size(&self) -> Size {
        self.size
    }

    fn wraps(&self) -> Wraps {
        self.inner.wraps()
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        let own = self.inner.size();
        let mut stored = SurfaceRow::flat(own.width);
        self.inner.read_row((y + self.shift.y as usize) % own.height, &mut stored);
        for x in 0..row.width() {
            row.set_normal(x, stored.normal((x + self.shift.x as usize) % own.width));
        }
        row.height.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use ndfmap_core::surface::NormalGrid;

    fn scaled(scale: f64, x: f64) -> DAffine2 {
        DAffine2::from_scale_angle_translation(DVec2::splat(scale), 0.0, DVec2::new(x, 0.0))
    }

    #[test]
    fn whole_multiples_alone_repeat_with_the_map() {
        assert!(Placing::between(scaled(1.0, 0.0), scaled(3.0, 0.2)).is_some());
        assert!(Placing::between(scaled(1.0, 0.0), scaled(2.5, 0.0)).is_none());
        assert!(Placing::between(scaled(3.0, 0.0), scaled(1.0, 0.0)).is_none());
        assert!(Placing::between(scaled(0.0, 0.0), scaled(1.0, 0.0)).is_none());
        assert!(Placing::between(scaled(1.0, 0.0), scaled(f64::INFINITY, 0.0)).is_none());
        assert!(Placing::between(scaled(1.0, 0.25), scaled(1.0, 3.25)).unwrap() == Placing::ALIKE);
    }

    #[test]
    fn values_repeat_move_and_turn() {
        let values = Grid::from_fn(Size { width: 2, height: 1 }, |x, _| [x as f32; 4]);
        let row = |texture: DAffine2, width: usize| {
            let placing = Placing::between(DAffine2::IDENTITY, texture).unwrap();
            let laid = Laid { values: values.clone(), placing };
            let size = Size { width, height: laid.size().height };
            (laid.size(), (0..width).map(|x| laid.at(size, x, 0)[0]).collect::<Vec<_>>())
        };
        assert_eq!(row(scaled(2.0, 0.0), 4), (Size { width: 4, height: 2 }, vec![0.0, 1.0, 0.0, 1.0]));
        assert_eq!(row(scaled(1.0, 0.5), 2).1, [1.0, 0.0]);
        assert_eq!(row(scaled(2.0, 0.0), 2).1, [0.5, 0.5]);
        // A quarter turn: columns become rows.
        let turned = DAffine2::from_angle(-std::f64::consts::FRAC_PI_2);
        let placing = Placing::between(DAffine2::IDENTITY, turned).unwrap();
        let laid = Laid { values: values.clone(), placing };
        assert_eq!(laid.size(), Size { width: 1, height: 2 });
        assert_eq!([0, 1].map(|y| laid.at(laid.size(), 0, y)[0]), [0.0, 1.0]);
    }

    #[test]
    fn normals_repeat_and_are_not_turned() {
        let normal = |x: usize| Vec3::new(0.6 * x as f32, 0.0, 0.8).normalize();
        let normals = Grid::from_fn(Size { width: 2, height: 1 }, |x, _| normal(x));
        let map: Arc<dyn Surface> = Arc::new(NormalGrid { normals, wraps: Wraps::default() });
        let placing = Placing::between(DAffine2::IDENTITY, scaled(2.0, 0.5)).unwrap();
        let surface = Repeated::surface(&map, placing).unwrap();
        assert_eq!(surface.size(), Size { width: 4, height: 2 });
        let mut row = SurfaceRow::flat(4);
        surface.read_row(1, &mut row);
        assert_eq!([0, 1, 2, 3].map(|x| row.normal(x)), [1, 0, 1, 0].map(normal));
        let turned =
            Placing::between(DAffine2::IDENTITY, DAffine2::from_angle(std::f64::consts::PI)).unwrap();
        assert!(Repeated::surface(&map, turned).is_none());
    }
}
