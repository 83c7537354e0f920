//! Tan et al., figure 1: a desert whose reflectance changes as one moves away.

use glam::Vec3;
use ndfmap::Error;

use super::colours::{Paint, painted};
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-1",
    paper: Paper::Tan,
    place: "Figure 1",
    summary: "a desert at three distances",
    draw,
};

/// Sand that is darker in the troughs.
fn sand(_normal: Vec3, height: f32) -> Vec3 {
    Vec3::new(0.5, 0.33, 0.18).lerp(Vec3::new(0.8, 0.56, 0.32), height)
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let spec = scene("desert", plan.map(512));
    let (mut all, mut claims) = (Vec::new(), Vec::new());
    let first = spec.build(0.0, plan.observer)?;
    let textures = painted(&*first.materials[0].map, Paint { diffuse: 1.0, specular: 0.0 }, sand);
    let painted = |time: f64| -> Result<_, Error> {
        let mut scene = spec.build(time, plan.observer)?;
        scene.materials[0].textures = Some(textures.clone());
        Ok(scene)
    };
    let maps = Maps::bake(plan, &painted(0.0)?, &["fixed", "gmm:4:prior", "gmm:4", "vmf:4"])?;
    for (name, time) in [("near", 0.0), ("farther", 0.5), ("far", 1.0)] {
        let shown =
            Shot::new(plan, &painted(time)?, plan.picture(320)).shown(&maps, &plan.effort(64), name)?;
        let says = |method: &str| format!("{name}: colour error of {method}");
        claims.push(Claim::number(says("the fixed reflectance"), shown.colour(0)));
        let ours = shown.colour(2);
        claims.push(Claim::number(says("gmm:4, below the fixed one's"), ours).holds(ours < shown.colour(0)));
        claims.push(Claim::number(says("vmf:4"), shown.colour(3)));
        all.push(shown);
    }
    Ok(Drawing {
        sheets: vec![sheet("A desert at three distances", maps.names(), &all)],
        claims,
        why: "The paper shows photographs beside its pictures, and no number. Judged are planar \
              lobes, the paper's; spherical ones stand beside them.",
    })
}
