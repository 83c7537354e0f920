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
    // Sums of Gaussians pass through an anisotropic filter, as the paper says of its own; peaks are shaded
    // where they are stored and mixed by three weights.
    let shot = Shot::new(plan, &scene, plan.picture(400));
    let anisotropic = Shot { lookups: Lookups::taps(Filtering::anisotropic(16)), ..shot };
    let trilinear = Shot { lookups: Lookups::TRILINEAR, ..shot };
    let [gaussians, peaks] = ["gmm:4", "phong:4"].map(|method| Maps::bake(plan, &scene, &[method]));
    let (gaussians, peaks) = (gaussians?, peaks?);
    let effort = plan.effort(256);
    let (ours, theirs) =
        (anisotropic.shown(&gaussians, &effort, "gmm:4")?, trilinear.shown(&peaks, &effort, "phong:4")?);
    let finer = anisotropic.shown(&peaks, &effort, "phong:4, as many taps")?;
    let slower = trilinear.seconds(&peaks, 0)? / anisotropic.seconds(&gaussians, 0)?;
    let ratio = ours.colour(0) / theirs.colour(0);
    let claims = vec![
        Claim::number("colour error of four Gaussians", ours.colour(0)).beside(0.041),
        Claim::number("colour error of four Phong peaks", theirs.colour(0)).beside(0.123),
        Claim::number("the first over the second", ratio).beside(0.041 / 0.123).holds(ratio <= 0.041 / 0.123),
        Claim::number("colour error of four peaks with as many taps as the Gaussians", finer.colour(0)),
        Claim::number("time of the peaks' frame over the Gaussians'", slower)
            .beside(120.0 / 13.0)
            .holds(slower >= 120.0 / 13.0),
        Claim::number(
            "the same with as many taps",
            anisotropic.seconds(&peaks, 0)? / anisotropic.seconds(&gaussians, 0)?,
        ),
    ];
    let all = [ours, theirs, finer];
    Ok(Drawing {
        sheets: vec![sheet("The disk at an oblique angle", ["as named"], &all)],
        claims,
        why: "Peaks are shaded at eight texels and mixed by three weights, Gaussians pass through \
              sixteen taps. Peaks with as many taps are shown too, which no filter of a graphics \
              card gives them. Times are of the processor.",
    })
}
