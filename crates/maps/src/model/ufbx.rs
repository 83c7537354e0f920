//! Wavefront OBJ and FBX by the `ufbx` library: shapes, normals, map coordinates, materials and textures.
//!
//! Polygons are cut into triangles by the library, concave ones too. Files of FBX are turned so that y is up.
//! Textures are looked for beside the model by their relative names, then by their last names, there and in
//! a folder `textures`: files name the folders of whoever wrote them.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use glam::{DAffine2, DMat2, DMat3, DVec2, DVec3, Vec2};
use ndfmap_core::grid::Grid;
use ndfmap_core::lookup::area_mean;
use ndfmap_core::surface::{Wrap, Wraps};
use ndfmap_scene::Material;
use ufbx::{
    AllocatorOpts, CoordinateAxes, FileFormat, IndexErrorHandling, LoadOpts, MaterialMap, Matrix, WrapMode,
};

use super::corners::CornerMesh;
use super::laying::{Laying, NormalTexture, Texture, Textures, ValueTexture};
use super::material::{Factors, MetalRough, colours};
use super::{MAX_ELEMENTS, ModelFormat, Parts};
use crate::attribute::Transfer;
use crate::formats::{read_file, read_image};
use crate::source::{Convention, PictureKind, SourceOptions, identify, source_of_image};
use crate::{Image, MapError, SourceKind};

pub(super) const OBJ: ModelFormat = ModelFormat {
    name: "OBJ",
    extensions: &["obj"],
    read: |path, bytes, warnings| read(path, bytes, FileFormat::Obj, warnings),
};

pub(super) const FBX: ModelFormat = ModelFormat {
    name: "FBX",
    extensions: &["fbx"],
    read: |path, bytes, warnings| read(path, bytes, FileFormat::Fbx, warnings),
};

/// Memory for each of the library's two heaps: a base, and a multiple of the file's length. A face of an OBJ
/// of four bytes ("f 1 ") becomes some hundred bytes of lists.
fn memory(bytes: &[u8]) -> AllocatorOpts {
    AllocatorOpts { memory_limit: (64 << 20) + 512 * bytes.len(), ..AllocatorOpts::default() }
}

