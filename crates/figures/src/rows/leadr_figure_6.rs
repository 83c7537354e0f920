//! Dupuy et al., supplemental, figure 6: mean normals that face away at the silhouette.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use ndfmap::Error;
use ndfmap::core::light::Light;
use ndfmap::core::lookup::Lookups;
use ndfmap::draw::{Panel, Sheet, SheetRow};
use ndfmap::scene::Camera;
use ndfmap::scene::metrics::to_bytes;
use ndfmap::trace::Geometry;

use super::texels::lobe;
use crate::shot::{Maps, Shot, scene};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "leadr-figure-6",
    paper: Paper::Leadr,
    place: "Figure 6",
    summary: "silhouettes where mean normals face away, by the printed division and by ours",
    draw,
};

/// Pictures around the sphere.
const PICTURES: u32 = 12;

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let size = ndfmap::core::grid::Size { width: 96, height: 96 };
    let mut scene = scene("noise-sphere", ndfmap::core::grid::Size { width: 256, height: 256 })
        .build(0.0, plan.observer)?;
    scene.displace(2.0, false).map_err(|e| Error::Failed(e.to_string()))?;
    scene.materials[0].params.diffuse = DVec3::ZERO;
    // Its tails are never too thin for a float.
    scene.materials[0].brdf.lobe = lobe("ggx:0.3");
    let maps = Maps::bake(plan, &scene, &["slopes"])?;
    let (mut undefined, mut panels) = ([0_usize; 2], vec![None, None]);
    for turn in 0..PICTURES {
        let (sin, cos) = (TAU * f64::from(turn) / f64::from(PICTURES)).sin_cos();
        let eye = DVec3::new(3.5 * sin, 0.4, 3.5 * cos);
        scene.camera = Camera::new(eye.to_array(), [0.0; 3], 35.0);
        scene.lights = vec![Light::Directional { towards: eye.normalize(), irradiance: DVec3::ONE }];
        let geometry = Geometry::displaced(&scene, &scene.camera, size);
        let rays = scene.camera.rays(size);
        for (at, at_means) in [true, false].into_iter().enumerate() {
            let lookups = Lookups { at_means, ..Lookups::TRILINEAR };
            let picture = &Shot { lookups, ..Shot::new(plan, &scene, size) }.filtered(&maps)?[0];
            let bad = |x: usize, y: usize| {
                let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let colour = picture.row(y)[x];
                geometry.hit(rays.eye, rays.direction(place)).is_some()
                    && !(colour.is_finite() && colour.x > 0.0)
            };
            let mut bytes = to_bytes(picture, 6.0);
            let mut here = 0;
            for y in 0..size.height {
                for x in 0..size.width {
                    if bad(x, y) {
                        bytes.row_mut(y)[x] = [255, 0, 160];
                        here += 1;
                    }
                }
            }
            undefined[at] += here;
            // The worst picture without, and the same with.
            if at == 0 && panels[0].as_ref().is_none_or(|(most, _)| here > *most) {
                panels = vec![Some((here, bytes)), None];
            } else if at == 1 && panels[1].is_none() {
                panels[1] = Some((here, bytes));
            }
        }
    }
    let shown = panels.into_iter().map(|p| {
        p.map(|(n, bytes)| {
            Panel::of(ndfmap::draw::enlarged(&bytes, 380)).said([format!("{n} undefined pixels")])
        })
    });
    let rows = vec![SheetRow { head: Vec::new(), panels: shown.collect() }];
    let columns = ["printed form", "exact area, artificial normal"].map(str::to_owned).to_vec();
    let title = "A rough sphere lit from the eye; undefined pixels are pink".to_owned();
    let claims = vec![
        Claim::number(
            format!("undefined pixels of {PICTURES} pictures by the printed form: some"),
            undefined[0] as f64,
        )
        .holds(undefined[0] > 0),
        Claim::number("the same by the exact area with the artificial normal: none", undefined[1] as f64)
            .holds(undefined[1] == 0),
    ];
    Ok(Drawing {
        sheets: vec![Sheet { title, columns, rows, scale: None }],
        claims,
        why: "A pixel is undefined that the sphere covers and that sends nothing, or no number; \
              the pair is the turn with the most of them. The printed form divides by the \
              projected area of the mean normal, without the artificial normal; ours divides by \
              the exact area of all facets that are seen, with it. The paper shows its sampling \
              schemes, this is a light from the eye.",
    })
}
