//! glTF 2.0 by the `gltf` crate: meshes in the pose of the file, and metallic-roughness materials.
//!
//! It reads positions, normals, tangents, the normal texture's coordinates (with `KHR_texture_transform` and
//! scale), base colour, metalness and roughness, factors and textures. Colours and roughness are averaged
//! over the texels of the normal map; without one, the colours' own coordinates and transform count. It does
//! not read animation, skins, morphs, colours of vertices, occlusion, emission, alpha, cameras and lights.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DVec3, Mat3, Mat4, Vec2, Vec3, Vec4};
use ndfmap_core::brdf::SurfaceParams;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_core::lookup::area_mean;
use ndfmap_core::surface::{NormalGrid, Surface, SurfaceRow, Wrap, Wraps, unit_or_up};
use ndfmap_core::units::{Alpha, PerceptualRoughness, SlopeVariance};
use ndfmap_scene::{Material, SurfaceTextures};

use super::{MAX_ELEMENTS, ModelFormat, Parts, RawMesh, microfacets};
use crate::attribute::{Transfer, attribute_of_image};
use crate::formats::{read_file, read_image};
use crate::source::{SourceOptions, source_of_image};
use crate::{Image, MapError, SourceKind};

pub(super) const FORMAT: ModelFormat = ModelFormat { name: "glTF", extensions: &["gltf", "glb"], read };

/// Least roughness, below which surfaces count as mirrors: narrower highlights fall between the rays of any
/// truth.
const LEAST_ROUGHNESS: f64 = 0.05;

/// Deepest tree of nodes.
const MAX_DEPTH: usize = 64;

fn read(path: &Path, bytes: &[u8], warnings: &mut Vec<String>) -> Result<Parts, MapError> {
    refuse_unread(path, bytes)?;
    let document = gltf::Gltf::from_slice(bytes).map_err(|e| MapError::invalid(path, e))?;
    let buffers = document
        .buffers()
        .map(|buffer| match buffer.source() {
            gltf::buffer::Source::Bin => {
                let blob = document.blob.as_deref().map(Cow::Borrowed);
                blob.ok_or_else(|| MapError::invalid(path, "lacks its binary chunk"))
            }
            gltf::buffer::Source::Uri(uri) => resource(path, uri).map(|(_, bytes)| Cow::Owned(bytes)),
        })
        .collect::<Result<Vec<_>, _>>()?;
    let files = Files { path, buffers };
    let mut materials = Vec::new();
    for material in document.materials() {
        materials.push(files.material(&material, warnings)?);
    }
    // Primitives without a material get glTF's default one, at the end.
    materials.push(super::plain());
    let mut walk = Walk {
        files: &files,
        plain: materials.len() - 1,
        meshes: Vec::new(),
        seen: HashSet::new(),
        elements: 0,
        left_out: 0,
        coloured: false,
    };
    let scene = document.default_scene().or_else(|| document.scenes().next());
    for node in scene.iter().flat_map(gltf::Scene::nodes) {
        walk.node(&node, Mat4::IDENTITY, 0)?;
    }
    if document.animations().len() + document.skins().len() > 0 {
        warnings.push("is animated: only the pose of the file is shown".to_owned());
    }
    if walk.left_out > 0 {
        warnings.push(format!("has {} parts that are lines or points, which are left out", walk.left_out));
    }
    if walk.coloured {
        warnings.push("has colours of vertices, which are not read".to_owned());
    }
    Ok(Parts { meshes: walk.meshes, materials })
}

