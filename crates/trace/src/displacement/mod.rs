//! Displaced meshes as they are: the facets of the surface between the heights of their maps, of which none
//! is in memory.
//!
//! A triangle of the base mesh is cut into facets half a texel wide, displaced along its interpolated
//! normals. Memory holds boxes around groups of facets; a ray that enters one goes down to its facets by
//! quarters, whose boxes come from the least and the greatest heights under them.

mod extremes;

use std::sync::Arc;
use std::time::Duration;

use glam::{DVec2, DVec3};
use ndfmap_scene::{Displacement as Heights, Mesh, Scene, Vertex};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

use self::extremes::Extremes;
use crate::geometry::intersect;

/// Facets along a texel.
const FACETS_PER_TEXEL: f64 = 2.0;

/// Most facets along the side of a base triangle.
const MOST_CUTS: u16 = 1 << 12;

/// Fewest facets along the side of a group.
const LEAST_GROUP: u16 = 4;

/// Most groups, but for one a base triangle: some 200 MB of boxes and hierarchy.
const MOST_GROUPS: usize = 1 << 21;

/// Meshes of a scene that are displaced, ready to be hit.
pub struct DisplacedMeshes {
    pieces: Vec<Piece>,
    groups: Vec<Group>,
    hierarchy: Option<CwBvh>,
    /// Middle of the scene, to which rays and boxes are relative, as in `geometry.rs`.
    middle: DVec3,
    radius: f64,
    facets: u64,
}

/// Mesh with its heights and their bounds.
struct Piece {
    mesh: Arc<Mesh>,
    heights: Heights,
    extremes: Arc<Extremes>,
    material: usize,
}

/// Facets that share a box.
#[derive(Clone, Copy)]
struct Group {
    piece: u32,
    triangle: u32,
    /// Facets along the side of the triangle.
    cuts: u16,
    node: Node,
}

/// Part of a base triangle: with the second and third corner's weights in units of a cut, the corner (b, c),
/// and `side` on from it on both axes, or back where that is negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Node {
    b: u16,
    c: u16,
    side: i16,
}

impl Node {
    fn corners(self) -> [(u16, u16); 3] {
        let Self { b, c, side } = self;
        let on = |t: u16| t.wrapping_add_signed(side);
        [(b, c), (on(b), c), (b, on(c))]
    }

    /// The four quarters of a part of more than one facet.
    fn quarters(self) -> [Self; 4] {
        let Self { b, c, side } = self;
        let half = side / 2;
        let on = |t: u16| t.wrapping_add_signed(half);
        [
            Self { b, c, side: half },
            Self { b: on(b), c, side: half },
            Self { b, c: on(c), side: half },
            Self { b: on(b), c: on(c), side: -half },
        ]
    }
}

/// A facet that was hit.
#[derive(Clone, Copy, Debug)]
pub struct FacetHit {
    group: u32,
    node: Node,
    /// Distance along the unit direction of the ray.
    pub distance: f64,
    barycentric: DVec2,
}

/// The place of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Position in the world.
    pub position: DVec3,
    /// Unit normal, towards the eye.
    pub normal: DVec3,
    /// Place on the map, v down the rows.
    pub uv: DVec2,
    /// Index into the scene's materials.
    pub material: usize,
}

/// A base triangle, and how it is displaced.
struct Base<'a> {
    corners: [Vertex; 3],
    heights: &'a Heights,
    cuts: f64,
}

