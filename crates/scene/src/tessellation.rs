//! Tessellation: a displaced mesh in triangles of about four pixels, moved by the heights of the same
//! scale.
//!
//! Each triangle of the base mesh is a patch: a grid of `segments` on a side, a power of two. Its longest
//! edge as seen decides how many. An edge that needs fewer has its points moved together, so that patches on
//! both sides of it have the same, and there are no cracks. The segments of an edge depend only on the edge
//! and the eye, the height of a point only on the point and the eye. (Where vertices at one place have
//! different normals or lie on different parts of the map, at hard edges and seams, displacement tears the
//! mesh.) Planning takes a pass over the base mesh; the points are worked out here ([`expand`]), or by the
//! twin in `tessellation.wgsl`.

use glam::{DVec2, DVec3, Mat2, Vec2, Vec3};
use rayon::prelude::*;

use super::{Displacement, Mesh, Rays, Vertex};
use ndfmap_core::grid::Size;

/// Twin of this file in WGSL.
pub const TESSELLATION: &str = include_str!("tessellation.wgsl");

/// Longest edge of a triangle, in pixels. Rounding to powers of two makes most of them half to all of that:
/// with a right angle, triangles of two to eight pixels.
const EDGE_PIXELS: f64 = 5.7;

/// Scale at which heights are taken, in pixels: as fine as triangles of that size can show.
pub const HEIGHT_PIXELS: f64 = 2.0;

/// Most segments on a side of a patch.
const MOST_SEGMENTS: u32 = 512;

/// Most triangles of a plan, but for those of the base mesh.
const MOST_TRIANGLES: u64 = 1 << 24;

/// Most segments along a texel: finer ones would show nothing more.
const SEGMENTS_PER_TEXEL: f64 = 2.0;

/// A triangle of the base mesh and how it is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Index of the triangle.
    pub triangle: u32,
    /// Segments on a side of its grid.
    pub segments: u32,
    /// Segments that its edges show: from the first corner to the second, to the third, and back.
    pub edges: [u32; 3],
    /// Number of points in the patches before.
    pub first_point: u32,
    /// Number of triangles in the patches before.
    pub first_triangle: u32,
}

/// Plan for cutting a mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The patches that may be seen.
    pub patches: Vec<Patch>,
    /// Points of all patches.
    pub points: u32,
    /// Triangles of all patches.
    pub triangles: u32,
}

impl Plan {
    fn push(&mut self, triangle: usize, edges: [u32; 3]) {
        let segments = edges[0].max(edges[1]).max(edges[2]);
        let (first_point, first_triangle) = (self.points, self.triangles);
        self.patches.push(Patch { triangle: triangle as u32, segments, edges, first_point, first_triangle });
        self.points += (segments + 1) * (segments + 2) / 2;
        self.triangles += segments * segments;
    }
}

/// View frustum of a picture: a cone of four planes, widened by a few pixels.
struct Frustum {
    eye: DVec3,
    /// Unit normals of the planes, inward; the first is the plane of the eye.
    planes: [DVec3; 5],
    /// Size of a pixel at distance 1.
    pixel: f64,
}

impl Frustum {
    fn new(rays: &Rays, size: Size) -> Self {
        // Pictures drift by a pixel, and outlines look at their neighbours.
        let beyond = 3.0;
        let corner = |x: f64, y: f64| rays.corner + rays.right * x + rays.down * y;
        let (x, y) = (size.width as f64 + beyond, size.height as f64 + beyond);
        let around = [corner(-beyond, -beyond), corner(x, -beyond), corner(x, y), corner(-beyond, y)];
        let middle: DVec3 = around.iter().sum();
        let side = |i: usize| {
            let normal = around[i].cross(around[(i + 1) % 4]).normalize_or(DVec3::Y);
            if normal.dot(middle) < 0.0 { -normal } else { normal }
        };
        let forward = rays.right.cross(rays.down).normalize_or(DVec3::NEG_Z);
        let forward = if forward.dot(middle) < 0.0 { -forward } else { forward };
        Self {
            eye: rays.eye,
            planes: [forward, side(0), side(1), side(2), side(3)],
            pixel: rays.right.length(),
        }
    }

