//! Tan et al., figure 8: golden armour near and far, against a fixed reflectance.

use ndfmap::Error;

use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-8",
    paper: Paper::Tan,
    place: "Figure 8",
    summary: "golden armour near and far, and with a fixed reflectance",
    draw,
};

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let spec = scene("armour", plan.map(512));
    let maps = Maps::bake(plan, &spec.build(0.0, plan.observer)?, &["gmm:4", "vmf:4", "fixed"])?;
    let mut all = Vec::new();
    for (name, time) in [("near", 0.0), ("far", 0.5), ("farthest", 1.0)] {
        let scene = spec.build(time, plan.observer)?;
        all.push(Shot::new(plan, &scene, plan.picture(400)).shown(&maps, &plan.effort(256), name)?);
    }
    let far = &all[1];
    let (ours, fixed) = (far.colour(0), far.colour(2));
    let ratio = 0.058 / 0.175;
    let claims = vec![
        Claim::number("far: colour error of four Gaussians", ours).beside(0.058),
        Claim::number("far: colour error of the fixed reflectance", fixed).beside(0.175),
        Claim::number("far: the first over the second", ours / fixed)
            .beside(ratio)
            .holds(ours / fixed <= ratio),
        Claim::number("far: vmf:4 over the fixed reflectance", far.colour(1) / fixed),
        Claim::number(
            "farthest: four Gaussians over the fixed reflectance",
            all[2].colour(0) / all[2].colour(2),
        ),
    ];
    Ok(Drawing {
        sheets: vec![sheet("Golden armour", maps.names(), &all)],
        claims,
        why: "A fixed reflectance keeps the shine of one scale where a pixel covers many. Absolute \
              errors are of another armour; the ratio is judged, and depends on the distance.",
    })
}