impl Base<'_> {
    /// The base surface at a point: place, normal of at most unit length, place on the map.
    fn at(&self, (b, c): (u16, u16)) -> (DVec3, DVec3, DVec2) {
        let [p, q, r] = &self.corners;
        let (s, t) = (f64::from(b) / self.cuts, f64::from(c) / self.cuts);
        let first = 1.0 - s - t;
        let mix = |f: fn(&Vertex) -> DVec3| f(p) * first + f(q) * s + f(r) * t;
        let uv = p.uv.as_dvec2() * first + q.uv.as_dvec2() * s + r.uv.as_dvec2() * t;
        (mix(|v| v.position.as_dvec3()), mix(|v| v.normal.as_dvec3()), uv)
    }

    /// The displaced point.
    fn displaced(&self, at: (u16, u16)) -> DVec3 {
        let (place, normal, uv) = self.at(at);
        place + normal.normalize_or_zero() * self.heights.finest(uv)
    }

    /// The nearest facet of a part of at most [`LEAST_GROUP`] on a side that a ray hits nearer than `limit`.
    fn hit(&self, node: Node, (origin, direction): (DVec3, DVec3), limit: f64) -> Option<(Node, f64, DVec2)> {
        const ROW: usize = LEAST_GROUP as usize + 1;
        let (side, step) = (node.side.unsigned_abs(), node.side.signum());
        let on = |t: u16, k: u16| t.wrapping_add_signed(step * k as i16);
        // Points relative to the eye; each is a corner of up to six facets.
        let mut points = [[DVec3::ZERO; ROW]; ROW];
        for j in 0..=side {
            for i in 0..=side - j {
                points[usize::from(j)][usize::from(i)] =
                    self.displaced((on(node.b, i), on(node.c, j))) - origin;
            }
        }
        let mut nearest = None;
        let mut best = limit;
        let mut test = |corners: [DVec3; 3], facet: Node| {
            if let Some((distance, barycentric)) = intersect(corners, DVec3::ZERO, direction)
                && distance < best
            {
                best = distance;
                nearest = Some((facet, distance, barycentric));
            }
        };
        for j in 0..side {
            for i in 0..side - j {
                let point = |i: u16, j: u16| points[usize::from(j)][usize::from(i)];
                let (b, c) = (on(node.b, i), on(node.c, j));
                test([point(i, j), point(i + 1, j), point(i, j + 1)], Node { b, c, side: step });
                if i + j + 1 < side {
                    let opposite = Node { b: on(b, 1), c: on(c, 1), side: -step };
                    test([point(i + 1, j + 1), point(i, j + 1), point(i + 1, j)], opposite);
                }
            }
        }
        nearest
    }

    /// A box around part of the triangle, relative to `middle`.
    fn bounds(&self, node: Node, extremes: &Extremes, middle: DVec3) -> (DVec3, DVec3) {
        let corners = node.corners().map(|at| self.at(at));
        let low = corners.iter().fold(DVec2::INFINITY, |low, c| low.min(c.2));
        let high = corners.iter().fold(DVec2::NEG_INFINITY, |high, c| high.max(c.2));
        let [least, greatest] = extremes.between(low, high).map(|h| h * self.heights.depth);
        let (least, greatest) = (least.min(greatest), least.max(greatest));
        // Normals mixed between corners are shorter than one, and then made as long as one: along the mixed
        // ones, heights are greater.
        let mean = (corners[0].1 + corners[1].1 + corners[2].1).normalize_or_zero();
        let shortest = corners.iter().fold(1.0, |least: f64, c| least.min(c.1.dot(mean))).max(0.05);
        let lengths = [
            if least < 0.0 { least / shortest } else { least },
            greatest.max(0.0) / shortest + greatest.min(0.0),
        ];
        let mut bounds = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (place, normal, _) in corners {
            for length in lengths {
                let point = place + normal * length - middle;
                bounds = (bounds.0.min(point), bounds.1.max(point));
            }
        }
        bounds
    }
}

