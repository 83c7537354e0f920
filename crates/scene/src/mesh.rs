//! Triangle meshes with tangent frames, and the shapes that built-in scenes are made of.

use glam::{DVec2, DVec3, Mat2, Vec2, Vec3, Vec4};

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Place.
    pub position: Vec3,
    /// Unit normal of the base surface.
    pub normal: Vec3,
    /// Unit vector along which `uv.x` grows; w is the sign in `bitangent = w normal × tangent`, which points
    /// *up* the picture, against `uv.y`.
    pub tangent: Vec4,
    /// Place on the map, v down the rows; beyond 0..1 the map's own wrap holds.
    pub uv: Vec2,
}

/// Triangles, counter-clockwise from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corners of the triangles.
    pub vertices: Vec<Vertex>,
    /// Indices of the three corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Matrices that take slopes of the map to a displaced mesh, one for each vertex; else none.
    pub stretches: Vec<Mat2>,
}

impl Mesh {
    /// A surface over the unit square, `columns × rows` cells of two triangles.
    ///
    /// `place(s, t)` goes from the map's lower left (0, 0) to its upper right, so that the outside is where s
    /// and t turn counter-clockwise. The map repeats `tiles` times. Frames come from differences along s and
    /// t.
    pub fn from_patch(
        (columns, rows): (usize, usize),
        tiles: DVec2,
        place: impl Fn(f64, f64) -> DVec3,
    ) -> Self {
        let step = 1e-4;
        let vertex = |i: usize, j: usize| {
            let (s, t) = (i as f64 / columns as f64, j as f64 / rows as f64);
            let along = |a: DVec2| place(s + a.x, t + a.y) - place(s - a.x, t - a.y);
            let (ds, dt) = (along(DVec2::new(step, 0.0)), along(DVec2::new(0.0, step)));
            let normal = ds.cross(dt).try_normalize().unwrap_or_else(|| {
                // At a pole one of the two differences vanishes: a little way off it does not.
                let (s, t) = (s.clamp(0.01, 0.99), t.clamp(0.01, 0.99));
                let ds = place(s + step, t) - place(s - step, t);
                let dt = place(s, t + step) - place(s, t - step);
                ds.cross(dt).normalize_or(DVec3::Y)
            });
            let tangent =
                ds.reject_from(normal).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
            let uv = DVec2::new(s, 1.0 - t) * tiles;
            Vertex {
                position: place(s, t).as_vec3(),
                normal: normal.as_vec3(),
                tangent: tangent.as_vec3().extend(1.0),
                uv: uv.as_vec2(),
            }
        };
        let corners = (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j)));
        let vertices = corners.map(|(i, j)| vertex(i, j)).collect();
        Self { vertices, triangles: grid_triangles(columns, rows), stretches: Vec::new() }
    }

    /// A tube around a curve; `path(t)` gives its middle and radius for t from 0 to 1, and the map runs
    /// around and along.
    pub fn from_tube(
        (around, along): (usize, usize),
        tiles: DVec2,
        path: impl Fn(f64) -> (DVec3, f64),
    ) -> Self {
        // Rings stand across the path, turned as little as possible from one to the next.
        let ahead = |t: f64| (path(t + 1e-3).0 - path(t - 1e-3).0).normalize_or(DVec3::X);
        let mut side = ahead(0.0).any_orthonormal_vector();
        let mut sides = Vec::with_capacity(along + 1);
        for j in 0..=along {
            let forward = ahead(j as f64 / along as f64);
            side = side.reject_from(forward).normalize_or(side);
            sides.push(side);
        }
        let side_at = |t: f64| {
            let at = (t * along as f64).clamp(0.0, along as f64);
            let (i, part) = (at as usize, at.fract());
            sides[i].lerp(sides[(i + 1).min(along)], part)
        };
        Self::from_patch((around, along), tiles, |s, t| {
            let (middle, radius) = path(t);
            let forward = ahead(t);
            let side = side_at(t).reject_from(forward).normalize_or(DVec3::X);
            let (sin, cos) = (std::f64::consts::TAU * s).sin_cos();
            middle + radius * (side * cos + forward.cross(side) * sin)
        })
    }

    /// Sets normals to the area-weighted mean of the triangles around each vertex, and tangents across them.
    pub fn smooth(&mut self) {
        let places: Vec<Vec3> = self.vertices.iter().map(|v| v.position).collect();
        let sums = area_normals(&places, &self.triangles);
        for (vertex, sum) in self.vertices.iter_mut().zip(sums) {
            vertex.normal = sum.try_normalize().unwrap_or(vertex.normal);
            let tangent = vertex.tangent.truncate().reject_from_normalized(vertex.normal);
            let tangent = tangent.try_normalize().unwrap_or_else(|| vertex.normal.any_orthonormal_vector());
            vertex.tangent = tangent.extend(vertex.tangent.w);
        }
    }
}

/// Sum of the normals of the triangles around each vertex, each as long as twice its triangle's area; not
/// normalised.
#[must_use]
pub fn area_normals(places: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; places.len()];
    for t in triangles {
        let [a, b, c] = t.map(|i| places[i as usize]);
        t.iter().for_each(|i| sums[*i as usize] += (b - a).cross(c - a));
    }
    sums
}

/// Two triangles for each cell of a grid of corners, rows of `columns + 1`.
pub(super) fn grid_triangles(columns: usize, rows: usize) -> Vec<[u32; 3]> {
    let at = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
    let cell = |(i, j): (usize, usize)| {
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        [[a, b, c], [a, c, d]]
    };
    (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))).flat_map(cell).collect()
}
