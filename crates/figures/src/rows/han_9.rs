//! Han et al., figure 9: a model in environment lighting, by six lobes and harmonics to order eight.

use ndfmap::Error;
use ndfmap::core::light::environment::{SceneEnvironment, Technique, builtin};

use super::texels::lobe;
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-9",
    paper: Paper::Han,
    place: "Figure 9",
    summary: "a model in an environment that turns, by six lobes and harmonics to order eight",
    draw,
};

/// Light from everywhere.
const ENVIRONMENT: &str = "studio";

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let mut spec = scene("creature", plan.map(512));
    spec.lobe = Some(lobe("blinn-phong:20"));
    let mut scene = spec.build(0.3, plan.observer)?;
    scene.lights.clear();
    let maps = Maps::bake(plan, &scene, &["vmf:6", "naive"])?;
    let row = builtin::find(ENVIRONMENT);
    let built = row.ok_or_else(|| Error::Request(format!("{ENVIRONMENT} is not built in")))?.build();
    let environment = SceneEnvironment::new(built);
    let (mut all, mut claims) = (Vec::new(), Vec::new());
    for (technique, name) in [(Technique::Harmonics, "harmonics"), (Technique::Prefiltered, "prefiltered")] {
        for turn in [0.0, 2.0] {
            let head = format!("{name}, turned by {turn}");
            scene.environment = Some(SceneEnvironment { rotation: turn, technique, ..environment.clone() });
            let shown = Shot::new(plan, &scene, plan.picture(320)).shown(&maps, &plan.effort(128), &*head)?;
            let (ours, naive) = (shown.l2(0), shown.l2(1));
            claims.push(
                Claim::number(format!("{head}: L2 error of vmf:6, below average normals'"), ours)
                    .holds(ours < naive),
            );
            claims.push(Claim::number(format!("{head}: L2 error of average normals"), naive));
            claims.push(Claim::number(format!("{head}: noise of the truth"), shown.noise));
            all.push(shown);
        }
    }
    Ok(Drawing {
        sheets: vec![sheet("A creature in a studio", maps.names(), &all)],
        claims,
        why: "A mesh of our own for the armadillo. The paper prints no number but the order. Rows below the \
              harmonics have cubes blurred ahead of time, which renderers use today.",
    })
}