/// Refuses what is not read, by its name, before a parser stumbles over what comes of it.
fn refuse_unread(path: &Path, bytes: &[u8]) -> Result<(), MapError> {
    let unread = |what: &str| MapError::unsupported(path, what);
    let u32_at = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let json = if bytes.starts_with(b"glTF") {
        if u32_at(4) == Some(1) {
            return Err(unread("is glTF 1.0, which is not read: export glTF 2.0"));
        }
        // Header of twelve bytes; the first chunk, its length and its kind before it, is the JSON.
        let length = u32_at(12).map_or(0, |length| length as usize);
        bytes.get(20..20_usize.saturating_add(length)).unwrap_or_default()
    } else {
        bytes
    };
    let Ok(json) = serde_json::from_slice::<serde_json::Value>(json) else { return Ok(()) };
    let version = json.pointer("/asset/version").and_then(serde_json::Value::as_str).unwrap_or_default();
    if version.starts_with("1.") {
        return Err(unread("is glTF 1.0, which is not read: export glTF 2.0"));
    }
    let required = json.get("extensionsRequired").and_then(serde_json::Value::as_array);
    for name in required.into_iter().flatten().filter_map(serde_json::Value::as_str) {
        if !READ_EXTENSIONS.contains(&name) {
            return Err(unread(&format!("requires {name}, which is not read: export it without")));
        }
    }
    Ok(())
}

/// Extensions that a file may require.
const READ_EXTENSIONS: [&str; 2] = ["KHR_texture_transform", "KHR_lights_punctual"];

/// Files of the document.
struct Files<'a> {
    path: &'a Path,
    buffers: Vec<Cow<'a, [u8]>>,
}

/// The bytes behind a URI, and a path to name them by.
fn resource(path: &Path, uri: &str) -> Result<(PathBuf, Vec<u8>), MapError> {
    if let Some(data) = uri.strip_prefix("data:") {
        let coded = data.split_once(";base64,").map(|(_, coded)| coded);
        let coded = coded.ok_or_else(|| MapError::unsupported(path, "has a data URI that is not base64"))?;
        let bytes = STANDARD
            .decode(coded)
            .map_err(|e| MapError::invalid(path, format!("has a damaged data URI: {e}")))?;
        return Ok((path.to_owned(), bytes));
    }
    let name = percent_decoded(uri);
    let relative = !name.contains(':') && !Path::new(&name).has_root();
    if !relative {
        return Err(MapError::unsupported(path, format!("names `{uri}`, which is not a file beside it")));
    }
    let file = path.with_file_name("").join(name);
    // Refuses a device or a pipe, which would never end.
    if file.exists() && !file.is_file() {
        return Err(MapError::invalid(&file, "is no file"));
    }
    let bytes = read_file(&file)?;
    Ok((file, bytes))
}

