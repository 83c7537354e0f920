//! Han et al., figure 8: a creature whose skin dries.

use glam::Vec3;
use ndfmap::Error;

use super::colours::{Paint, painted};
use crate::shot::{Maps, Shot, scene, sheet};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-8",
    paper: Paper::Han,
    place: "Figure 8",
    summary: "a creature of four materials with a colour map, its wet skin drying, by six lobes",
    draw,
};

/// Skin that is paler on its scales.
fn skin(_normal: Vec3, height: f32) -> Vec3 {
    Vec3::new(0.08, 0.1, 0.03).lerp(Vec3::new(0.3, 0.34, 0.14), height)
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let spec = scene("creature", plan.map(512));
    let mut first = spec.build(0.0, plan.observer)?;
    let paint = Paint { diffuse: 1.0, specular: 0.0 };
    let textures = painted(&*first.materials[0].map, paint, skin);
    first.materials[0].textures = Some(textures.clone());
    let maps = Maps::bake(plan, &first, &["vmf:6", "toksvig", "naive"])?;
    let (mut all, mut claims) = (Vec::new(), Vec::new());
    let mut seconds = 0.0;
    for (name, time) in [("wet", 0.0), ("drying", 0.33), ("dry", 0.67)] {
        let mut scene = spec.build(time, plan.observer)?;
        // The lobe dries, and nothing is baked anew.
        let skin = &mut scene.materials[0];
        skin.textures = Some(textures.clone());
        skin.brdf.lobe = skin.brdf.lobe.widen(skin.params.roughness);
        let size = plan.picture(400);
        let shot = Shot::new(plan, &scene, size);
        seconds += shot.seconds(&maps, 0)? / 3.0;
        let shown = shot.shown(&maps, &plan.effort(64), name)?;
        let (ours, toksvig) = (shown.l2(0), shown.l2(1));
        claims.push(
            Claim::number(format!("{name}: L2 error of vmf:6, below Toksvig's"), ours).holds(ours < toksvig),
        );
        claims.push(Claim::number(format!("{name}: L2 error of Toksvig's method"), toksvig));
        claims.push(Claim::number(format!("{name}: L2 error of average normals"), shown.l2(2)));
        all.push(shown);
    }
    claims.push(
        Claim::number(
            "frames a second on the processor at 400 × 400, the paper's on a graphics card at 640 × 480",
            1.0 / seconds,
        )
        .beside(75.0),
    );
    Ok(Drawing {
        sheets: vec![sheet("A creature whose skin dries", maps.names(), &all)],
        claims,
        why: "A lizard of our own with four maps for the paper's dinosaurs with six. The skin \
              dries by a ramp of gloss and roughness of our own, not by the model of Sun et al. \
              that the paper cites.",
    })
}