fn read(
    path: &Path,
    bytes: &[u8],
    file_format: FileFormat,
    warnings: &mut Vec<String>,
) -> Result<Parts, MapError> {
    let is_obj = file_format == FileFormat::Obj;
    let bytes = &*if is_obj { without_utf16(bytes) } else { Cow::Borrowed(bytes) };
    let library = if is_obj { material_library(path, bytes, warnings) } else { Vec::new() };
    let opts = |library: &[u8]| LoadOpts {
        temp_allocator: memory(bytes),
        result_allocator: memory(bytes),
        ignore_animation: true,
        index_error_handling: IndexErrorHandling::NoIndex,
        file_format,
        target_axes: match is_obj {
            true => CoordinateAxes::default(),
            false => CoordinateAxes::right_handed_y_up(),
        },
        obj_mtl_data: library.to_vec().into(),
        ..LoadOpts::default()
    };
    let load = |library: &[u8]| ufbx::load_memory(bytes, opts(library)).map_err(Box::new);
    let scene = load(&library).or_else(|e| {
        if library.is_empty() {
            return Err(e);
        }
        warnings.push("names materials that are damaged: they are plain".to_owned());
        load(&[])
    });
    let scene = scene.map_err(|e| {
        let info = e.info();
        let more = if info.is_empty() { String::new() } else { format!(" ({info})") };
        MapError::invalid(path, format!("is damaged: {}{more}", e.description.to_lowercase()))
    })?;
    let mut parts = Parts::default();
    let mut layings = Vec::new();
    for material in &scene.materials {
        let (material, laying) = Look { path, material }.read(warnings)?;
        parts.materials.push(material);
        layings.push(laying);
    }
    let plain = parts.materials.len();
    parts.materials.push(super::plain());
    layings.push(Laying::PLAIN);
    let (mut triangles, mut left_out, mut unmapped) = (0, 0, false);
    for node in &scene.nodes {
        let Some(mesh) = &node.mesh else { continue };
        triangles += mesh.num_triangles;
        if triangles > MAX_ELEMENTS {
            return Err(MapError::unsupported(path, format!("has more than {MAX_ELEMENTS} triangles")));
        }
        left_out += mesh.num_line_faces + mesh.num_point_faces;
        let shape = Shape { mesh, pose: &node.geometry_to_world };
        for part in &mesh.material_parts {
            let at = part.index as usize;
            let own = node.materials.get(at).or_else(|| mesh.materials.get(at));
            let material = own.map_or(plain, |m| m.element.typed_id as usize);
            let gone = || MapError::invalid(path, "has a face of a vertex that is not there");
            let mut corners = shape.part(part).ok_or_else(gone)?;
            unmapped |=
                mesh.vertex_uv.exists && corners.uvs.as_chunks::<3>().0.contains(&[NO_COORDINATES; 3]);
            corners.uvs.iter_mut().for_each(|uv| *uv = layings[material].apply(*uv));
            parts.meshes.push((corners.weld(), material));
        }
    }
    if left_out > 0 {
        warnings.push(format!("has {left_out} lines and points, which are left out"));
    }
    if unmapped {
        warnings.push("has faces without map coordinates, which take one texel of the map".to_owned());
    }
    if !scene.skin_deformers.is_empty() {
        warnings.push("has a skeleton: only the pose of the file is shown".to_owned());
    }
    if !scene.nurbs_surfaces.is_empty() {
        warnings.push("has NURBS surfaces, which are left out".to_owned());
    }
    Ok(parts)
}

/// Coordinates that the library gives to corners without any, v turned down.
const NO_COORDINATES: Vec2 = Vec2::new(0.0, 1.0);

/// Text in UTF-8, where a mark says that it is in UTF-16.
fn without_utf16(bytes: &[u8]) -> Cow<'_, [u8]> {
    let read: fn([u8; 2]) -> u16 = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Cow::Borrowed(bytes),
    };
    let units = bytes[2..].as_chunks().0.iter().copied().map(read);
    let text: String = char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect();
    Cow::Owned(text.into_bytes())
}

/// Bytes of the material library that an OBJ names; none where it names none, or it cannot be read.
fn material_library(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Vec<u8> {
    let named = bytes.split(|b| *b == b'\n').find_map(|line| line.trim_ascii().strip_prefix(b"mtllib "));
    let Some(name) = named.map(|name| String::from_utf8_lossy(name.trim_ascii()).into_owned()) else {
        return Vec::new();
    };
    let read = beside(path, &name).map(|file| read_file(&file));
    if let Some(Ok(library)) = read {
        return library;
    }
    warnings.push(format!("names the materials of `{name}`, which is not there: they are plain"));
    Vec::new()
}

/// File that a model names: beside it by the relative name, else by the last name, there or in `textures`.
fn beside(path: &Path, name: &str) -> Option<PathBuf> {
    let name = name.replace('\\', "/");
    let folder = path.with_file_name("");
    let last = Path::new(&name).file_name()?;
    let relative = Some(folder.join(&name)).filter(|_| !Path::new(&name).has_root());
    let others = [folder.join(last), folder.join("textures").join(last)];
    relative.into_iter().chain(others).find(|file| file.is_file())
}

/// Shape of a node: its mesh, and its pose.
struct Shape<'a> {
    mesh: &'a ufbx::Mesh,
    pose: &'a Matrix,
}

