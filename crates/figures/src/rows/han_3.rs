//! Han et al., figure 3: a Lambertian plane to the horizon, by harmonics with anisotropic filtering.

use glam::DVec3;
use ndfmap::Error;
use ndfmap::core::light::Light;
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::scene::metrics::Picture;

use super::texels::lobe;
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-3",
    paper: Paper::Han,
    place: "Figure 3",
    summary: "a diffuse plane to the horizon, by nine harmonics with anisotropic filtering",
    draw,
};

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let mut spec = scene("plane", plan.map(512));
    spec.lobe = Some(lobe("lambert"));
    // Nearly level with the plane, whose flat parts it hardly lights.
    let towards = DVec3::new(0.1, 0.12, -1.0).normalize();
    spec.lights = vec![Light::Directional { towards, irradiance: DVec3::splat(3.0) }];
    let scene = spec.build(0.0, plan.observer)?;
    let maps = Maps::bake(plan, &scene, &["sh:2", "naive"])?;
    let lookups = Lookups::taps(Filtering::anisotropic(16));
    let size = plan.picture(320);
    let shown = Shot { lookups, ..Shot::new(plan, &scene, size) }.shown(&maps, &plan.effort(256), "plane")?;
    // An eighth of the picture, below the horizon.
    let horizon = (0..size.height).find(|y| shown.truth.row(*y).iter().all(|c| *c != scene.background));
    let horizon = horizon.ok_or_else(|| Error::Failed("the plane has no horizon".to_owned()))?;
    let far = horizon..(horizon + size.height / 8).min(size.height);
    let light =
        |p: &Picture| far.clone().flat_map(|y| p.row(y)).map(|c| f64::from(c.element_sum())).sum::<f64>();
    let over = |at: usize| light(&shown.pictures[at]) / light(&shown.truth);
    let (ours, naive) = (over(0), over(1));
    let claims = vec![
        Claim::number("light of far regions over the truth's, by nine harmonics: within 5 %", ours)
            .holds((ours - 1.0).abs() < 0.05),
        Claim::number("the same by average normals: darker (below 1)", naive).holds(naive < 1.0),
        Claim::number("L2 error by nine harmonics, below that of average normals", shown.l2(0))
            .holds(shown.l2(0) < shown.l2(1)),
        Claim::number("L2 error by average normals", shown.l2(1)),
    ];
    Ok(Drawing {
        sheets: vec![sheet("A diffuse plane under a low light", maps.names(), &[shown])],
        claims,
        why: "The paper prints no number. The light is nearly level with the plane, so that its \
              flat average is hardly lit; up close nine harmonics clamp the cosine softly, which a \
              single normal does not.",
    })
}