/// A URI's `%20` and its kind as the characters they stand for.
fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((first, tail)) = rest.split_first() {
        let code = tail
            .get(..2)
            .filter(|hex| hex.iter().all(u8::is_ascii_hexdigit))
            .and_then(|hex| std::str::from_utf8(hex).ok());
        match code.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            _ => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A normal map with its x and y scaled, as `normalTexture.scale` asks.
struct Scaled {
    inner: Arc<dyn Surface>,
    scale: f32,
}

impl Surface for Scaled {
    fn size(&self) -> Size {
        self.inner.size()
    }

    fn wraps(&self) -> Wraps {
        self.inner.wraps()
    }

    fn read_row(&self, y: usize, row: &mut SurfaceRow) {
        self.inner.read_row(y, row);
        for i in 0..row.width() {
            let n = row.normal(i);
            row.set_normal(i, unit_or_up(Vec3::new(n.x * self.scale, n.y * self.scale, n.z)));
        }
    }
}

impl Files<'_> {
    /// The picture of a texture, and a path to name it by.
    fn image(&self, texture: &gltf::Texture<'_>) -> Result<(PathBuf, Image), MapError> {
        let (file, bytes) = match texture.source().source() {
            gltf::image::Source::Uri { uri, .. } => resource(self.path, uri)?,
            gltf::image::Source::View { view, .. } => {
                let buffer = &self.buffers[view.buffer().index()];
                let bytes =
                    view.offset().checked_add(view.length()).and_then(|end| buffer.get(view.offset()..end));
                let bytes =
                    bytes.ok_or_else(|| MapError::invalid(self.path, "has a picture outside its buffer"))?;
                (self.path.to_owned(), bytes.to_vec())
            }
        };
        // A picture inside the file has no name; its first bytes tell its format.
        let image = read_image(&file, &bytes)?;
        Ok((file, image))
    }

    /// A texture's values, decoded.
    fn values(&self, texture: &gltf::Texture<'_>, transfer: Transfer) -> Result<Grid<[f32; 4]>, MapError> {
        let (file, image) = self.image(texture)?;
        let values = attribute_of_image(&file, &image, transfer)?.values;
        // A grey picture is that grey in every colour (glTF 2.0, 3.8.2: as images are decoded to RGB).
        if image.channels == 1 {
            let grey = |x: usize, y: usize| values.row(y)[x][0];
            return Ok(Grid::from_fn(values.size(), |x, y| [grey(x, y), grey(x, y), grey(x, y), 1.0]));
        }
        Ok(values)
    }

    fn material(
        &self,
        material: &gltf::Material<'_>,
        warnings: &mut Vec<String>,
    ) -> Result<Material, MapError> {
        let name = material.name().unwrap_or("unnamed").to_owned();
        let pbr = material.pbr_metallic_roughness();
        let base = pbr.base_color_texture().map(|t| self.values(&t.texture(), Transfer::Srgb)).transpose()?;
        let metal_rough = pbr
            .metallic_roughness_texture()
            .map(|t| self.values(&t.texture(), Transfer::Linear))
            .transpose()?;
        let normal = material.normal_texture();
        let surface: Arc<dyn Surface> = match &normal {
            Some(normal) => {
                let (file, image) = self.image(&normal.texture())?;
                let wraps = wraps(&normal.texture().sampler());
                let options =
                    SourceOptions { kind: Some(SourceKind::Normal), wraps, ..SourceOptions::default() };
                let map = source_of_image(&file, image, String::new(), &options)?;
                warnings.extend(map.warnings.iter().map(|w| format!("normal map of `{name}` {w}")));
                if normal.scale() == 1.0 {
                    map.surface
                } else {
                    Arc::new(Scaled { inner: map.surface, scale: normal.scale() })
                }
            }
            None => {
                let colours = base.as_ref().or(metal_rough.as_ref());
                let size = colours.map_or(Size { width: 1, height: 1 }, Grid::size);
                let normals = Grid::from_fn(size, |_, _| Vec3::Z);
                Arc::new(NormalGrid { normals, wraps: Laying::of(material).wraps })
            }
        };
        // A placeholder, however small, is as flat at the size of the colours.
        let colours = base.as_ref().or(metal_rough.as_ref()).map(Grid::size);
        let surface = match colours {
            Some(size) if size.area() > surface.size().area() => match only_normal(&*surface) {
                Some(normal) => {
                    let normals = Grid::from_fn(size, |_, _| normal);
                    Arc::new(NormalGrid { normals, wraps: surface.wraps() }) as Arc<dyn Surface>
                }
                None => {
                    warnings.push(format!("colours of `{name}` are averaged over its smaller normal map"));
                    surface
                }
            },
            _ => surface,
        };
        let own = Laying::of(material);
        let others = [pbr.base_color_texture(), pbr.metallic_roughness_texture()];
        if others.iter().flatten().any(|info| Laying::of_info(info) != own) {
            warnings.push(format!(
                "textures of `{name}` do not lie alike (coordinates, transform or edges): all are laid on as its \
                 normal map, or without one as its colours"
            ));
        }
        let textures = others.iter().flatten().map(|info| info.texture());
        if textures.chain(normal.iter().map(|n| n.texture())).any(|texture| is_mirrored(&texture.sampler())) {
            warnings
                .push(format!("textures of `{name}` are mirrored beyond their edges, and are repeated here"));
        }
        let factors = MaterialFactors {
            base: pbr.base_color_factor(),
            metallic: pbr.metallic_factor(),
            roughness: pbr.roughness_factor(),
        };
        let (params, roughness) = factors.params([1.0; 4], [1.0; 4]);
        if base.is_none() && metal_rough.is_none() {
            let params = SurfaceParams { roughness: SlopeVariance::ZERO, ..params };
            return Ok(Material {
                name,
                map: surface.into(),
                params,
                textures: None,
                displacement: None,
                brdf: microfacets(roughness * roughness),
            });
        }
        let size = surface.size();
        let sample = |map: &Option<Grid<[f32; 4]>>, x: usize, y: usize| {
            map.as_ref().map_or([1.0; 4], |map| area_mean(map, size, x, y))
        };
        let at = |x: usize, y: usize| factors.params(sample(&base, x, y), sample(&metal_rough, x, y)).0;
        let rgb = |c: DVec3, w: f64| [c.x as f32, c.y as f32, c.z as f32, w as f32];
        let diffuse_roughness = Grid::from_fn(size, |x, y| {
            let params = at(x, y);
            rgb(params.diffuse, params.roughness.get())
        });
        let specular = Grid::from_fn(size, |x, y| rgb(at(x, y).specular, 1.0));
        let params = mean_params(&diffuse_roughness, &specular);
        let textures = Some(SurfaceTextures {
            diffuse_roughness: diffuse_roughness.into(),
            specular: Some(specular.into()),
        });
        // The lobe itself is as sharp as can be; all its width is in the map.
        Ok(Material {
            name,
            map: surface.into(),
            params,
            textures,
            displacement: None,
            brdf: microfacets(0.0),
        })
    }
}

