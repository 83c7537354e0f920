//! Han et al., figure 2: a colour-coded map at three distances.

use glam::{DVec2, DVec3};
use ndfmap::Error;
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::scene::{Camera, Mesh, Object, Scene};

use super::colours::{Paint, by_direction, painted};
use super::texels::lobe;
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-2",
    paper: Paper::Han,
    place: "Figure 2",
    summary: "a map coloured by the direction of its normals, at three distances",
    draw,
};

/// Distances of the eye, and the names of the rows.
const DISTANCES: [(&str, f64); 3] = [("close", 2.0), ("farther", 16.0), ("far", 48.0)];

/// A square that faces the eye, with colours by direction.
fn square(plan: &Plan<'_>) -> Result<Scene, Error> {
    let mut scene = scene("foil", plan.map(512)).build(0.0, plan.observer)?;
    let flat = Mesh::from_patch((1, 1), DVec2::splat(16.0), |s, t| {
        DVec3::new(32.0 * s - 16.0, 32.0 * t - 16.0, 0.0)
    });
    scene.objects = vec![Object { mesh: flat.into(), material: 0 }];
    let material = &mut scene.materials[0];
    material.brdf =
        ndfmap::core::brdf::Brdf::new(lobe("blinn-phong:100"), ndfmap::core::brdf::ShadingModel::Han);
    material.textures = Some(painted(&*material.map, Paint { diffuse: 0.0, specular: 0.15 }, by_direction));
    Ok(scene)
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let mut scene = square(plan)?;
    let maps = Maps::bake(plan, &scene, &["vmf:6", "toksvig", "naive", "naive:unnormalised"])?;
    let (mut all, mut claims) = (Vec::new(), Vec::new());
    for (name, distance) in DISTANCES {
        scene.camera = Camera::new([0.0, 0.0, distance], [0.0; 3], 40.0);
        let lookups = Lookups::taps(Filtering::TRILINEAR);
        let shot = Shot { lookups, ..Shot::new(plan, &scene, plan.picture(240)) };
        all.push(shot.shown(&maps, &plan.effort(256), name)?);
    }
    for shown in &all[1..] {
        let (ours, toksvig, naive) = (shown.l2(0), shown.l2(1), shown.l2(2));
        let head = &shown.head;
        claims.push(
            Claim::number(format!("{head}: L2 error of vmf:6, below Toksvig's"), ours).holds(ours < toksvig),
        );
        claims.push(Claim::number(format!("{head}: L2 error of Toksvig's method"), toksvig));
        claims.push(
            Claim::number(format!("{head}: L2 error of normalised mip maps, above that of vmf:6"), naive)
                .holds(naive > ours),
        );
        let light = |p: &ndfmap::scene::metrics::Picture| {
            let covered =
                p.texels().iter().zip(shown.truth.texels()).filter(|(_, t)| **t != scene.background);
            covered.map(|(c, _)| f64::from(c.element_sum())).sum::<f64>()
        };
        let dark = light(&shown.pictures[3]) / light(&shown.truth);
        claims.push(
            Claim::number(
                format!("{head}: light of unnormalised mip maps over the truth's, next to black"),
                dark,
            )
            .holds(dark < 0.1),
        );
    }
    Ok(Drawing {
        sheets: vec![sheet("Normals coloured by their direction", maps.names(), &all)],
        claims,
        why: "Crumpled foil in place of the paper's map, a mirror without diffuse light. Lobes \
              carry the mean colour of their own normals, so that a highlight has the colour of \
              the facets that send it.",
    })
}
