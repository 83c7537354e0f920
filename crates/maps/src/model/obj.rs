//! Wavefront OBJ by the `tobj` crate: shapes, normals and map coordinates. Materials come from the command
//! line.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::{ModelFormat, Parts, RawMesh};
use crate::MapError;

pub(super) const FORMAT: ModelFormat = ModelFormat { name: "OBJ", extensions: &["obj"], read };

fn read(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<Parts, MapError> {
    let options =
        tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &Path| Ok((Vec::new(), Default::default()));
    let mut reader = bytes;
    let (models, _) =
        tobj::load_obj_buf(&mut reader, &options, no_materials).map_err(|e| MapError::invalid(path, e))?;
    if bytes.windows(7).any(|w| w == b"usemtl ") {
        warnings.push("its materials are not read; `--map` and `--brdf` give it one".to_owned());
    }
    let mesh = |model: tobj::Model| {
        let tobj::Mesh { positions, normals, texcoords, indices, .. } = model.mesh;
        let raw = RawMesh {
            positions: positions.as_chunks().0.iter().copied().map(Vec3::from_array).collect(),
            normals: normals.as_chunks().0.iter().copied().map(Vec3::from_array).collect(),
            // OBJ's v runs up the picture.
            uvs: texcoords.as_chunks().0.iter().map(|[u, v]| Vec2::new(*u, 1.0 - v)).collect(),
            tangents: Vec::new(),
            triangles: indices.as_chunks().0.to_vec(),
        };
        (raw, 0)
    };
    Ok(Parts { meshes: models.into_iter().map(mesh).collect(), materials: Vec::new() })
}