impl Shape<'_> {
    /// Triangles of one material; `None` where a face has a vertex that is not there.
    fn part(&self, part: &ufbx::MeshPart) -> Option<CornerMesh> {
        let mesh = self.mesh;
        let m = self.pose;
        let column = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let linear = DMat3::from_cols(
            column(m.m00, m.m10, m.m20),
            column(m.m01, m.m11, m.m21),
            column(m.m02, m.m12, m.m22),
        );
        let moved = column(m.m03, m.m13, m.m23);
        let turned = linear.inverse().transpose();
        let vector = |v: &ufbx::Vec3| DVec3::new(v.x, v.y, v.z);
        let position = |v: &ufbx::Vec3| (linear * vector(v) + moved).as_vec3();
        let mut out =
            CornerMesh { positions: mesh.vertices.iter().map(position).collect(), ..CornerMesh::default() };
        let mut indices = Vec::new();
        for face in &part.face_indices {
            let face = mesh.faces[*face as usize];
            // The library cuts polygons without a look at their indices.
            let corners = face.index_begin as usize..(face.index_begin + face.num_indices) as usize;
            if mesh.vertex_indices.as_ref()[corners].iter().any(|i| *i as usize >= out.positions.len()) {
                return None;
            }
            ufbx::triangulate_face_vec(&mut indices, mesh, face);
            for triangle in indices.as_chunks::<3>().0 {
                let mut corners = *triangle;
                if linear.determinant() < 0.0 {
                    corners.swap(1, 2);
                }
                let corners = corners.map(|c| c as usize);
                out.triangles.push(corners.map(|c| mesh.vertex_indices[c]));
                if mesh.vertex_normal.exists {
                    // A corner without a normal has that of its triangle.
                    let own =
                        |c: usize| mesh.vertex_normal.values.get(mesh.vertex_normal.indices[c] as usize);
                    let [a, b, c] = corners.map(|c| out.positions[mesh.vertex_indices[c] as usize]);
                    let flat = (b - a).cross(c - a).normalize_or_zero();
                    let normal = |c: usize| own(c).map_or(flat, |n| (turned * vector(n)).as_vec3());
                    out.normals.extend(corners.map(normal));
                }
                if mesh.vertex_uv.exists {
                    // Both formats have v up the picture.
                    let uv = |c: usize| {
                        let uv = mesh.vertex_uv.values.get(mesh.vertex_uv.indices[c] as usize);
                        uv.map_or(NO_COORDINATES, |uv| Vec2::new(uv.x as f32, 1.0 - uv.y as f32))
                    };
                    out.uvs.extend(corners.map(uv));
                }
            }
        }
        if !mesh.vertex_normal.exists {
            out.smooth();
        }
        Some(out)
    }
}

/// Material of a file, and the model that it is beside.
struct Look<'a> {
    path: &'a Path,
    material: &'a ufbx::Material,
}

