//! Tan et al., figure 6: the disk through unaligned and through aligned mixtures.

use ndfmap::Error;

use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-6",
    paper: Paper::Tan,
    place: "Figure 6",
    summary: "the disk through unaligned mixtures, by brute force, and through aligned ones",
    draw,
};

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let scene = scene("disk", plan.map(512)).build(0.0, plan.observer)?;
    let maps = Maps::bake(plan, &scene, &["gmm:4:unaligned", "gmm:4:prior", "gmm:4"])?;
    let shown = Shot::new(plan, &scene, plan.picture(400)).shown(&maps, &plan.effort(256), "disk")?;
    let unaligned = shown.colour(0);
    let below = |says: &str, at: usize| {
        let ours = shown.colour(at);
        Claim::number(says, ours).holds(ours < unaligned)
    };
    let claims = vec![
        Claim::number("colour error, unaligned", unaligned),
        below("colour error, aligned by the paper's prior", 1),
        below("colour error, aligned by ours", 2),
    ];
    Ok(Drawing {
        sheets: vec![sheet("Alignment of mixtures", maps.names(), &[shown])],
        claims,
        why: "The paper prints no number here, and says that details are lost without alignment.",
    })
}
