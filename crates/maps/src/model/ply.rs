//! PLY by the `ply-rs-bw` crate: shapes, and normals and map coordinates where there are any, of vertices or
//! of the corners of faces.
//!
//! The crate reads what the format's first description says. Scanners write more: the header is put in order
//! before it.

use std::borrow::Cow;
use std::path::Path;

use glam::{DVec2, DVec3, Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::corners::CornerMesh;
use super::{MAX_ELEMENTS, ModelFormat, Parts, RawMesh};
use crate::MapError;

pub(super) const FORMAT: ModelFormat = ModelFormat { name: "PLY", extensions: &["ply"], read };

/// Vertex of a file; NaN for numbers that it lacks.
struct PlyVertex {
    position: Vec3,
    normal: Vec3,
    /// Map coordinates, v up the picture.
    uv: Vec2,
}

impl PropertyAccess for PlyVertex {
    fn new() -> Self {
        Self { position: Vec3::NAN, normal: Vec3::NAN, uv: Vec2::NAN }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let place = match name {
            "x" => &mut self.position.x,
            "y" => &mut self.position.y,
            "z" => &mut self.position.z,
            "nx" => &mut self.normal.x,
            "ny" => &mut self.normal.y,
            "nz" => &mut self.normal.z,
            "s" | "u" | "texture_u" => &mut self.uv.x,
            "t" | "v" | "texture_v" => &mut self.uv.y,
            _ => return PropertyAccessResult::Ignored,
        };
        match property.to_f32_lossy() {
            Some(number) => *place = number,
            None => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Face or strip of a file.
#[derive(Default)]
struct PlyFace {
    /// Vertices; -1 ends a strip.
    vertices: Vec<i64>,
    /// Map coordinates of the corners, u and v in turn.
    uvs: Vec<f32>,
}

impl PropertyAccess for PlyFace {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "vertex_indices" | "vertex_index" => self.vertices = indices(&property),
            "texcoord" | "texcoords" => self.uvs = numbers(&property),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Element that is read over.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

fn read(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<Parts, MapError> {
    let bytes = tidied(bytes);
    let invalid = |e: ply_rs_bw::parser::ParseError| MapError::invalid(path, first_line(&e.to_string()));
    let mut reader = Reader::new(&*bytes);
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(invalid)?;
    // An element takes a byte at least, whatever the header says.
    if header.elements.iter().any(|(_, e)| e.count > bytes.len()) {
        return Err(MapError::invalid(path, "announces more elements than the file can hold"));
    }
    if header.elements.iter().any(|(_, e)| e.count > MAX_ELEMENTS) {
        return Err(MapError::unsupported(path, format!("has more than {MAX_ELEMENTS} vertices or faces")));
    }
    let (mut vertices, mut faces, mut strips) = (Vec::new(), Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        let faces_of = || Parser::<PlyFace>::new();
        match name.as_str() {
            "vertex" => {
                let parser = Parser::<PlyVertex>::new();
                vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(invalid)?;
            }
            "face" => {
                faces =
                    faces_of().read_payload_for_element(&mut reader, element, &header).map_err(invalid)?;
            }
            "tristrips" => {
                strips =
                    faces_of().read_payload_for_element(&mut reader, element, &header).map_err(invalid)?;
            }
            _ => {
                let parser = Parser::<Other>::new();
                parser.read_payload_for_element(&mut reader, element, &header).map_err(invalid)?;
            }
        }
    }
    if faces.is_empty() && strips.is_empty() && !vertices.is_empty() {
        return Err(MapError::unsupported(path, "is a cloud of points, which has no surface: mesh it first"));
    }
    let mut builder = Builder { path, vertices: &vertices, mesh: CornerMesh::default() };
    builder.mesh.positions = vertices.iter().map(|v| v.position).collect();
    let mapped = faces.iter().any(|face| !face.uvs.is_empty());
    faces.iter().try_for_each(|face| builder.face(face, mapped))?;
    strips.iter().try_for_each(|strip| builder.strip(strip))?;
    builder.finish(mapped, warnings).map(|mesh| Parts { meshes: vec![(mesh, 0)], materials: Vec::new() })
}

/// Mesh in the making.
struct Builder<'a> {
    path: &'a Path,
    vertices: &'a [PlyVertex],
    mesh: CornerMesh,
}

impl Builder<'_> {
    fn checked(&self, vertices: &[i64]) -> Result<Vec<u32>, MapError> {
        let there = |i: &i64| u32::try_from(*i).ok().filter(|i| (*i as usize) < self.vertices.len());
        let checked: Option<Vec<u32>> = vertices.iter().map(there).collect();
        checked.ok_or_else(|| MapError::invalid(self.path, "has a face of a vertex that is not there"))
    }

    /// Adds the triangles of a polygon, with map coordinates of its corners where the mesh has such.
    fn face(&mut self, face: &PlyFace, mapped: bool) -> Result<(), MapError> {
        let corners = self.checked(&face.vertices)?;
        let positions: Vec<Vec3> = corners.iter().map(|i| self.vertices[*i as usize].position).collect();
        for triangle in polygon(&positions) {
            self.mesh.triangles.push(triangle.map(|c| corners[c]));
            if mapped {
                let uv = |c: usize| match face.uvs.get(2 * c..2 * c + 2) {
                    Some(uv) => Vec2::new(uv[0], 1.0 - uv[1]),
                    None => Vec2::ZERO,
                };
                self.mesh.uvs.extend(triangle.map(uv));
            }
        }
        Ok(())
    }

    /// Adds the triangles of a strip; -1 starts a new one.
    fn strip(&mut self, strip: &PlyFace) -> Result<(), MapError> {
        for part in strip.vertices.split(|i| *i == -1) {
            let part = self.checked(part)?;
            self.mesh.triangles.extend(super::strip(&part));
        }
        Ok(())
    }

    fn finish(mut self, mapped: bool, warnings: &mut Vec<String>) -> Result<RawMesh, MapError> {
        let has_normals = self.vertices.iter().all(|v| v.normal.is_finite());
        if mapped && self.mesh.uvs.len() != 3 * self.mesh.triangles.len() {
            warnings.push("has strips beside faces with map coordinates: those are not read".to_owned());
            self.mesh.uvs.clear();
        }
        if self.mesh.uvs.is_empty() {
            let normals = match has_normals {
                true => self.vertices.iter().map(|v| v.normal).collect(),
                false => Vec::new(),
            };
            let has_uvs = self.vertices.iter().all(|v| v.uv.is_finite());
            let uvs = match has_uvs {
                true => self.vertices.iter().map(|v| Vec2::new(v.uv.x, 1.0 - v.uv.y)).collect(),
                false => Vec::new(),
            };
            let CornerMesh { positions, triangles, .. } = self.mesh;
            return Ok(RawMesh { positions, normals, uvs, triangles, ..RawMesh::default() });
        }
        if has_normals {
            let corners = self.mesh.triangles.iter().flatten();
            self.mesh.normals = corners.map(|i| self.vertices[*i as usize].normal).collect();
        } else {
            self.mesh.smooth();
        }
        Ok(self.mesh.weld())
    }
}

/// Triangles of a polygon, as indices of its corners; concave ones by cutting ears, seen along the normal.
fn polygon(positions: &[Vec3]) -> Vec<[usize; 3]> {
    match positions.len() {
        0..3 => return Vec::new(),
        3 => return vec![[0, 1, 2]],
        _ => {}
    }
    let positions: Vec<DVec3> = positions.iter().map(|p| p.as_dvec3()).collect();
    // Newell's normal: twice the areas of the polygon's shadows on the three planes.
    let next = positions.iter().cycle().skip(1);
    let normal: DVec3 = positions.iter().zip(next).map(|(a, b)| a.cross(*b)).sum();
    let fan = || (2..positions.len()).map(|i| [0, i - 1, i]).collect();
    let Some(normal) = normal.try_normalize() else { return fan() };
    let (right, up) = normal.any_orthonormal_pair();
    let plane = |p: &DVec3| DVec2::new(right.dot(*p), up.dot(*p)).to_array();
    let mut corners: Vec<usize> = Vec::new();
    earcut::Earcut::new().earcut(positions.iter().map(plane), &[] as &[usize], &mut corners);
    let cut: Vec<[usize; 3]> = corners.as_chunks().0.to_vec();
    // Ears come turned either way; the polygon tells which is right.
    let turned = |t: &[usize; 3]| {
        let [a, b, c] = t.map(|i| positions[i]);
        (b - a).cross(c - a).dot(normal)
    };
    let against = cut.iter().map(turned).sum::<f64>() < 0.0;
    cut.into_iter().map(|[a, b, c]| if against { [a, c, b] } else { [a, b, c] }).collect()
}

/// File as the crate can read it: lines that end with a line feed, begin with a word and are not
/// blank, single blanks between words, and nothing but ASCII in the header.
fn tidied(bytes: &[u8]) -> Cow<'_, [u8]> {
    const END: &[u8] = b"end_header";
    let Some(at) = bytes.windows(END.len()).position(|w| w == END) else { return Cow::Borrowed(bytes) };
    let breaks = |b: &u8| *b == b'\n' || *b == b'\r';
    let end = bytes[at..].iter().position(breaks).map_or(bytes.len(), |n| at + n);
    // A line ends with one byte, or with a carriage return and a line feed.
    let line_end = match bytes.get(end..) {
        Some([b'\r', b'\n', ..]) => end + 2,
        _ => (end + 1).min(bytes.len()),
    };
    let (header, payload) = bytes.split_at(line_end);
    let mut out = Vec::with_capacity(bytes.len());
    push_lines(&mut out, header);
    out.iter_mut().filter(|b| !b.is_ascii()).for_each(|b| *b = b'?');
    let ascii = out.split(|b| *b == b'\n').any(|line| line.starts_with(b"format ascii"));
    if ascii {
        push_lines(&mut out, payload);
    } else {
        out.extend(payload);
    }
    Cow::Owned(out)
}

/// Words of the lines that are not blank.
fn push_lines(out: &mut Vec<u8>, lines: &[u8]) {
    for line in lines.split(|b| *b == b'\n' || *b == b'\r').filter(|line| !line.trim_ascii().is_empty()) {
        for (at, word) in line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).enumerate() {
            if at > 0 {
                out.push(b' ');
            }
            out.extend_from_slice(word);
        }
        out.push(b'\n');
    }
}

/// First line of a message.
fn first_line(message: &str) -> String {
    message.lines().next().unwrap_or_default().to_owned()
}

/// A list as indices.
fn indices(list: &Property) -> Vec<i64> {
    match list {
        Property::ListChar(v) => v.iter().map(|i| i64::from(*i)).collect(),
        Property::ListUChar(v) => v.iter().map(|i| i64::from(*i)).collect(),
        Property::ListShort(v) => v.iter().map(|i| i64::from(*i)).collect(),
        Property::ListUShort(v) => v.iter().map(|i| i64::from(*i)).collect(),
        Property::ListInt(v) => v.iter().map(|i| i64::from(*i)).collect(),
        Property::ListUInt(v) => v.iter().map(|i| i64::from(*i)).collect(),
        _ => Vec::new(),
    }
}

/// A list as numbers.
fn numbers(list: &Property) -> Vec<f32> {
    match list {
        Property::ListFloat(v) => v.clone(),
        Property::ListDouble(v) => v.iter().map(|v| *v as f32).collect(),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_covered_once() {
        // A chevron in a slanted plane, both ways round: its triangles have its area, and its normal.
        let flat = [[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [0.0, 2.0]];
        let place = |[x, y]: [f32; 2]| Vec3::new(x, y, 0.5 * x - y);
        let area = |corners: &[[f32; 2]]| {
            let next = corners.iter().cycle().skip(1);
            corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f32>() / 2.0
        };
        for backwards in [false, true] {
            let mut corners = flat;
            if backwards {
                corners.reverse();
            }
            let positions = corners.map(place);
            let cut = polygon(&positions);
            assert_eq!(cut.len(), 2);
            let whole = area(&corners);
            let parts: Vec<f32> = cut.iter().map(|t| area(&t.map(|c| corners[c]))).collect();
            assert!((parts.iter().sum::<f32>() - whole).abs() < 1e-6, "{parts:?} {whole}");
            assert!(parts.iter().all(|part| part.signum() == whole.signum()), "{parts:?}");
        }
    }
}
