//! Han et al., figure 4: two measured materials, near and far, by harmonics.

use ndfmap::Error;

use super::texels::{builtin, lobe};
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-4",
    paper: Paper::Han,
    place: "Figure 4",
    summary: "two materials of the Matusik database, near and far, by 64 harmonics",
    draw,
};

/// Materials, by the fits of Bagher et al.
const MATERIALS: [&str; 2] = ["sgd:green-latex", "sgd:gold-metallic-paint"];

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let mut spec = scene("sphere", plan.map(512));
    spec.map = Some(builtin(plan, "foil", 512)?.surface.into());
    let maps = Maps::bake(plan, &spec.build(0.0, plan.observer)?, &["sh:7", "vmf:6", "naive"])?;
    let (mut all, mut claims) = (Vec::new(), Vec::new());
    for material in MATERIALS {
        spec.lobe = Some(lobe(material));
        for (name, time) in [("near", 0.1), ("far", 0.6)] {
            let scene = spec.build(time, plan.observer)?;
            let head = format!("{}, {name}", material.trim_start_matches("sgd:"));
            let shown = Shot::new(plan, &scene, plan.picture(300)).shown(&maps, &plan.effort(64), &*head)?;
            let (ours, naive) = (shown.l2(0), shown.l2(2));
            claims.push(
                Claim::number(format!("{head}: L2 error of sh:7, below average normals'"), ours)
                    .holds(ours < naive),
            );
            claims.push(Claim::number(format!("{head}: L2 error of vmf:6"), shown.l2(1)));
            claims.push(Claim::number(format!("{head}: L2 error of average normals"), naive));
            all.push(shown);
        }
    }
    Ok(Drawing {
        sheets: vec![sheet("Measured materials", maps.names(), &all)],
        claims,
        why: "The truth is the material itself; pictures are shaded by its factors, as the paper \
              proposes, so that their errors hold those of factoring too.",
    })
}
