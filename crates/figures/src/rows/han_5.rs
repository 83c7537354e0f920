//! Han et al., figure 5: cloth that drapes over a sphere, in blue fabric.

use ndfmap::Error;

use super::texels::lobe;
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-5",
    paper: Paper::Han,
    place: "Figure 5",
    summary: "stills of cloth that drapes over a sphere, in measured blue fabric, by 64 harmonics",
    draw,
};

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let mut spec = scene("cloth", plan.map(512));
    spec.lobe = Some(lobe("sgd:blue-fabric"));
    let maps = Maps::bake(plan, &spec.build(0.0, plan.observer)?, &["sh:7", "naive"])?;
    let (mut all, mut claims) = (Vec::new(), Vec::new());
    for time in [0.4, 0.7, 1.0] {
        let scene = spec.build(time, plan.observer)?;
        let head = format!("time {time}");
        let shown = Shot::new(plan, &scene, plan.picture(320)).shown(&maps, &plan.effort(64), &*head)?;
        let (ours, naive) = (shown.l2(0), shown.l2(1));
        let says = format!("{head}: L2 error of sh:7, correct filtering (below 0.02)");
        claims.push(Claim::number(says, ours).holds(ours < 0.02));
        let says = format!("{head}: the same over that of average normals, below 1");
        claims.push(Claim::number(says, ours / naive).holds(ours < naive));
        all.push(shown);
    }
    Ok(Drawing {
        sheets: vec![sheet("Cloth in blue fabric", maps.names(), &all)],
        claims,
        why: "The paper shows stills and no number, and says that filtering is correct. The bound \
              of 0.02 is ours.",
    })
}
