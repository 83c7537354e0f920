//! The processor renders: `ndfmap-trace`.

use std::time::Instant;

use ndfmap_core::grid::Size;
use ndfmap_core::ndf::Method;
use ndfmap_core::pyramid::Precision;
use ndfmap_core::scene::{Material, Scene};
use ndfmap_trace::Geometry;
use ndfmap_trace::filtered::{BakedMaps, Filtered, Lookups};
use ndfmap_trace::truth::{Effort, TruePicture, Truth};
use serde_json::{Value, json};

use super::{Engine, RenderedPicture, TrueGeometry, View};
use crate::Failure;

/// The processor.
pub(crate) struct Cpu;

impl Engine for Cpu {
    type Maps<'a> = BakedMaps<'a>;
    type Set = Geometry;

    fn describe(&self) -> Value {
        json!({ "device": "cpu" })
    }

    fn bake<'a>(
        &'a self,
        materials: &[Material],
        method: &'a dyn Method,
        precision: Precision,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<BakedMaps<'a>, Failure> {
        Ok(BakedMaps::new(materials, method, precision, progress))
    }

    fn set(&self, scene: &Scene, size: Size) -> Result<Geometry, Failure> {
        if let Some(environment) = &scene.environment {
            // Made once, and no frame's time.
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
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<TruePicture, Failure> {
        if !view.scene.is_displaced() {
            return Ok(Truth::new(view.scene, view.set).render(&view.camera, view.size, effort, progress));
        }
        let true_geometry = TrueGeometry::new(view.scene);
        Ok(true_geometry.truth(view.scene).render(&view.camera, view.size, effort, progress))
    }

    fn draw(
        &self,
        view: &View<'_, Geometry>,
        maps: &BakedMaps<'_>,
        lookups: Lookups,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<RenderedPicture, Failure> {
        let filtered = Filtered { scene: view.scene, geometry: view.set, maps, progress };
        let start = Instant::now();
        let picture = filtered.render(&view.camera, view.size, lookups);
        Ok(RenderedPicture { picture, milliseconds: start.elapsed().as_secs_f64() * 1e3 })
    }
}
