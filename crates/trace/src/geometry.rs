//! Geometry that rays hit: all triangles of a scene in one hierarchy, and the places of hits.

use std::time::Duration;

use glam::{DMat2, DMat3, DVec2, DVec3, Mat2, Vec3A};
use ndfmap_core::grid::Size;
use ndfmap_scene::{Camera, Mesh, Object, Rays, Scene, Vertex};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::ray::{Ray, RayHit};

/// Triangles of a scene, ready to be hit.
pub struct Geometry {
    /// Corners, object, in the order of the scene.
    triangles: Vec<Triangle>,
    /// Matrices that take slopes of maps to the surface, at each triangle's corners; none in a scene
    /// without displacement.
    stretches: Vec<[Mat2; 3]>,
    /// `None` for a scene without triangles.
    hierarchy: Option<CwBvh>,
    /// Middle of a sphere around everything. Boxes are in single floats, so they and the rays are relative to
    /// it, and rays begin where they enter the sphere: no digits are lost to the distance of the scene from
    /// the origin, or of the eye from the scene.
    middle: DVec3,
    radius: f64,
}

struct Triangle {
    corners: [Vertex; 3],
    object: u32,
    material: u32,
}

/// A hit: triangle and where in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    triangle: u32,
    /// Distance along the unit direction of the ray.
    pub distance: f64,
    /// Weights of the second and third corner.
    barycentric: DVec2,
}

/// The place of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Position in the world.
    pub position: DVec3,
    /// Tangent, bitangent and normal of the base surface, orthonormal, as columns; the normal faces the eye.
    pub frame: DMat3,
    /// Unit normal of the triangle itself, towards the eye.
    pub face: DVec3,
    /// Place on the map, v down the rows.
    pub uv: DVec2,
    /// Index into the scene's materials.
    pub material: usize,
    /// Index into the scene's objects.
    pub object: usize,
    /// Matrix that takes slopes of the map to the frame, on a displaced mesh.
    pub stretch: Option<DMat2>,
}

