//! Olano and North, figure 2: a smooth object in few and in many polygons, and a map that makes up for it.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use ndfmap::Error;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::surface::{NormalGrid, Surface, Wrap, Wraps};
use ndfmap::draw::{Panel, Sheet, SheetRow};
use ndfmap::scene::metrics::Picture;
use ndfmap::scene::{MaterialMap, Mesh, Object, Scene, Vertex};

use super::texels::lobe;
use crate::shot::{Maps, Shot, scene, shown};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "olano-2",
    paper: Paper::Olano,
    place: "Figure 2",
    summary: "a vase in few and in many polygons, without a map and with one that makes up for the polygons",
    draw,
};

/// Cells of the meshes around and from pole to pole, and the names of the columns.
const MESHES: [(&str, (usize, usize)); 2] = [("8 × 4 cells", (8, 4)), ("64 × 32 cells", (64, 32))];

/// Cells of the mesh that passes for the smooth object, with the object's own normals.
const SMOOTH: (usize, usize) = (512, 256);

/// The object: a vase, round about, of a profile that bulges and narrows.
fn vase(s: f64, t: f64) -> DVec3 {
    let (sin, cos) = (TAU * s).sin_cos();
    let radius = (PI * t).sin().max(0.0).sqrt() * (0.62 + 0.3 * (TAU * 1.1 * t + 0.4).cos());
    DVec3::new(-radius * cos, 1.9 * (t - 0.5), radius * sin)
}

/// Part of the profile that the meshes have, short of its poles.
const PART: [f64; 2] = [0.06, 0.94];

/// The object over the unit square.
fn object(s: f64, t: f64) -> DVec3 {
    vase(s + 0.25, PART[0] + (PART[1] - PART[0]) * t)
}

/// Derivatives of the object along s and t.
fn along(s: f64, t: f64) -> [DVec3; 2] {
    let h = 1e-5;
    [(object(s + h, t) - object(s - h, t)) / (2.0 * h), (object(s, t + h) - object(s, t - h)) / (2.0 * h)]
}

/// Normal of the object where the line from `place` along `normal` meets it, by Newton's method from `(s,
/// t)`.
fn met(place: DVec3, normal: DVec3, (mut s, mut t): (f64, f64)) -> DVec3 {
    let mut far = 0.0;
    for _ in 0..8 {
        let [ds, dt] = along(s, t);
        let step = DMat3::from_cols(ds, dt, -normal).inverse() * (object(s, t) - place - far * normal);
        if !step.is_finite() {
            break;
        }
        (s, t, far) = (s - step.x, (t - step.y).clamp(-0.05, 1.05), far - step.z);
    }
    let [ds, dt] = along(s, t);
    ds.cross(dt).normalize_or(normal)
}

/// A mesh whose triangles have corners of their own, with the normals of their own planes.
fn faceted(mesh: &Mesh) -> Mesh {
    let mut facets = Mesh::default();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.vertices[i as usize]);
        let [a, b, c] = corners.map(|v| v.position);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let middle = corners.iter().map(|v| v.tangent.truncate()).sum::<Vec3>();
        let tangent = middle.reject_from(normal).normalize_or(normal.any_orthonormal_vector());
        let first = facets.vertices.len() as u32;
        facets.vertices.extend(corners.map(|v| Vertex { normal, tangent: tangent.extend(1.0), ..v }));
        facets.triangles.push([first, first + 1, first + 2]);
    }
    facets
}

/// Normals of the object above each place of a mesh of it, in frames interpolated between the mesh's corners.
fn made_up_for(mesh: &Mesh, size: Size) -> NormalGrid {
    let mut normals = Grid::from_fn(size, |_, _| Vec3::Z);
    let scale = Vec2::new(size.width as f32, size.height as f32);
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.vertices[i as usize]);
        let [p, q, r] = corners.map(|v| v.uv * scale);
        let area = (q - p).perp_dot(r - p);
        if area == 0.0 {
            continue;
        }
        let (low, high) = (p.min(q).min(r).floor(), p.max(q).max(r).ceil());
        for y in low.y.max(0.0) as usize..(high.y as usize).min(size.height) {
            for x in low.x.max(0.0) as usize..(high.x as usize).min(size.width) {
                let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let weights = [(q, r), (r, p), (p, q)].map(|(a, b)| (a - at).perp_dot(b - at) / area);
                if weights.iter().any(|w| *w < -1e-4) {
                    continue;
                }
                let mixed = |of: fn(&Vertex) -> Vec3| -> Vec3 {
                    corners.iter().zip(weights).map(|(v, w)| of(v) * w).sum()
                };
                let normal = mixed(|v| v.normal).normalize_or(Vec3::Z);
                let tangent = mixed(|v| v.tangent.truncate()).reject_from(normal).normalize_or(Vec3::X);
                let place = mixed(|v| v.position).as_dvec3();
                let at = (f64::from(at.x / scale.x), 1.0 - f64::from(at.y / scale.y));
                let round = met(place, normal.as_dvec3(), at).as_vec3();
                let local = [tangent, normal.cross(tangent), normal].map(|axis| round.dot(axis));
                normals.row_mut(y)[x] = Vec3::from_array(local).normalize();
            }
        }
    }
    NormalGrid { normals, wraps: Wraps { x: Wrap::Repeat, y: Wrap::Clamp } }
}

