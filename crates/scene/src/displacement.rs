//! Displacement of a mesh by the height map that lies on it.
//!
//! A mesh is displaced along its normals by `depth` times the height. Shading works in the frames
//! of the mesh as it was, where the slopes of the surface are those of the map, but for how the map is
//! stretched: with `P_x` and `P_y` how a place moves per texture width on the map, as seen in the frame, a
//! slope m of the map becomes `depth (P_x P_y)⁻ᵀ m` on the surface. Where the map is laid on evenly, at
//! `depth` per texture width, that is m. (The surface is taken for flat over the reach of a pixel, as LEADR
//! does: heights are small beside its radius of curvature.)

use std::sync::Arc;

use glam::{DMat2, DVec2, Mat2, Vec3};

use super::Mesh;
use super::tessellation::split;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::lookup::{Lookup, Neighbour, Tap, Texels};
use ndfmap_core::surface::{Surface, SurfaceRow};

/// Heights of a map, and how far they stand out.
#[derive(Clone, Debug)]
pub struct Displacement {
    /// Heights in texture widths, in the first channel.
    pub heights: Arc<Lookup>,
    /// World length of a texture width on the mesh, in the mean.
    pub width: f64,
    /// World length of a height of one texture width.
    pub depth: f64,
    /// Greatest world length by which the surface stands out or goes in.
    pub reach: f64,
}

impl Displacement {
    /// The heights of a surface that lies on a mesh at `width` a texture width, `scale` times as high as
    /// keeps their slopes.
    #[must_use]
    pub fn new(surface: &dyn Surface, width: f64, scale: f64) -> Self {
        let depth = scale * width;
        let mut row = SurfaceRow::flat(surface.size().width);
        let heights = Grid::from_fn(surface.size(), |x, y| {
            if x == 0 {
                surface.read_row(y, &mut row);
            }
            [row.height[x], 0.0, 0.0, 1.0]
        });
        let highest = heights.texels().iter().fold(0.0_f32, |most, h| most.max(h[0].abs()));
        let heights = Arc::new(Lookup::of_values(&heights, surface.wraps()));
        Self { heights, width, depth, reach: f64::from(highest) * depth.abs() }
    }

    /// World height at a place of the map, of the level that a length of `over` in the world asks for.
    #[must_use]
    pub fn height(&self, uv: DVec2, over: f64) -> f64 {
        let mut sums = [0.0; 4];
        let texel = self.width / self.heights_size().width as f64;
        self.heights.trilinear(Tap { uv, lod: (over / texel).max(1.0).log2() }, 1.0, &mut sums);
        f64::from(sums[0]) * self.depth
    }

    /// World height at a place of the map, of the bilinear surface between its heights.
    #[inline]
    #[must_use]
    pub fn finest(&self, uv: DVec2) -> f64 {
        let around = self.heights.around(0, uv);
        let height = |n: &Neighbour| n.weight * f64::from(self.heights.texel(0, n.x, n.y)[0]);
        around.iter().map(height).sum::<f64>() * self.depth
    }

    /// Texels of the finest heights.
    #[must_use]
    pub fn heights_size(&self) -> Size {
        self.heights.sizes()[0]
    }

    /// Rows over columns of the map.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        let finest = self.heights_size();
        finest.height as f64 / finest.width as f64
    }
}

/// World length of a texture width on meshes, in the mean over their area; rows over columns are `aspect`.
pub(super) fn texture_width<'a>(meshes: impl Iterator<Item = &'a Mesh>, aspect: f64) -> f64 {
    let (mut world, mut map) = (0.0, 0.0);
    for mesh in meshes {
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
            world +=
                (b.position - a.position).as_dvec3().cross((c.position - a.position).as_dvec3()).length();
            map += (b.uv - a.uv).as_dvec2().perp_dot((c.uv - a.uv).as_dvec2()).abs() * aspect;
        }
    }
    if map > 0.0 && world > 0.0 { (world / map).sqrt() } else { 1.0 }
}

impl Mesh {
    /// The mesh in triangles small enough for a displacement to be tessellated in, with the matrix at each
    /// vertex that takes slopes of the map to the surface.
    #[must_use]
    pub fn with_displacement(&self, displacement: &Displacement) -> Self {
        split(&Self { stretches: self.slope_maps(displacement), ..self.clone() })
    }

    /// Matrices that take slopes of the map to the surface, one for each vertex: from the mean of the
    /// triangles around, by area.
    fn slope_maps(&self, displacement: &Displacement) -> Vec<Mat2> {
        let mut sums = vec![(DMat2::ZERO, 0.0); self.vertices.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|i| self.vertices[i as usize]);
            let (p, q) = (b.position - a.position, c.position - a.position);
            // In texture widths, y up.
            let along = |d: glam::Vec2| DVec2::new(d.x.into(), -f64::from(d.y) * displacement.aspect());
            let (m, n) = (along(b.uv - a.uv), along(c.uv - a.uv));
            let determinant = m.perp_dot(n);
            if determinant == 0.0 {
                continue;
            }
            let area = f64::from(p.cross(q).length());
            let (p, q) = (p.as_dvec3(), q.as_dvec3());
            let (along_x, along_y) = ((p * n.y - q * m.y) / determinant, (q * m.x - p * n.x) / determinant);
            for i in t {
                let v = self.vertices[*i as usize];
                let tangent = v.tangent.truncate();
                let bitangent = v.normal.cross(tangent) * v.tangent.w;
                let in_frame = |w: glam::DVec3| {
                    let part = |axis: Vec3| w.dot(axis.as_dvec3());
                    DVec2::new(part(tangent), part(bitangent))
                };
                let (sum, weight) = &mut sums[*i as usize];
                *sum += area * DMat2::from_cols(in_frame(along_x), in_frame(along_y));
                *weight += area;
            }
        }
        let of = |(sum, weight): (DMat2, f64)| {
            let mean = sum * (1.0 / weight.max(f64::MIN_POSITIVE));
            // Where the map is crushed to a line, as at a pole, nothing can be told: it counts as even there.
            if mean.determinant().abs() < 1e-6 * displacement.width * displacement.width {
                return Mat2::IDENTITY * (displacement.depth / displacement.width) as f32;
            }
            (mean.transpose().inverse() * displacement.depth).as_mat2()
        };
        sums.into_iter().map(of).collect()
    }
}
