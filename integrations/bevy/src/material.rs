//! Extension of the standard material, and the component that lets an entity have it.

use std::collections::HashMap;

use bevy::material::OpaqueRendererMethod;
use bevy::mesh::MeshVertexBufferLayoutRef;
use bevy::pbr::{ExtendedMaterial, MaterialExtension, MaterialExtensionKey, MaterialExtensionPipeline};
use bevy::prelude::*;
use bevy::render::render_resource::{
    AsBindGroup, RenderPipelineDescriptor, ShaderType, SpecializedMeshPipelineError,
};
use bevy::shader::{ShaderDefVal, ShaderRef};

use crate::file::MOST_LOBES;
use crate::map::NdfMap;

/// Standard material whose normals are a map's lobes.
pub type NdfMaterial = ExtendedMaterial<StandardMaterial, NdfLobes>;

/// Ranges of the channels, as the shader has them.
#[derive(ShaderType, Clone, Debug, Default)]
struct Ranges {
    low: [Vec4; MOST_LOBES],
    span: [Vec4; MOST_LOBES],
    size: Vec2,
    from_level: f32,
    anisotropy: f32,
}

/// Extension of the standard material: a map of lobes. [`NdfMap::material`] makes it.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
#[bind_group_data(Lobes)]
pub struct NdfLobes {
    #[texture(100, dimension = "2d_array")]
    #[sampler(101)]
    image: Handle<Image>,
    #[uniform(102)]
    ranges: Ranges,
    lobes: usize,
}

/// Number of lobes, of which each has a shader of its own.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Lobes(u32);

impl From<&NdfLobes> for Lobes {
    fn from(extension: &NdfLobes) -> Self {
        Self(extension.lobes as u32)
    }
}

impl MaterialExtension for NdfLobes {
    fn fragment_shader() -> ShaderRef {
        "embedded://bevy_ndfmap/material.wgsl".into()
    }

    fn specialize(
        _: &MaterialExtensionPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        key: MaterialExtensionKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        // Without tangents Bevy's own normal maps do nothing; here it is an error, which Bevy logs. The same
        // goes for coordinates.
        layout.0.get_layout(&[
            Mesh::ATTRIBUTE_TANGENT.at_shader_location(0),
            Mesh::ATTRIBUTE_UV_0.at_shader_location(1),
        ])?;
        if let Some(fragment) = &mut descriptor.fragment {
            fragment.shader_defs.push(ShaderDefVal::UInt("NDF_LOBES".into(), key.bind_group_data.0));
            fragment.shader_defs.push(ShaderDefVal::UInt("NDF_MOST".into(), MOST_LOBES as u32));
        }
        Ok(())
    }
}

/// Reason why a material cannot have lobes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Refusal {
    /// The map takes the place of a normal map, which near by is what is seen.
    #[error("has no normal map, whose place a map takes")]
    NoNormalMap,
    /// Part of the material that lobes do not have.
    #[error("has {0}, which lobes do not have")]
    Part(&'static str),
}

impl NdfMap {
    /// Returns a standard material with this map's lobes. It is drawn forward.
    ///
    /// # Errors
    /// [`Refusal`] for a material without a normal map, and for one with parts that lobes do not have.
    pub fn material(&self, base: &StandardMaterial) -> Result<NdfMaterial, Refusal> {
        if base.normal_map_texture.is_none() {
            return Err(Refusal::NoNormalMap);
        }
        if base.depth_map.is_some() {
            return Err(Refusal::Part("a depth map"));
        }
        let others = [
            ("a clear coat", base.clearcoat),
            ("anisotropy", base.anisotropy_strength),
            ("specular transmission", base.specular_transmission),
            ("diffuse transmission", base.diffuse_transmission),
        ];
        if let Some((what, _)) = others.iter().find(|(_, strength)| *strength > 0.0) {
            return Err(Refusal::Part(what));
        }
        let filled = |values: &[Vec4]| std::array::from_fn(|j| values.get(j).copied().unwrap_or_default());
        let ranges = Ranges {
            low: filled(&self.low),
            span: filled(&self.span),
            size: self.size,
            from_level: self.from_level as f32,
            anisotropy: f32::from(self.anisotropy),
        };
        let extension = NdfLobes { image: self.image.clone(), ranges, lobes: self.lobes };
        let base = StandardMaterial { opaque_render_method: OpaqueRendererMethod::Forward, ..base.clone() };
        Ok(ExtendedMaterial { base, extension })
    }
}

/// Map of an entity with a standard material: once both are loaded, the entity has a [`NdfMaterial`] instead.
/// Entities that share material and map share the new one.
#[derive(Component, Clone, Debug, Deref)]
pub struct NdfMap3d(pub Handle<NdfMap>);

/// Materials that were made and are in use, by those that they were made of.
#[derive(Resource, Default)]
pub(crate) struct Made(HashMap<(AssetId<StandardMaterial>, AssetId<NdfMap>), AssetId<NdfMaterial>>);

/// Forgets materials whose material or map changed, so that what comes after has the new one.
pub(crate) fn forget(
    mut made: ResMut<Made>,
    mut materials: MessageReader<AssetEvent<StandardMaterial>>,
    mut maps: MessageReader<AssetEvent<NdfMap>>,
) {
    for event in materials.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } = event {
            made.0.retain(|(material, _), _| material != id);
        }
    }
    for event in maps.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } = event {
            made.0.retain(|(_, map), _| map != id);
        }
    }
}

type Waiting<'w, 's> = Query<'w, 's, (Entity, &'static NdfMap3d, &'static MeshMaterial3d<StandardMaterial>)>;

/// Gives entities their new material.
pub(crate) fn apply(
    mut commands: Commands,
    waiting: Waiting,
    maps: Res<Assets<NdfMap>>,
    (standard, mut materials): (Res<Assets<StandardMaterial>>, ResMut<Assets<NdfMaterial>>),
    mut made: ResMut<Made>,
) {
    for (entity, map, own) in &waiting {
        let (Some(loaded), Some(base)) = (maps.get(&map.0), standard.get(&own.0)) else { continue };
        let key = (own.id(), map.id());
        let known = made.0.get(&key).and_then(|id| materials.get_strong_handle(*id));
        let material = match known {
            Some(material) => material,
            None => match loaded.material(base) {
                Ok(material) => {
                    let material = materials.add(material);
                    made.0.insert(key, material.id());
                    material
                }
                Err(refusal) => {
                    error!("{entity}: the material {refusal}");
                    commands.entity(entity).remove::<NdfMap3d>();
                    continue;
                }
            },
        };
        commands.entity(entity).remove::<MeshMaterial3d<StandardMaterial>>().insert(MeshMaterial3d(material));
    }
}