/// Means over a map, for materials whose map is taken away.
fn mean_params(diffuse_roughness: &Grid<[f32; 4]>, specular: &Grid<[f32; 4]>) -> SurfaceParams {
    let mean = |map: &Grid<[f32; 4]>, c: usize| {
        map.texels().iter().map(|t| f64::from(t[c])).sum::<f64>() / map.texels().len() as f64
    };
    SurfaceParams {
        diffuse: DVec3::from([0, 1, 2].map(|c| mean(diffuse_roughness, c))),
        specular: DVec3::from([0, 1, 2].map(|c| mean(specular, c))),
        roughness: SlopeVariance::clamped(mean(diffuse_roughness, 3)),
    }
}

/// Constant factors of a material.
struct MaterialFactors {
    base: [f32; 4],
    metallic: f32,
    roughness: f32,
}

impl MaterialFactors {
    /// Surface parameters under texture values, and the roughness (glTF 2.0, appendix B).
    fn params(&self, base: [f32; 4], metal_rough: [f32; 4]) -> (SurfaceParams, f64) {
        let base = DVec3::from([0, 1, 2].map(|i| f64::from(self.base[i] * base[i])));
        let metal = f64::from(self.metallic * metal_rough[2]).clamp(0.0, 1.0);
        let roughness = f64::from(self.roughness * metal_rough[1]).clamp(LEAST_ROUGHNESS, 1.0);
        let alpha = PerceptualRoughness::new(roughness).map(Alpha::from);
        let variance = alpha.map_or(SlopeVariance::ZERO, SlopeVariance::from);
        let params = SurfaceParams {
            diffuse: base * (1.0 - metal),
            specular: DVec3::splat(0.04).lerp(base, metal),
            roughness: variance,
        };
        (params, roughness)
    }
}

/// The normal of a surface that has no other.
fn only_normal(surface: &dyn Surface) -> Option<Vec3> {
    let size = surface.size();
    let mut row = SurfaceRow::flat(size.width);
    surface.read_row(0, &mut row);
    let normal = row.normal(0);
    let same = (0..size.height).all(|y| {
        surface.read_row(y, &mut row);
        (0..size.width).all(|x| row.normal(x) == normal)
    });
    same.then_some(normal)
}

fn is_mirrored(sampler: &gltf::texture::Sampler<'_>) -> bool {
    [sampler.wrap_s(), sampler.wrap_t()].contains(&gltf::texture::WrappingMode::MirroredRepeat)
}

