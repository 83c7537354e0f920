//! The processor renders: `ndfmap-trace`.

use std::time::Instant;

use ndfmap_core::compact::Storage;
use ndfmap_core::grid::Size;
use ndfmap_core::lookup::Lookups;
use ndfmap_core::ndf::AnyMethod;
use ndfmap_core::observe::Observer;
use ndfmap_scene::{Effort, Material, Scene, TruePicture};
use ndfmap_trace::Geometry;
use ndfmap_trace::filtered::{BakedMaps, Filtered};
use ndfmap_trace::truth::Truth;

use super::{DeviceReport, Engine, RenderedPicture, TrueGeometry, View};
use crate::Error;

/// The processor.
pub(crate) struct Cpu;

impl Engine for Cpu {
    type Maps = BakedMaps;
    type Set = Geometry;

    fn describe(&self) -> DeviceReport {
        DeviceReport::Cpu
    }

    fn bake(
        &self,
        materials: &[Material],
        method: &AnyMethod,
        storage: Storage,
        observer: &dyn Observer,
    ) -> Result<BakedMaps, Error> {
        Ok(BakedMaps::new(materials, method, storage, observer)?)
    }

    fn set(&self, scene: &Scene, size: Size) -> Result<Geometry, Error> {
        if let Some(environment) = &scene.environment {
            // Tables that are made once count as no frame's time.
            for material in &scene.materials {
                environment.filtered.make(environment.technique, material.brdf.lobe.microfacets());
            }
        }
        Ok(Geometry::displaced(scene, &scene.camera, size))
    }

    fn truth(
        &self,
        view: &View<'_, Geometry>,
        effort: &Effort,
        observer: &dyn Observer,
    ) -> Result<TruePicture, Error> {
        if !view.scene.is_displaced() {
            let truth = Truth::new(view.scene, view.set);
            return Ok(truth.render(&view.camera, view.size, effort, observer)?);
        }
        let true_geometry = TrueGeometry::new(view.scene, observer);
        Ok(true_geometry.truth(view.scene).render(&view.camera, view.size, effort, observer)?)
    }

    fn draw(
        &self,
        view: &View<'_, Geometry>,
        maps: &BakedMaps,
        lookups: Lookups,
        observer: &dyn Observer,
    ) -> Result<RenderedPicture, Error> {
        let filtered = Filtered { scene: view.scene, geometry: view.set, maps };
        let start = Instant::now();
        let picture = filtered.render(&view.camera, view.size, lookups, observer)?;
        Ok(RenderedPicture { picture, milliseconds: start.elapsed().as_secs_f64() * 1e3 })
    }
}
