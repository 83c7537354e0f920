//! Han et al., figure 6: one sphere at four distances, with the distribution of normals under a pixel.

use ndfmap::Error;
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::pyramid::level_sizes;
use ndfmap::draw::{Disk, Panel, Sheet, SheetRow};

use super::texels::{Texel, baked, methods, peak, true_lobe};
use crate::shot::{Maps, Shot, scene, shown};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-6",
    paper: Paper::Han,
    place: "Figure 6",
    summary: "a sphere at four distances, with the distribution of normals under a pixel",
    draw,
};

/// Times of the scene: the eye moves away.
const TIMES: [f64; 4] = [0.0, 0.3, 0.6, 0.9];

/// Reflectance of the sphere, and a sharp one that draws the normals themselves.
const BRDF: &str = "blinn-phong:100";
const PEN: &str = "blinn-phong:300";

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let spec = scene("sphere", plan.map(512));
    let first = spec.build(0.0, plan.observer)?;
    let maps = Maps::bake(plan, &first, &["vmf:6", "naive"])?;
    let surface = &*first.materials[0].map;
    let toksvig: &AnyMethod = &methods(&["toksvig"])[0];
    let means = baked(plan, surface, toksvig)?;
    let (sizes, size, disk) = (level_sizes(surface.size()), plan.picture(280), Disk::new(70, 3));
    let mut panels: [Vec<Option<Panel>>; 4] = Default::default();
    let (mut claims, mut lengths) = (Vec::new(), Vec::new());
    for time in TIMES {
        let scene = spec.build(time, plan.observer)?;
        let shot = Shot::new(plan, &scene, size).shown(&maps, &plan.effort(128), "sphere")?;
        // Texels a pixel where the sphere faces the eye: the map lies twice around it.
        let camera = &scene.camera;
        let distance = camera.eye.distance(camera.target) - 1.0;
        let pixel = 2.0 * (camera.degrees.to_radians() / 2.0).tan() * distance / size.height as f64;
        let texels = pixel * 2.0 * sizes[0].width as f64 / std::f64::consts::TAU;
        let level = (texels.max(1.0).log2().round() as usize).min(sizes.len() - 1);
        let texel = Texel { level, x: sizes[level].width / 2, y: sizes[level].height / 2 };
        let of = |brdf: &str| {
            let lobe = true_lobe(surface, brdf, &disk.lattice, texel);
            Some(Panel::of(disk.draw(&lobe, peak(&lobe))))
        };
        let said = [format!("a pixel is {texels:.1} texels wide")];
        panels[0].push(Some(Panel::of(shown(&shot.truth, scene.exposure)).said(said)));
        let said = [format!("L2 {:.3}", shot.l2(0))];
        panels[1].push(Some(Panel::of(shown(&shot.pictures[0], scene.exposure)).said(said)));
        panels[2].push(of(PEN));
        panels[3].push(of(BRDF));
        let (count, all) = (sizes[level].area(), sizes[level]);
        let length = |i: usize| {
            let mean = means.texel(level, i % all.width, i / all.width);
            glam::Vec3::new(mean[0], mean[1], mean[2]).length()
        };
        lengths.push((0..count).map(|i| f64::from(length(i))).sum::<f64>() / count as f64);
        let (ours, naive) = (shot.l2(0), shot.l2(1));
        let says = format!("time {time}: L2 error of vmf:6, below that of average normals");
        claims.push(Claim::number(says, ours).holds(ours < naive));
        claims.push(Claim::number(format!("time {time}: L2 error of average normals"), naive));
    }
    for (time, pair) in TIMES[1..].iter().zip(lengths.windows(2)) {
        let says = format!("time {time}: mean length of the normals under a pixel");
        claims.push(Claim::number(says, pair[1]));
    }
    let heads = ["truth", "vmf:6", "normals", "effective BRDF"];
    let row = |(head, panels): (&str, Vec<Option<Panel>>)| SheetRow { head: vec![head.to_owned()], panels };
    let rows = heads.into_iter().zip(panels).map(row).collect();
    let columns = ["(a)", "(b)", "(c)", "(d)"].map(str::to_owned).to_vec();
    Ok(Drawing {
        sheets: vec![Sheet { title: "A sphere at four distances".to_owned(), columns, rows, scale: None }],
        claims,
        why: "Relief becomes reflectance: what a pixel covers grows from one facet to a \
              distribution, and the mean of its normals shorter. The paper prints no number.",
    })
}
