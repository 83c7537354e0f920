//! Olano and North, figure 1: a rippled object with a colour map, at its own scale and under-sampled.

use glam::{DMat3, Vec3};
use ndfmap::Error;
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::core::ndf::Decoded;
use ndfmap::draw::{Panel, Sheet, SheetRow};

use super::colours::{Paint, painted};
use super::texels::{Texel, baked, lobe, methods};
use crate::shot::{Maps, Shot, scene, shown};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "olano-1",
    paper: Paper::Olano,
    place: "Figure 1",
    summary: "ripples and colours on a ball, at their own scale and at a coarser one",
    draw,
};

/// Levels by which the second picture is under-sampled.
const COARSER: f64 = 5.0;

/// Copper, paler on the crests.
fn copper(_normal: Vec3, height: f32) -> Vec3 {
    Vec3::new(0.2, 0.05, 0.03).lerp(Vec3::new(0.75, 0.42, 0.25), height)
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let mut scene = scene("sphere", plan.map(512)).build(0.0, plan.observer)?;
    let material = &mut scene.materials[0];
    material.brdf.lobe = lobe("blinn-phong:60");
    material.textures = Some(painted(&*material.map, Paint { diffuse: 1.0, specular: 0.3 }, copper));
    let maps = Maps::bake(plan, &scene, &["ndm", "naive"])?;
    let size = plan.picture(360);
    let mut rows = Vec::new();
    for (head, lod_bias) in [("a) own scale", 0.0), ("b) coarser", COARSER)] {
        let lookups = Lookups::taps(Filtering { lod_bias, ..Filtering::TRILINEAR });
        let pictures = Shot { lookups, ..Shot::new(plan, &scene, size) }.filtered(&maps)?;
        let panels = pictures.iter().map(|p| Some(Panel::of(shown(p, scene.exposure)))).collect();
        rows.push(SheetRow { head: vec![head.to_owned()], panels });
    }
    // Spread of the normals across and along the ripples, under the texels of that level.
    let surface = &*scene.materials[0].map;
    let ndm = &methods(&["ndm"])[0];
    let pyramid = baked(plan, surface, ndm)?;
    let level = (COARSER as usize).min(pyramid.sizes().len() - 1);
    let all = pyramid.sizes()[level];
    let spread = |level: usize| {
        let size = pyramid.sizes()[level];
        let of = |i: usize| {
            let Texel { level, x, y } = Texel { level, x: i % size.width, y: i / size.width };
            match ndm.describe(&pyramid.texel(level, x, y)) {
                Decoded::Gaussian { covariance, .. } => covariance,
                _ => DMat3::ZERO,
            }
        };
        (0..size.area()).map(of).fold(DMat3::ZERO, |sum, c| sum + c) * (1.0 / size.area() as f64)
    };
    let (fine, coarse) = (spread(0), spread(level));
    // The ripples' crests run along y, and their normals lean along x.
    let deviation = |variance: f64| variance.max(0.0).sqrt();
    let (across, along) = (deviation(coarse.x_axis.x), deviation(coarse.y_axis.y));
    let place = format!("under one of {} × {} texels", all.width, all.height);
    let claims = vec![
        Claim::number("deviation of the normals under one texel, own scale", deviation(fine.x_axis.x)),
        Claim::number(format!("{place}: deviation across the ripples"), across),
        Claim::number(format!("{place}: deviation along them, less than two thirds of that across"), along)
            .holds(along < across / 1.5),
    ];
    let columns = ["normal distribution map", "average normals"].map(str::to_owned).to_vec();
    Ok(Drawing {
        sheets: vec![Sheet { title: "Ripples and colours on a ball".to_owned(), columns, rows, scale: None }],
        claims,
        why: "The highlight spreads in the direction in which the normals of the ripples do. The paper prints no \
              number; the bound is ours.",
    })
}
