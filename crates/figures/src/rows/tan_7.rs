//! Tan et al., figure 7: the disk at an oblique angle, against Fournier's Phong peaks.

use ndfmap::Error;
use ndfmap::core::lookup::{Filtering, Lookups};

use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-7",
    paper: Paper::Tan,
    place: "Figure 7",
    summary: "the disk at an oblique angle, by four Gaussians and by Fournier's four Phong peaks",
    draw,
};

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let scene = scene("disk-oblique", plan.map(512)).build(0.0, plan.observer)?;
    let lookups = Lookups::taps(Filtering::anisotropic(16));
    let shot = Shot { lookups, ..Shot::new(plan, &scene, plan.picture(400)) };
    let maps = Maps::bake(plan, &scene, &["gmm:4", "phong:4"])?;
    let shown = shot.shown(&maps, &plan.effort(256), "oblique")?;
    let slower = shot.seconds(&maps, 1)? / shot.seconds(&maps, 0)?;
    let (ours, theirs) = (shown.colour(0), shown.colour(1));
    let claims = vec![
        Claim::number("colour error of four Gaussians", ours).beside(0.041).holds(ours <= 0.041),
        Claim::number("colour error of four Phong peaks", theirs).beside(0.123),
        Claim::number("the first over the second, below 1", ours / theirs)
            .beside(0.041 / 0.123)
            .holds(ours < theirs),
        Claim::number("time of the peaks' frame over the Gaussians', ten or more", slower)
            .beside(120.0 / 13.0)
            .holds(slower >= 120.0 / 13.0),
    ];
    Ok(Drawing {
        sheets: vec![sheet("The disk at an oblique angle", &maps, &[shown])],
        claims,
        why: "Four peaks that are fitted well, and all shaded where a filter would mix them, are nearer to the truth \
              than anything that is filtered: the paper's trouble with them is that of its fit. They pay for it in \
              time, here on the processor.",
    })
}
