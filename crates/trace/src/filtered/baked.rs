//! Baked materials: look-ups of their maps' channels and of their surface parameters.

use glam::{DMat2, DVec3};
use ndfmap_core::compact::Storage;
use ndfmap_core::lookup::{Lookup, Lookups, PixelFootprint, Texels};
use ndfmap_core::ndf::{
    AnyMethod, FilteredTexel, IncidentLight, LobeLayout, LocalEnvironment, Method, PreparedBrdf,
};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_scene::{BakedMaterial, Material, SurfaceTextures};

/// Baked map of one material. Lights, BRDFs and models come in when shading.
pub(super) struct Baked {
    map: Lookup,
    /// Layers of the method itself; those of attributes follow.
    layers: usize,
    /// Layout of the lobes that carry colours and roughness; `None` where `params` has them.
    carriers: Option<LobeLayout>,
    /// Colours and roughness, for methods whose lobes carry none.
    params: Vec<Lookup>,
}

/// A material as it is shaded with one method.
pub(super) struct Shading<'a> {
    pub(super) material: &'a Material,
    pub(super) method: &'a dyn Method,
    pub(super) prepared: &'a PreparedBrdf,
    /// Matrix that takes slopes of the map to the surface, where it is displaced.
    pub(super) slope_map: Option<DMat2>,
    /// Environment as the place sees it, if there is one.
    pub(super) local: Option<LocalEnvironment<'a>>,
}

impl Baked {
    /// Bakes the map, with colours and roughness in the lobes where the method has lobes that can carry them.
    pub(super) fn new(
        material: &Material,
        method: &AnyMethod,
        storage: Storage,
        observer: &dyn Observer,
    ) -> Result<Self, Cancelled> {
        let baked = BakedMaterial::new(material, &**method, storage, observer)?;
        let wraps = material.map.wraps();
        Ok(Self {
            map: Lookup::new(&baked.pyramid),
            layers: method.layers(),
            carriers: method.lobe_layout().filter(|_| baked.attributes > 0),
            params: baked.params.iter().map(|values| Lookup::of_values(values, wraps)).collect(),
        })
    }

    /// Light that the pixel sends to the eye.
    pub(super) fn shade(
        &self,
        shading: &Shading<'_>,
        pixel: &PixelFootprint,
        lookups: Lookups,
        (channels, lights): (&mut Vec<f32>, &[IncidentLight]),
    ) -> DVec3 {
        let filtering = lookups.sampling.filtering();
        let mut colours = [[0.0; 4]; 2];
        for (lookup, colour) in self.params.iter().zip(&mut colours) {
            lookup.filtered(pixel, filtering, colour);
        }
        if lookups.neighbours || !shading.method.filterable() {
            let (count, taps) = self.map.taps(pixel, filtering);
            let mut sum = DVec3::ZERO;
            for n in taps.flat_map(|tap| self.map.neighbours(tap)) {
                let texel = self.map.texel(n.level, n.x, n.y);
                sum += n.weight * self.reflect(shading, (texel, &colours), lookups, lights);
            }
            return sum / count as f64;
        }
        channels.resize(self.map.channels(), 0.0);
        self.map.filtered(pixel, filtering, channels);
        self.reflect(shading, (channels, &colours), lookups, lights)
    }

    fn reflect(
        &self,
        shading: &Shading<'_>,
        (channels, colours): (&[f32], &[[f32; 4]; 2]),
        lookups: Lookups,
        lights: &[IncidentLight],
    ) -> DVec3 {
        let material = shading.material;
        let params = |lobe: Option<usize>| match (&material.textures, lobe, self.carriers) {
            (Some(_), Some(lobe), Some(layout)) => {
                let attribute = |k: usize| layout.attribute(channels, k, lobe);
                SurfaceTextures::from_channels(
                    attribute(0).unwrap_or_default(),
                    attribute(1),
                    material.params.specular,
                )
            }
            (Some(_), ..) if !self.params.is_empty() => SurfaceTextures::from_channels(
                colours[0],
                (self.params.len() > 1).then_some(colours[1]),
                material.params.specular,
            ),
            _ => material.params,
        };
        let texel = FilteredTexel {
            channels: &channels[..4 * self.layers],
            params: &params,
            prepared: shading.prepared,
            at_means: lookups.at_means,
            slope_map: shading.slope_map,
        };
        let method = shading.method;
        let of_environment = |local| method.reflect_environment(&texel, local);
        method.reflect(&texel, lights) + shading.local.as_ref().map_or(DVec3::ZERO, of_environment)
    }
}