fn wraps(sampler: &gltf::texture::Sampler<'_>) -> Wraps {
    let wrap =
        |mode| if mode == gltf::texture::WrappingMode::ClampToEdge { Wrap::Clamp } else { Wrap::Repeat };
    Wraps { x: wrap(sampler.wrap_s()), y: wrap(sampler.wrap_t()) }
}

/// Walk over the nodes that collects their meshes.
struct Walk<'a> {
    files: &'a Files<'a>,
    plain: usize,
    meshes: Vec<(RawMesh, usize)>,
    /// Nodes visited: a tree has each once.
    seen: HashSet<usize>,
    /// Vertices and indices so far.
    elements: usize,
    /// Number of primitives left out, which are lines or points.
    left_out: usize,
    /// Some primitive has colours of its vertices.
    coloured: bool,
}

impl Walk<'_> {
    fn node(&mut self, node: &gltf::Node<'_>, above: Mat4, depth: usize) -> Result<(), MapError> {
        if depth > MAX_DEPTH {
            return Err(MapError::invalid(self.files.path, format!("has nodes more than {MAX_DEPTH} deep")));
        }
        if !self.seen.insert(node.index()) {
            return Err(MapError::invalid(
                self.files.path,
                format!("has its node {} in two places", node.index()),
            ));
        }
        let pose = above * Mat4::from_cols_array_2d(&node.transform().matrix());
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            use gltf::mesh::Mode;
            self.coloured |= primitive.get(&gltf::Semantic::Colors(0)).is_some();
            if matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
                let mesh = self.primitive(&primitive, pose)?;
                self.meshes.push((mesh, primitive.material().index().unwrap_or(self.plain)));
            } else {
                self.left_out += 1;
            }
        }
        for child in node.children() {
            self.node(&child, pose, depth + 1)?;
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &gltf::Primitive<'_>, pose: Mat4) -> Result<RawMesh, MapError> {
        let path = self.files.path;
        let held: usize = self.files.buffers.iter().map(|b| b.len()).sum();
        let counts =
            primitive.attributes().map(|(_, a)| a.count()).chain(primitive.indices().map(|a| a.count()));
        for count in counts {
            if count > held {
                return Err(MapError::invalid(path, "announces more vertices than its buffers can hold"));
            }
            self.elements += count;
        }
        if self.elements > 4 * MAX_ELEMENTS {
            return Err(MapError::unsupported(
                path,
                format!("has more than {MAX_ELEMENTS} vertices or triangles"),
            ));
        }
        let reader = primitive.reader(|buffer| self.files.buffers.get(buffer.index()).map(|b| &**b));
        let rotation = Mat3::from_mat4(pose);
        let normal_matrix = rotation.inverse().transpose();
        let mirrored = rotation.determinant() < 0.0;
        let positions: Vec<Vec3> = reader
            .read_positions()
            .ok_or_else(|| MapError::invalid(path, "has a mesh without positions, or outside its buffer"))?
            .map(|p| pose.transform_point3(p.into()))
            .collect();
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..positions.len() as u32).collect(),
        };
        let mut triangles = triangles(&indices, primitive.mode());
        if mirrored {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let laying = Laying::of(&primitive.material());
        let sign = if mirrored { -1.0 } else { 1.0 };
        let normals: Vec<Vec3> = reader
            .read_normals()
            .map(|n| n.map(|n| normal_matrix * Vec3::from(n)).collect())
            .unwrap_or_default();
        // Tangents without normals belong to normals that are missing; both are made anew.
        let tangents = reader.read_tangents().filter(|_| !normals.is_empty());
        Ok(RawMesh {
            positions,
            normals,
            uvs: reader
                .read_tex_coords(laying.set)
                .map(|uv| uv.into_f32().map(|uv| laying.transform.apply(uv.into())).collect())
                .unwrap_or_default(),
            tangents: tangents
                .map(|t| {
                    let turned = |t: [f32; 4]| {
                        let t = Vec4::from(t);
                        (rotation * t.truncate()).extend(sign * t.w)
                    };
                    t.map(turned).collect()
                })
                .unwrap_or_default(),
            triangles,
        })
    }
}