impl Geometry {
    /// Builds the hierarchy. Displaced meshes stay where they were; their places still say how slopes lie on
    /// them, as bump maps want.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        Self::of(scene, &scene.objects)
    }

    /// Builds it with meshes cut and displaced for a picture of this size.
    #[must_use]
    pub fn displaced(scene: &Scene, camera: &Camera, size: Size) -> Self {
        Self::of(scene, &scene.displaced_for(camera, size))
    }

    /// Builds it from only the meshes that are not displaced.
    #[must_use]
    pub fn without_displacement(scene: &Scene) -> Self {
        let bare = |o: &Object| match scene.materials[o.material].displacement {
            Some(_) => Object { mesh: Mesh::default().into(), ..o.clone() },
            None => o.clone(),
        };
        Self::of(scene, &scene.objects.iter().map(bare).collect::<Vec<_>>())
    }

    fn of(scene: &Scene, objects: &[Object]) -> Self {
        let (mut triangles, mut stretches) = (Vec::new(), Vec::new());
        let displacement = scene.is_displaced();
        for (object, o) in objects.iter().enumerate() {
            if displacement {
                let at = |i: u32| o.mesh.stretches.get(i as usize).copied().unwrap_or(Mat2::NAN);
                stretches.extend(o.mesh.triangles.iter().map(|t| t.map(at)));
            }
            let of = |t: &[u32; 3]| Triangle {
                corners: t.map(|i| o.mesh.vertices[i as usize]),
                object: object as u32,
                material: o.material as u32,
            };
            triangles.extend(o.mesh.triangles.iter().map(of));
        }
        let (middle, radius) = scene.bounds();
        // Some steps of a single float at the sphere's radius, for what rays and boxes lose by rounding.
        let margin = Vec3A::splat((4.0 * f64::from(f32::EPSILON) * radius) as f32);
        let around = |t: &Triangle| {
            let corners = t.corners.map(|c| (c.position.as_dvec3() - middle).as_vec3a());
            let Aabb { min, max } = Aabb::from_points(&corners);
            Aabb::new(min - margin, max + margin)
        };
        let boxes: Vec<Aabb> = triangles.iter().map(around).collect();
        let build = || build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut Duration::default());
        let hierarchy = (!boxes.is_empty()).then(build);
        Self { triangles, stretches, hierarchy, middle, radius }
    }

    /// Number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// True for a scene without triangles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The nearest triangle along a ray of unit direction, from either side.
    #[must_use]
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        let hierarchy = self.hierarchy.as_ref()?;
        let from = origin - self.middle;
        let skipped = (from.length() - 1.01 * self.radius).max(0.0);
        let ray = Ray::new_inf((from + direction * skipped).as_vec3a(), direction.as_vec3a());
        let mut nearest: Option<Hit> = None;
        hierarchy.ray_traverse(ray, &mut RayHit::none(), |_, i| {
            let triangle = hierarchy.primitive_indices[i];
            let corners = self.triangles[triangle as usize].corners.map(|c| c.position.as_dvec3());
            match intersect(corners, origin, direction) {
                Some((distance, barycentric)) => {
                    if nearest.is_none_or(|n| distance < n.distance) {
                        nearest = Some(Hit { triangle, distance, barycentric });
                    }
                    (distance - skipped) as f32
                }
                None => f32::INFINITY,
            }
        });
        nearest
    }

    /// Place that a ray of this direction hit.
    ///
    /// Seen from behind, a surface shows its back, frame turned about the tangent. Where the normal between
    /// corners has turned away from an eye that the triangle itself faces, it is bent back until it just does
    /// not: else there would be holes. Not so where `unbent`: displaced facets may be seen where the base
    /// mesh is not.
    #[must_use]
    pub fn place(&self, hit: &Hit, direction: DVec3, unbent: bool) -> Place {
        let Triangle { corners: [a, b, c], object, material } = &self.triangles[hit.triangle as usize];
        let DVec2 { x: s, y: t } = hit.barycentric;
        let r = 1.0 - s - t;
        let mix = |f: fn(&Vertex) -> DVec3| f(a) * r + f(b) * s + f(c) * t;
        let face = face(&[*a, *b, *c]);
        let side = if face.dot(direction) > 0.0 { -1.0 } else { 1.0 };
        let face = face * side;
        let normal = mix(|v| v.normal.as_dvec3()).normalize_or(face) * side;
        let facing = -normal.dot(direction);
        let stretch = self.stretches.get(hit.triangle as usize).map(|[p, q, u]| {
            let stretch = (*p).as_dmat2() * r + (*q).as_dmat2() * s + (*u).as_dmat2() * t;
            // From behind, a displacement that stands out goes in, along the turned frame: only the slope
            // along the tangent changes its sign.
            DMat2::from_diagonal(DVec2::new(side, 1.0)) * stretch
        });
        let stretch = stretch.filter(|stretch| stretch.is_finite());
        let normal = if facing < LEAST_FACING && !(unbent && stretch.is_some()) {
            (normal - direction * (LEAST_FACING - facing)).normalize()
        } else {
            normal
        };
        let tangent = mix(|v| v.tangent.truncate().as_dvec3()).reject_from_normalized(normal);
        let tangent = tangent.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        let bitangent = normal.cross(tangent) * f64::from(a.tangent.w);
        let uv = a.uv.as_dvec2() * r + b.uv.as_dvec2() * s + c.uv.as_dvec2() * t;
        Place {
            position: mix(|v| v.position.as_dvec3()),
            frame: DMat3::from_cols(tangent, bitangent, normal),
            face,
            uv,
            material: *material as usize,
            object: *object as usize,
            stretch,
        }
    }

    /// Movements of the place on the map as the pixel moves one to the right, and one down.
    #[must_use]
    pub fn differentials(&self, hit: &Hit, place: &Place, rays: &Rays, at: DVec2) -> [DVec2; 2] {
        let [a, b, c] = self.triangles[hit.triangle as usize].corners;
        let (p, q) = ((b.position - a.position).as_dvec3(), (c.position - a.position).as_dvec3());
        let (du, dv) = ((b.uv - a.uv).as_dvec2(), (c.uv - a.uv).as_dvec2());
        let normal = p.cross(q);
        let square = normal.length_squared().max(f64::MIN_POSITIVE);
        // A step in the triangle's plane, in the triangle's own two edges.
        rays.differentials(at, place.position, place.face).map(|step| {
            let (s, t) = (step.cross(q).dot(normal) / square, p.cross(step).dot(normal) / square);
            du * s + dv * t
        })
    }
}

/// Least cosine between a place's normal and the eye.
const LEAST_FACING: f64 = 1e-3;

/// Unit normal of a triangle; up for one without area.
fn face([a, b, c]: &[Vertex; 3]) -> DVec3 {
    (b.position - a.position).as_dvec3().cross((c.position - a.position).as_dvec3()).normalize_or(DVec3::Y)
}

/// Distance and the weights of the second and third corner (Möller and Trumbore 1997), in f64, where cracks
/// between triangles are too narrow to be found by chance.
pub(crate) fn intersect([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, DVec2)> {
    let (p, q) = (b - a, c - a);
    let across = direction.cross(q);
    let determinant = p.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - a;
    let s = from.dot(across) / determinant;
    if !(0.0..=1.0).contains(&s) {
        return None;
    }
    let up = from.cross(p);
    let t = direction.dot(up) / determinant;
    let distance = q.dot(up) / determinant;
    (t >= 0.0 && s + t <= 1.0 && distance > 0.0).then_some((distance, DVec2::new(s, t)))
}