    /// False where nothing of a ball can be seen.
    fn may_see(&self, middle: DVec3, radius: f64) -> bool {
        self.planes.iter().all(|plane| plane.dot(middle - self.eye) > -radius)
    }

    /// Segments that an edge needs.
    fn segments(&self, a: &Vertex, b: &Vertex, displacement: &Displacement) -> u32 {
        let (p, q) = (a.position.as_dvec3(), b.position.as_dvec3());
        let along = q - p;
        let length = along.length();
        let at = ((self.eye - p).dot(along) / (length * length).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        // The displaced surface may come nearer, but not more than half the way.
        let distance = p.lerp(q, at).distance(self.eye);
        let distance = (distance - displacement.reach).max(distance / 2.0);
        let pixels = length / (distance * self.pixel).max(f64::MIN_POSITIVE);
        let finest = displacement.heights_size();
        let texels = (b.uv - a.uv).as_dvec2() * DVec2::new(finest.width as f64, finest.height as f64);
        let wanted = (pixels / EDGE_PIXELS).min(texels.length() * SEGMENTS_PER_TEXEL);
        (wanted.ceil().max(1.0).min(f64::from(MOST_SEGMENTS)) as u32).next_power_of_two()
    }
}

/// Plan for cutting a displaced mesh for a picture.
#[must_use]
pub fn plan(mesh: &Mesh, displacement: &Displacement, rays: &Rays, size: Size) -> Plan {
    let frustum = Frustum::new(rays, size);
    let edges = |t: &[u32; 3]| {
        let corners = t.map(|i| mesh.vertices[i as usize]);
        let [p, q, r] = corners.map(|c| c.position.as_dvec3());
        let middle = (p + q + r) / 3.0;
        let radius = [p, q, r].iter().fold(0.0, |most: f64, c| most.max(c.distance(middle)));
        frustum
            .may_see(middle, radius + displacement.reach)
            .then(|| [0, 1, 2].map(|k| frustum.segments(&corners[k], &corners[(k + 1) % 3], displacement)))
    };
    let all: Vec<Option<[u32; 3]>> = mesh.triangles.par_iter().map(edges).collect();
    // However near the eye, never more than memory has room for: all edges alike are cut less finely.
    let triangles = |coarser: u32| -> u64 {
        let segments = |e: &[u32; 3]| u64::from((e[0].max(e[1]).max(e[2]) >> coarser).max(1));
        all.iter().flatten().map(|e| segments(e).pow(2)).sum()
    };
    let coarser = (0..MOST_SEGMENTS.ilog2()).find(|c| triangles(*c) <= MOST_TRIANGLES);
    let coarser = coarser.unwrap_or(MOST_SEGMENTS.ilog2());
    let mut plan = Plan::default();
    for (triangle, edges) in all.into_iter().enumerate() {
        if let Some(edges) = edges {
            plan.push(triangle, edges.map(|e| (e >> coarser).max(1)));
        }
    }
    plan
}

/// Weights of a patch's corners at a point of its grid: row `r` from the first corner on, 0 to `segments`,
/// and `c` along it, 0 to `r`.
fn weights(patch: &Patch, r: u32, c: u32) -> [f32; 3] {
    let n = patch.segments;
    // Nearest point of an edge that shows fewer segments.
    let moved = |k: u32, edge: u32| {
        let ratio = n / edge;
        (k + ratio / 2) / ratio * ratio
    };
    let (a, b, c) = if c == 0 {
        let r = moved(r, patch.edges[0]);
        (n - r, r, 0)
    } else if c == r {
        let r = moved(r, patch.edges[2]);
        (n - r, 0, r)
    } else if r == n {
        let c = moved(c, patch.edges[1]);
        (0, n - c, c)
    } else {
        (n - r, r - c, c)
    };
    [a, b, c].map(|w| w as f32 / n as f32)
}

/// Row and column of a point of a grid from its number: rows have one, two, three points.
fn point_of(i: u32) -> (u32, u32) {
    let first = |row: u32| row * (row + 1) / 2;
    let mut row = (((8.0 * f64::from(i) + 1.0).sqrt() - 1.0) / 2.0) as u32;
    if first(row + 1) <= i {
        row += 1;
    }
    if first(row) > i {
        row -= 1;
    }
    (row, i - first(row))
}

/// The corners of a grid's triangle, as numbers of points: rows have one, three, five triangles, every other
/// one of them upside down.
fn corners_of(i: u32) -> [u32; 3] {
    let mut row = f64::from(i).sqrt() as u32;
    if (row + 1) * (row + 1) <= i {
        row += 1;
    }
    if row * row > i {
        row -= 1;
    }
    let k = i - row * row;
    let (above, below) = (row * (row + 1) / 2, (row + 1) * (row + 2) / 2);
    let c = k / 2;
    if k.is_multiple_of(2) {
        [above + c, below + c, below + c + 1]
    } else {
        [above + c, below + c + 1, above + c + 1]
    }
}

/// The point of a patch at these weights, on the base mesh.
fn base_point(corners: &[Vertex; 3], [a, b, c]: [f32; 3]) -> Vertex {
    let [p, q, r] = corners;
    let mix = |f: fn(&Vertex) -> Vec3| f(p) * a + f(q) * b + f(r) * c;
    let uv: Vec2 = p.uv * a + q.uv * b + r.uv * c;
    Vertex {
        position: mix(|v| v.position),
        normal: mix(|v| v.normal).normalize_or(p.normal),
        tangent: mix(|v| v.tangent.truncate()).normalize_or(p.tangent.truncate()).extend(p.tangent.w),
        uv,
    }
}

/// The triangles of a plan, displaced, as seen from an eye whose pixels are `pixel` wide at distance 1.
#[must_use]
pub fn expand(mesh: &Mesh, displacement: &Displacement, plan: &Plan, rays: &Rays) -> Mesh {
    let pixel = rays.right.length();
    let displaced = |base: Vertex| {
        let width = HEIGHT_PIXELS * pixel * base.position.as_dvec3().distance(rays.eye);
        let height = displacement.height(base.uv.as_dvec2(), width);
        Vertex { position: base.position + base.normal * height as f32, ..base }
    };
    grown(mesh, plan, displaced)
}

/// The triangles of a plan, each point as `place` has it.
fn grown(mesh: &Mesh, plan: &Plan, place: impl Fn(Vertex) -> Vertex + Sync) -> Mesh {
    let points = |patch: &Patch| {
        let t = mesh.triangles[patch.triangle as usize];
        let corners = t.map(|i| mesh.vertices[i as usize]);
        let stretches = t.map(|i| mesh.stretches.get(i as usize).copied().unwrap_or(Mat2::IDENTITY));
        let count = (patch.segments + 1) * (patch.segments + 2) / 2;
        let point = |i: u32| {
            let (r, c) = point_of(i);
            let w = weights(patch, r, c);
            let stretch = stretches[0] * w[0] + stretches[1] * w[1] + stretches[2] * w[2];
            (place(base_point(&corners, w)), stretch)
        };
        (0..count).map(point).collect::<Vec<_>>()
    };
    let triangles = |patch: &Patch| {
        let first = patch.first_point;
        (0..patch.segments * patch.segments).map(|i| corners_of(i).map(|k| first + k)).collect::<Vec<_>>()
    };
    let (vertices, stretches) = plan.patches.par_iter().flat_map_iter(points).unzip();
    let triangles = plan.patches.par_iter().flat_map_iter(triangles).collect();
    Mesh { vertices, triangles, stretches }
}

/// Cuts triangles that reach over more than a texture width, so that no patch need be cut finer near the eye
/// than it can be.
pub(super) fn split(mesh: &Mesh) -> Mesh {
    let longest = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.vertices[i as usize].uv);
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    };
    let most = mesh.triangles.iter().map(longest).fold(0.0, f32::max);
    // A million triangles are enough.
    let affordable = ((1 << 20) as f32 / mesh.triangles.len().max(1) as f32).sqrt().max(1.0);
    // An even number of them for all, so that edges keep what is on both sides.
    let wanted = (2.0 * most).min(affordable).clamp(1.0, MOST_SEGMENTS as f32) as u32;
    let segments = if wanted.is_power_of_two() { wanted } else { wanted.next_power_of_two() / 2 };
    if segments == 1 {
        return mesh.clone();
    }
    let mut plan = Plan::default();
    (0..mesh.triangles.len()).for_each(|t| plan.push(t, [segments; 3]));
    grown(mesh, &plan, |v| v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, SceneOptions};
    use std::collections::HashMap;

    #[test]
    fn grids_are_whole() {
        // Every point once, and every triangle's corners next to each other, counter-clockwise.
        let patch =
            |segments, edges| Patch { triangle: 0, segments, edges, first_point: 0, first_triangle: 0 };
        for n in [1, 2, 8, 64, 512] {
            let patch = patch(n, [n; 3]);
            let place = |i: u32| {
                let (r, c) = point_of(i);
                assert!(c <= r && r <= n);
                let [_, b, c] = weights(&patch, r, c);
                Vec2::new(b, c)
            };
            let area: f32 = (0..n * n)
                .map(|i| {
                    let [a, b, c] = corners_of(i).map(place);
                    let area = (b - a).perp_dot(c - a) * (n * n) as f32;
                    assert!((area - 1.0).abs() < 1e-3, "{n} {i} {area}");
                    area
                })
                .sum();
            assert!((area / (n * n) as f32 - 1.0).abs() < 1e-3);
        }
    }

    /// Sphere-like scenes have no open edges: each edge of the displaced mesh must have its opposite, by
    /// position.
    #[test]
    fn there_are_no_cracks() {
        let staging = SceneOptions::default();
        let mut scene = (crate::find("sphere").unwrap().build)(&staging);
        scene.displace(1.0, false).unwrap();
        let size = Size { width: 1000, height: 1000 };
        // Near one side, so that patches differ as much as they can; all of it in view.
        let camera = Camera::new([0.0, 0.3, 1.4], [0.0, 0.0, 0.0], 120.0);
        let (mesh, displacement) =
            (&scene.objects[0].mesh, scene.materials[0].displacement.as_ref().unwrap());
        let rays = camera.rays(size);
        let plan = plan(mesh, displacement, &rays, size);
        let mut counts: Vec<u32> = plan.patches.iter().map(|p| p.segments).collect();
        counts.sort_unstable();
        counts.dedup();
        assert!(counts.len() > 2, "{counts:?}");
        let displaced = expand(mesh, displacement, &plan, &rays);
        // The seam's heights are those of the first and the last column mixed, alike but for a last digit.
        let key = |i: u32| (displaced.vertices[i as usize].position * 1e4).round().as_ivec3().to_array();
        let mut edges: HashMap<([i32; 3], [i32; 3]), i32> = HashMap::new();
        for t in &displaced.triangles {
            for k in 0..3 {
                let (a, b) = (key(t[k]), key(t[(k + 1) % 3]));
                if a < b {
                    *edges.entry((a, b)).or_default() += 1;
                } else if b < a {
                    *edges.entry((b, a)).or_default() -= 1;
                }
            }
        }
        let open = edges.values().filter(|n| **n != 0).count();
        assert_eq!(open, 0, "of {}", edges.len());
    }

    #[test]
    fn triangles_are_bounded_by_pixels_not_by_the_map() {
        let size = Size { width: 300, height: 300 };
        let count = |map: usize, time: f64| {
            let staging =
                SceneOptions { time, map_size: Size { width: map, height: map }, ..SceneOptions::default() };
            let mut scene = (crate::find("armour").unwrap().build)(&staging);
            scene.displace(1.0, false).unwrap();
            let displacement = scene.materials[0].displacement.as_ref().unwrap();
            plan(&scene.objects[0].mesh, displacement, &scene.camera.rays(size), size).triangles
        };
        // The near view fills the picture: twice its pixels over four are the front and the back,
        // foreshortened on the way round.
        assert!(count(512, 0.0) < 300 * 300, "{}", count(512, 0.0));
        assert_eq!(count(512, 0.0), count(1024, 0.0));
        // From afar only the base mesh is left.
        let base = 2 * 96 * 96;
        assert!(count(512, 1.0) < 2 * base, "{}", count(512, 1.0));
    }
}