/// Way of shading the polygons.
#[derive(Clone, Copy, PartialEq)]
enum Shading {
    /// By the normals of their planes.
    Planes,
    /// By normals interpolated between their corners.
    Interpolated,
    /// By a map of the object's normals.
    Mapped,
}

fn scene_of(plan: &Plan<'_>, cells: (usize, usize), shading: Shading) -> Result<Scene, Error> {
    let mut scene = scene("sphere", Size { width: 8, height: 8 }).build(0.0, plan.observer)?;
    let mesh = Mesh::from_patch(cells, DVec2::ONE, object);
    let mesh = if shading == Shading::Planes { faceted(&mesh) } else { mesh };
    let flat = NormalGrid {
        normals: Grid::from_fn(Size { width: 8, height: 8 }, |_, _| Vec3::Z),
        wraps: Wraps { x: Wrap::Repeat, y: Wrap::Clamp },
    };
    let map = if shading == Shading::Mapped { made_up_for(&mesh, plan.map(512)) } else { flat };
    scene.objects = vec![Object { mesh: mesh.into(), material: 0 }];
    scene.materials[0].map = MaterialMap::from(Arc::new(map) as Arc<dyn Surface>);
    scene.materials[0].brdf.lobe = lobe("blinn-phong:40");
    Ok(scene)
}

/// Relative L2 error over pixels that both pictures cover, neighbours and all: outlines are the polygons'
/// own.
fn inside(a: &Picture, truth: &Picture, background: Vec3) -> f64 {
    let Size { width, height } = truth.size();
    let (mut difference, mut norm) = (0.0, 0.0);
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let around = || (y - 1..=y + 1).flat_map(move |y| (x - 1..=x + 1).map(move |x| (x, y)));
            if around().all(|(x, y)| a.row(y)[x] != background && truth.row(y)[x] != background) {
                difference += f64::from((a.row(y)[x] - truth.row(y)[x]).length_squared());
                norm += f64::from(truth.row(y)[x].length_squared());
            }
        }
    }
    (difference / f64::max(norm, f64::MIN_POSITIVE)).sqrt()
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let size = plan.picture(320);
    let picture = |cells: (usize, usize), shading: Shading| -> Result<(Picture, Scene), Error> {
        let scene = scene_of(plan, cells, shading)?;
        let maps = Maps::bake(plan, &scene, &["ndm"])?;
        let mut pictures = Shot::new(plan, &scene, size).filtered(&maps)?;
        Ok((pictures.remove(0), scene))
    };
    let (smooth, scene) = picture(SMOOTH, Shading::Interpolated)?;
    let (mut rows, mut claims) = (Vec::new(), Vec::new());
    let ways = [
        ("normals of planes", Shading::Planes),
        ("interpolated normals", Shading::Interpolated),
        ("with the map", Shading::Mapped),
    ];
    let mut errors = [[0.0; MESHES.len()]; 3];
    for (way, (head, shading)) in ways.into_iter().enumerate() {
        let mut panels = Vec::new();
        for (at, (_, cells)) in MESHES.into_iter().enumerate() {
            let (drawn, _) = picture(cells, shading)?;
            errors[way][at] = inside(&drawn, &smooth, scene.background);
            let said = [format!("L2 {:.3} within the outline", errors[way][at])];
            panels.push(Some(Panel::of(shown(&drawn, scene.exposure)).said(said)));
        }
        if way == 0 {
            panels.push(Some(Panel::of(shown(&smooth, scene.exposure))));
        }
        rows.push(SheetRow { head: vec![head.to_owned()], panels });
    }
    for (at, (name, _)) in MESHES.into_iter().enumerate() {
        let [planes, interpolated, mapped] = errors.map(|of| of[at]);
        claims.push(Claim::number(format!("{name}: L2 error by normals of planes"), planes));
        claims.push(Claim::number(format!("{name}: L2 error by interpolated normals"), interpolated));
        let says = format!("{name}: L2 error with the map, below both");
        claims.push(Claim::number(says, mapped).holds(mapped < planes.min(interpolated)));
    }
    let columns = MESHES.iter().map(|(name, _)| (*name).to_owned()).chain(["smooth".to_owned()]).collect();
    Ok(Drawing {
        sheets: vec![Sheet {
            title: "A vase in few and in many polygons".to_owned(),
            columns,
            rows,
            scale: None,
        }],
        claims,
        why: "The map holds the object's normals in frames that are interpolated between corners, as renderers do. \
              Outlines stay those of the polygons and are left out of the errors; what is left is that a place on a \
              polygon lies below the object and is seen beside it.",
    })
}