impl DisplacedMeshes {
    /// Puts boxes around the displaced meshes of a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let mut shared: Vec<Option<Arc<Extremes>>> = vec![None; scene.materials.len()];
        let mut pieces = Vec::new();
        for object in &scene.objects {
            let Some(heights) = &scene.materials[object.material].displacement else { continue };
            let extremes = shared[object.material]
                .get_or_insert_with(|| Arc::new(Extremes::new(&heights.heights)))
                .clone();
            let (mesh, heights) = (object.mesh.clone(), heights.clone());
            pieces.push(Piece { mesh, heights, extremes, material: object.material });
        }
        let cuts: Vec<Vec<u16>> = pieces.iter().map(Piece::cuts).collect();
        let all = || cuts.iter().flatten().map(|n| u64::from(*n));
        let facets = all().map(|n| n * n).sum();
        let mut side = LEAST_GROUP;
        while all().map(|n| (n / u64::from(side)).max(1).pow(2)).sum::<u64>() > MOST_GROUPS as u64
            && side < MOST_CUTS
        {
            side *= 2;
        }
        let mut groups = Vec::new();
        for (piece, cuts) in cuts.iter().enumerate() {
            for (triangle, cuts) in cuts.iter().enumerate() {
                let group =
                    |node| Group { piece: piece as u32, triangle: triangle as u32, cuts: *cuts, node };
                let mut whole = vec![Node { b: 0, c: 0, side: *cuts as i16 }];
                while let Some(node) = whole.pop() {
                    if node.side.unsigned_abs() <= side {
                        groups.push(group(node));
                    } else {
                        whole.extend(node.quarters());
                    }
                }
            }
        }
        let (middle, radius) = scene.bounds();
        let margin = 4.0 * f64::from(f32::EPSILON) * radius;
        let around = |group: &Group| {
            let piece = &pieces[group.piece as usize];
            let (low, high) = piece.base(group).bounds(group.node, &piece.extremes, middle);
            Aabb::new((low - margin).as_vec3a(), (high + margin).as_vec3a())
        };
        let boxes: Vec<Aabb> = groups.par_iter().map(around).collect();
        let build = || build_cwbvh(&boxes, BvhBuildParams::fast_build(), &mut Duration::default());
        let hierarchy = (!boxes.is_empty()).then(build);
        Self { pieces, groups, hierarchy, middle, radius, facets }
    }

    /// Radius of a sphere around the scene.
    pub(crate) fn radius(&self) -> f64 {
        self.radius
    }

    /// Number of facets.
    #[must_use]
    pub fn facets(&self) -> u64 {
        self.facets
    }

    /// Bytes of memory: groups, hierarchy, and heights with their extremes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let hierarchy = self.hierarchy.as_ref().map_or(0, |h| {
            std::mem::size_of_val(h.nodes.as_slice()) + std::mem::size_of_val(h.primitive_indices.as_slice())
        });
        let mut seen: Vec<*const Extremes> = Vec::new();
        let mut maps = 0;
        for piece in &self.pieces {
            let extremes = Arc::as_ptr(&piece.extremes);
            if !seen.contains(&extremes) {
                seen.push(extremes);
                // Heights are in four channels, with a third more for their levels.
                maps += piece.extremes.bytes() + piece.heights.heights_size().area() * 16 * 4 / 3;
            }
        }
        hierarchy + std::mem::size_of_val(self.groups.as_slice()) + maps
    }

    /// The nearest facet along a ray of unit direction, from either side, nearer than `limit`.
    #[must_use]
    pub fn hit(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<FacetHit> {
        let hierarchy = self.hierarchy.as_ref()?;
        let from = origin - self.middle;
        let skipped = (from.length() - 1.01 * self.radius).max(0.0);
        let ray = Ray::new_inf((from + direction * skipped).as_vec3a(), direction.as_vec3a());
        let mut nearest: Option<FacetHit> = None;
        let inverse = direction.recip();
        hierarchy.ray_traverse(ray, &mut RayHit::none(), |_, i| {
            let number = hierarchy.primitive_indices[i];
            let group = &self.groups[number as usize];
            let piece = &self.pieces[group.piece as usize];
            let base = piece.base(group);
            let mut best = nearest.map_or(limit, |n| n.distance);
            let mut found = false;
            let mut parts = [group.node; 40];
            let mut count = 1;
            while count > 0 {
                count -= 1;
                let node = parts[count];
                if node.side.unsigned_abs() <= LEAST_GROUP {
                    if let Some((facet, distance, barycentric)) = base.hit(node, (origin, direction), best) {
                        best = distance;
                        found = true;
                        nearest = Some(FacetHit { group: number, node: facet, distance, barycentric });
                    }
                    continue;
                }
                // The box of a whole group has been entered already.
                if node != group.node {
                    let (low, high) = base.bounds(node, &piece.extremes, origin);
                    let (a, b) = (low * inverse, high * inverse);
                    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                    let slack = 1e-9 * self.radius;
                    if enter > leave + slack || leave < -slack || enter > best {
                        continue;
                    }
                }
                for quarter in node.quarters() {
                    parts[count] = quarter;
                    count += 1;
                }
            }
            if found { (best - skipped) as f32 } else { f32::INFINITY }
        });
        nearest
    }

    /// Place that a ray of this direction hit.
    #[must_use]
    pub fn facet(&self, hit: &FacetHit, direction: DVec3) -> Facet {
        let group = &self.groups[hit.group as usize];
        let piece = &self.pieces[group.piece as usize];
        let base = piece.base(group);
        let at = hit.node.corners();
        let [a, b, c] = at.map(|at| base.displaced(at));
        let [p, q, r] = at.map(|at| base.at(at).2);
        let DVec2 { x: s, y: t } = hit.barycentric;
        let first = 1.0 - s - t;
        let normal = (b - a).cross(c - a).normalize_or(-direction);
        Facet {
            position: a * first + b * s + c * t,
            normal: if normal.dot(direction) > 0.0 { -normal } else { normal },
            uv: p * first + q * s + r * t,
            material: piece.material,
        }
    }
}

impl Piece {
    /// Facets along the side of each triangle.
    fn cuts(&self) -> Vec<u16> {
        let finest = self.heights.heights_size();
        let texels = DVec2::new(finest.width as f64, finest.height as f64);
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.mesh.vertices[i as usize].uv.as_dvec2() * texels);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let wanted = (longest * FACETS_PER_TEXEL / std::f64::consts::SQRT_2)
                .ceil()
                .clamp(1.0, f64::from(MOST_CUTS));
            (wanted as u16).next_power_of_two()
        };
        self.mesh.triangles.iter().map(of).collect()
    }

    fn base(&self, group: &Group) -> Base<'_> {
        let t = self.mesh.triangles[group.triangle as usize];
        Base {
            corners: t.map(|i| self.mesh.vertices[i as usize]),
            heights: &self.heights,
            cuts: f64::from(group.cuts),
        }
    }
}