/// Triangles of a list, strip or fan of vertices, all of them turned alike (glTF 2.0, 3.7.2.1).
fn triangles(indices: &[u32], mode: gltf::mesh::Mode) -> Vec<[u32; 3]> {
    match mode {
        gltf::mesh::Mode::TriangleStrip => {
            let turned = |(i, t): (usize, &[u32])| match i % 2 {
                0 => [t[0], t[1], t[2]],
                _ => [t[0], t[2], t[1]],
            };
            // Strips are joined by triangles without area.
            let whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
            indices.windows(3).enumerate().map(turned).filter(whole).collect()
        }
        gltf::mesh::Mode::TriangleFan => {
            indices.iter().skip(1).zip(indices.iter().skip(2)).map(|(a, b)| [*a, *b, indices[0]]).collect()
        }
        _ => indices.as_chunks().0.to_vec(),
    }
}

/// Transform of a texture's coordinates, `KHR_texture_transform`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TextureTransform {
    offset: Vec2,
    /// Radians, counter-clockwise as seen with v down.
    rotation: f32,
    scale: Vec2,
}

impl TextureTransform {
    const IDENTITY: Self = Self { offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE };

    /// Coordinates scaled, then rotated, then moved.
    fn apply(&self, uv: Vec2) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let uv = uv * self.scale;
        Vec2::new(cos * uv.x + sin * uv.y, cos * uv.y - sin * uv.x) + self.offset
    }
}

/// Laying of a texture on a mesh: its set of coordinates, their transform, and its continuation beyond the
/// edges.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Laying {
    set: u32,
    transform: TextureTransform,
    wraps: Wraps,
}

impl Laying {
    /// Laying of a material's map: of its normals, else of its colours, else of its roughness.
    fn of(material: &gltf::Material<'_>) -> Self {
        let pbr = material.pbr_metallic_roughness();
        let others = || pbr.base_color_texture().or_else(|| pbr.metallic_roughness_texture());
        let plain = Self { set: 0, transform: TextureTransform::IDENTITY, wraps: Wraps::default() };
        let normal = material.normal_texture().map(|normal| Self::of_normal(&normal));
        normal.or_else(|| others().map(|info| Self::of_info(&info))).unwrap_or(plain)
    }

    fn of_info(info: &gltf::texture::Info<'_>) -> Self {
        let (set, wraps) = (info.tex_coord(), wraps(&info.texture().sampler()));
        let Some(own) = info.texture_transform() else {
            return Self { set, transform: TextureTransform::IDENTITY, wraps };
        };
        let (offset, rotation, scale) = (own.offset().into(), own.rotation(), own.scale().into());
        let transform = TextureTransform { offset, rotation, scale };
        Self { set: own.tex_coord().unwrap_or(set), transform, wraps }
    }

    /// Laying of a normal texture, whose extension the crate keeps as plain JSON.
    fn of_normal(normal: &gltf::material::NormalTexture<'_>) -> Self {
        let (set, wraps) = (normal.tex_coord(), wraps(&normal.texture().sampler()));
        let Some(value) = normal.extension_value("KHR_texture_transform") else {
            return Self { set, transform: TextureTransform::IDENTITY, wraps };
        };
        let number = |value: Option<&serde_json::Value>, or: f32| {
            value.and_then(serde_json::Value::as_f64).map_or(or, |v| v as f32)
        };
        let pair = |key: &str, or: f32| {
            let part = |i: usize| number(value.get(key).and_then(|v| v.get(i)), or);
            Vec2::new(part(0), part(1))
        };
        let own = value.get("texCoord").and_then(serde_json::Value::as_u64);
        let own = own.and_then(|own| u32::try_from(own).ok());
        let (offset, rotation, scale) =
            (pair("offset", 0.0), number(value.get("rotation"), 0.0), pair("scale", 1.0));
        let transform = TextureTransform { offset, rotation, scale };
        Self { set: own.unwrap_or(set), transform, wraps }
    }
}