impl Look<'_> {
    /// Material in metalness and roughness, as the library makes it, and the laying of its map; a plain one
    /// where the file says nothing.
    fn read(&self, warnings: &mut Vec<String>) -> Result<(Material, Laying), MapError> {
        let (pbr, fbx) = (&self.material.pbr, &self.material.fbx);
        let name = self.material.element.name.to_string();
        let named = [&pbr.base_color, &pbr.roughness, &pbr.metalness, &pbr.normal_map, &fbx.bump];
        if !pbr.base_color.has_value && named.iter().all(|map| texture(map).is_none()) {
            return Ok((Material { name, ..super::plain() }, Laying::PLAIN));
        }
        let number = |map: &MaterialMap, or: f64| if map.has_value { map.value_vec4.x } else { or };
        let colour = pbr.base_color.value_vec4;
        let factor = number(&pbr.base_factor, 1.0);
        let glossy = self.material.features.roughness_as_glossiness.enabled;
        let roughness = match number(&pbr.roughness, 0.5) {
            glossiness if glossy => 1.0 - glossiness,
            roughness => roughness,
        };
        let metal_rough = self.metal_rough(glossy, warnings)?;
        let base = self.values(&pbr.base_color, Transfer::Srgb, warnings)?;
        let [base_textured, metal_rough_textured] = [base.is_some(), metal_rough.is_some()];
        // A texture stands in the place of the number (the library's documentation of `MaterialMap`).
        let unless = |textured: bool, value: f64| if textured { 1.0 } else { value as f32 };
        let rough_textured = texture(&pbr.roughness).is_some() && metal_rough_textured;
        let metal_textured = texture(&pbr.metalness).is_some() && metal_rough_textured;
        let textures = Textures { normals: self.normals(warnings)?, base, metal_rough }.arranged();
        let laying = textures.laying;
        let made = MetalRough {
            name,
            factors: Factors {
                base: [colour.x, colour.y, colour.z].map(|c| unless(base_textured, c * factor)),
                metallic: unless(metal_textured, number(&pbr.metalness, 0.0)),
                roughness: unless(rough_textured, roughness),
            },
            textures,
        };
        Ok((made.into_material(warnings), laying))
    }

    /// Picture of a texture, and a path to name it by; `None` with a warning where it is not there.
    fn image(
        &self,
        texture: &ufbx::Texture,
        warnings: &mut Vec<String>,
    ) -> Result<Option<(PathBuf, Image)>, MapError> {
        let name = match texture.relative_filename.is_empty() {
            true => texture.filename.to_string(),
            false => texture.relative_filename.to_string(),
        };
        if !texture.content.is_empty() {
            let path = self.path.join(Path::new(&name).file_name().unwrap_or_default());
            return read_image(&path, &texture.content).map(|image| Some((path, image)));
        }
        let Some(file) = beside(self.path, &name) else {
            warnings.push(format!("names the texture `{name}`, which is not there: it is left out"));
            return Ok(None);
        };
        let image = read_image(&file, &read_file(&file)?)?;
        Ok(Some((file, image)))
    }

    fn values(
        &self,
        map: &MaterialMap,
        transfer: Transfer,
        warnings: &mut Vec<String>,
    ) -> Result<Option<ValueTexture>, MapError> {
        let Some(texture) = texture(map) else { return Ok(None) };
        let Some((file, image)) = self.image(texture, warnings)? else { return Ok(None) };
        let content = colours(&file, &image, transfer)?;
        Ok(Some(Texture { content, laying: self.laying(texture) }))
    }

    /// Laying of a texture of this material.
    fn laying(&self, texture: &ufbx::Texture) -> Laying {
        let m = &texture.uv_to_texture;
        let fbx = DAffine2::from_mat2_translation(
            DMat2::from_cols(DVec2::new(m.m00, m.m10), DVec2::new(m.m01, m.m11)),
            DVec2::new(m.m03, m.m13),
        );
        // v points up the picture in both formats, ours down.
        let turned = DAffine2::from_scale_angle_translation(DVec2::new(1.0, -1.0), 0.0, DVec2::Y);
        let upright = match texture.has_uv_transform {
            true => fbx,
            false => placement(texture),
        };
        let clamped = option(texture, "clamp").is_some_and(|text| text == "on");
        let wrap = |mode| if clamped || mode == WrapMode::Clamp { Wrap::Clamp } else { Wrap::Repeat };
        // Only meshes know the number of a set; textures of one material can be told apart without.
        let name = |texture: &ufbx::Texture| texture.uv_set.to_string();
        let set = self.material.textures.iter().position(|used| name(&used.texture) == name(texture));
        Laying {
            set: set.unwrap_or_default() as u32,
            transform: turned * upright * turned,
            wraps: Wraps { x: wrap(texture.wrap_u), y: wrap(texture.wrap_v) },
        }
    }

    /// Roughness and metalness in the channels of glTF, at the larger of their two sizes.
    fn metal_rough(
        &self,
        glossy: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Option<ValueTexture>, MapError> {
        let pbr = &self.material.pbr;
        let rough = self.values(&pbr.roughness, Transfer::Linear, warnings)?;
        let metal = self.values(&pbr.metalness, Transfer::Linear, warnings)?;
        let maps = || [&rough, &metal].into_iter().flatten();
        let sizes = maps().map(|map| map.content.size());
        let Some(size) = sizes.max_by_key(|size| size.area()) else { return Ok(None) };
        let layings: Vec<Laying> = maps().map(|map| map.laying).collect();
        if layings.iter().any(|laying| *laying != layings[0]) {
            warnings.push(format!(
                "metalness of `{}` lies otherwise than its roughness, and is laid on as that",
                &*self.material.element.name
            ));
        }
        let first = |map: &Option<ValueTexture>, x: usize, y: usize| {
            map.as_ref().map(|map| area_mean(&map.content, size, x, y)[0])
        };
        let content = Grid::from_fn(size, |x, y| {
            let rough = first(&rough, x, y).map_or(1.0, |r| if glossy { 1.0 - r } else { r });
            [1.0, rough, first(&metal, x, y).unwrap_or(1.0), 1.0]
        });
        Ok(Some(Texture { content, laying: layings[0] }))
    }

    /// Normals of the normal map, or of a bump map that holds normals, as exporters of OBJ write them.
    fn normals(&self, warnings: &mut Vec<String>) -> Result<Option<NormalTexture>, MapError> {
        let (pbr, fbx) = (&self.material.pbr, &self.material.fbx);
        let normal = [&pbr.normal_map, &fbx.normal_map].into_iter().find_map(texture);
        let Some(texture) = normal.or_else(|| texture(&fbx.bump)) else { return Ok(None) };
        let Some((file, image)) = self.image(texture, warnings)? else { return Ok(None) };
        let name = &*self.material.element.name;
        if normal.is_none() && identify(&file, &image).kind != PictureKind::Normal {
            warnings.push(format!(
                "bumps of `{name}` are no normal map, and are left out: their scale is not in the file, and \
                 `--map` lays them on"
            ));
            return Ok(None);
        }
        let laying = self.laying(texture);
        // Neither format says where green points.
        let options =
            SourceOptions { kind: Some(SourceKind::Normal), wraps: laying.wraps, ..SourceOptions::default() };
        let map = source_of_image(&file, image.clone(), String::new(), &options).or_else(|_| {
            warnings.push(format!(
                "normal map of `{name}` does not tell whether green points up, and is taken so"
            ));
            let options = SourceOptions { convention: Some(Convention::OpenGl), ..options };
            source_of_image(&file, image, String::new(), &options)
        })?;
        warnings.extend(map.warnings.iter().map(|w| format!("normal map of `{name}` {w}")));
        Ok(Some(Texture { content: map.surface, laying }))
    }
}

/// Text of an option before the name of a texture in a material library, `-NAME TEXT`.
fn option(texture: &ufbx::Texture, name: &str) -> Option<String> {
    texture.element.props.find_prop(name).map(|prop| prop.value_str.to_string())
}

/// Transform by the options of a material library, v up: `-s` scales coordinates, then `-o` moves them, as
/// exporters write them and engines read them (the format's text leaves open whether `-s 2` shows a texture
/// twice or half).
fn placement(texture: &ufbx::Texture) -> DAffine2 {
    let pair = |name: &str, or: f64| {
        let text = option(texture, name).unwrap_or_default();
        let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
        let part = |i: usize| numbers.get(i).copied().filter(|v| v.is_finite()).unwrap_or(or);
        DVec2::new(part(0), part(1))
    };
    DAffine2::from_scale_angle_translation(pair("s", 1.0), 0.0, pair("o", 0.0))
}

/// Texture of a slot that is in use.
fn texture(map: &MaterialMap) -> Option<&ufbx::Texture> {
    map.texture.as_deref().filter(|_| map.texture_enabled)
}
