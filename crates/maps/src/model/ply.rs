//! PLY by the `ply-rs-bw` crate: shapes, and normals and map coordinates where there are any.

use std::path::Path;

use glam::{Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{DefaultElement, Property};

use super::{MAX_ELEMENTS, ModelFormat, Parts, RawMesh};
use crate::MapError;

pub(super) const FORMAT: ModelFormat = ModelFormat { name: "PLY", extensions: &["ply"], read };

fn read(path: &Path, bytes: &[u8], _warnings: &mut Vec<String>) -> Result<Parts, MapError> {
    let parser = Parser::<DefaultElement>::new();
    let header = parser.read_header(&mut Reader::new(bytes)).map_err(|e| MapError::invalid(path, e))?;
    // An element takes a byte at least, whatever the header says.
    if header.elements.iter().any(|(_, e)| e.count > bytes.len()) {
        return Err(MapError::invalid(path, "announces more elements than the file can hold"));
    }
    if header.elements.iter().any(|(_, e)| e.count > MAX_ELEMENTS) {
        return Err(MapError::unsupported(path, format!("has more than {MAX_ELEMENTS} vertices or faces")));
    }
    let ply = parser.read_ply(&mut &bytes[..]).map_err(|e| MapError::invalid(path, e))?;
    let elements = |name: &str| ply.payload.get(name).map_or(&[][..], Vec::as_slice);
    let vertices = elements("vertex");
    let read3 = |names: [&str; 3]| -> Vec<Vec3> {
        let one = |v: &DefaultElement| {
            Some(Vec3::new(number(v, names[0])?, number(v, names[1])?, number(v, names[2])?))
        };
        vertices.iter().map_while(one).collect()
    };
    let read2 = |names: [&str; 2]| -> Vec<Vec2> {
        // PLY's v runs up the picture.
        let one = |v: &DefaultElement| Some(Vec2::new(number(v, names[0])?, 1.0 - number(v, names[1])?));
        vertices.iter().map_while(one).collect()
    };
    let positions = read3(["x", "y", "z"]);
    if positions.len() != vertices.len() {
        return Err(MapError::invalid(path, "has vertices without x, y and z"));
    }
    let uvs = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]].map(read2);
    let mut mesh = RawMesh {
        positions,
        normals: read3(["nx", "ny", "nz"]),
        uvs: uvs.into_iter().find(|uvs| !uvs.is_empty()).unwrap_or_default(),
        ..RawMesh::default()
    };
    for face in elements("face") {
        let corners = ["vertex_indices", "vertex_index"].iter().find_map(|name| face.get(*name));
        let corners =
            corners.and_then(indices).ok_or_else(|| MapError::invalid(path, "has faces without vertices"))?;
        // A polygon is a fan; concave ones come out wrong, as in most readers.
        for two in corners.get(1..).unwrap_or_default().windows(2) {
            mesh.triangles.push([corners[0], two[0], two[1]]);
        }
    }
    Ok(Parts { meshes: vec![(mesh, 0)], materials: Vec::new() })
}

/// A property as a number, whatever its type.
fn number(element: &DefaultElement, name: &str) -> Option<f32> {
    Some(match element.get(name)? {
        Property::Float(v) => *v,
        Property::Double(v) => *v as f32,
        Property::Char(v) => f32::from(*v),
        Property::UChar(v) => f32::from(*v),
        Property::Short(v) => f32::from(*v),
        Property::UShort(v) => f32::from(*v),
        Property::Int(v) => *v as f32,
        Property::UInt(v) => *v as f32,
        _ => return None,
    })
}

/// A list as indices; a negative one becomes one that no mesh has.
fn indices(list: &Property) -> Option<Vec<u32>> {
    Some(match list {
        Property::ListInt(v) => v.iter().map(|i| u32::try_from(*i).unwrap_or(u32::MAX)).collect(),
        Property::ListUInt(v) => v.clone(),
        Property::ListUShort(v) => v.iter().map(|i| u32::from(*i)).collect(),
        Property::ListShort(v) => v.iter().map(|i| u32::try_from(*i).unwrap_or(u32::MAX)).collect(),
        Property::ListUChar(v) => v.iter().map(|i| u32::from(*i)).collect(),
        Property::ListChar(v) => v.iter().map(|i| u32::try_from(*i).unwrap_or(u32::MAX)).collect(),
        _ => return None,
    })
}
