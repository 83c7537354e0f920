//! Colour maps of our own for maps of our own.

use glam::Vec3;
use ndfmap::core::grid::Grid;
use ndfmap::core::surface::{Surface, SurfaceRow};
use ndfmap::scene::SurfaceTextures;

/// Shares of a colour that become albedo and specular colour; without a specular one the material keeps its
/// own.
#[derive(Clone, Copy)]
pub(crate) struct Paint {
    pub(crate) diffuse: f32,
    pub(crate) specular: f32,
}

/// Colour of each texel by its normal and its height; the height is 0 where the map is lowest and 1 where it
/// is highest.
pub(crate) fn painted(
    surface: &dyn Surface,
    Paint { diffuse, specular }: Paint,
    colour: impl Fn(Vec3, f32) -> Vec3,
) -> SurfaceTextures {
    let size = surface.size();
    let mut row = SurfaceRow::flat(size.width);
    let texels = Grid::from_fn(size, |x, y| {
        if x == 0 {
            surface.read_row(y, &mut row);
        }
        (row.normal(x), row.height[x])
    });
    let heights = || texels.texels().iter().map(|(_, height)| *height);
    let (low, high) = (heights().fold(f32::INFINITY, f32::min), heights().fold(f32::NEG_INFINITY, f32::max));
    let of = |factor: f32, alpha: f32| {
        Grid::from_fn(size, |x, y| {
            let (normal, height) = texels.row(y)[x];
            let part = if high > low { (height - low) / (high - low) } else { 0.5 };
            (factor * colour(normal, part)).extend(alpha).to_array()
        })
    };
    SurfaceTextures {
        diffuse_roughness: of(diffuse, 0.0).into(),
        specular: (specular > 0.0).then(|| of(specular, 1.0).into()),
    }
}

/// Colour of a direction's hue around the pole, bright where it leans far.
pub(crate) fn by_direction(normal: Vec3, _height: f32) -> Vec3 {
    let turn = std::f32::consts::TAU / 3.0;
    let angle = normal.y.atan2(normal.x);
    let wave = |shift: f32| 0.5 + 0.5 * (angle - shift).cos();
    let lean = (1.6 * normal.truncate().length()).min(1.0);
    Vec3::splat(0.5).lerp(Vec3::new(wave(0.0), wave(turn), wave(2.0 * turn)), lean)
}
