//! Tan et al., figure 4: three consecutive frames of the carved disk as the camera zooms out.

use ndfmap::Error;
use ndfmap::core::grid::Size;
use ndfmap::draw::{Panel, Sheet, SheetRow};
use ndfmap::scene::metrics::{Picture, change, color_error};

use crate::shot::{Maps, Shot, part, scene, shown};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-4",
    paper: Paper::Tan,
    place: "Figure 4",
    summary: "three consecutive frames of a carved disk, by Toksvig's method and by four Gaussians",
    draw,
};

/// Methods, in the order of the pictures.
const METHODS: [&str; 3] = ["toksvig", "gmm:4:prior", "gmm:4"];

/// Time of the first frame.
const START: f64 = 0.15;

/// The scene's camera moves away by this factor in all.
const ZOOM: f64 = 20.0;

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let spec = scene("disk", plan.map(512));
    let size = plan.picture(500);
    // From frame to frame, what lies at the edge of the picture moves by one pixel.
    let step = (1.0 + 2.0 / size.width as f64).ln() / ZOOM.ln();
    let first = spec.build(START, plan.observer)?;
    let maps = Maps::bake(plan, &first, &METHODS)?;
    let mut frames: Vec<Vec<Picture>> = vec![Vec::new(); 1 + METHODS.len()];
    let (mut few, mut many) = ([0.0; METHODS.len()], [0.0; METHODS.len()]);
    for at in 0..3 {
        let scene = spec.build(START + f64::from(at) * step, plan.observer)?;
        let shot = Shot::new(plan, &scene, size);
        let truth = shot.truth(&plan.effort(256))?.picture;
        let rough = shot.truth(&plan.effort(32))?.picture;
        let pictures = shot.filtered(&maps)?;
        for (i, picture) in pictures.iter().enumerate() {
            many[i] += color_error(picture, &truth, scene.exposure) / 3.0;
            few[i] += color_error(picture, &rough, scene.exposure) / 3.0;
        }
        let all = std::iter::once(truth).chain(pictures);
        frames.iter_mut().zip(all).for_each(|(frames, picture)| frames.push(picture));
    }
    let exposure = first.exposure;
    let section = Size { width: size.width / 4, height: size.height / 4 };
    let corner = (size.width * 3 / 8, size.height / 4);
    let names = std::iter::once("truth").chain(METHODS);
    let rows = names.zip(&frames).map(|(name, frames)| SheetRow {
        head: vec![name.to_owned()],
        panels: frames.iter().map(|p| Some(Panel::of(shown(&part(p, corner, section), exposure)))).collect(),
    });
    let columns = ["frame 1", "frame 2", "frame 3"].map(str::to_owned).to_vec();
    let rows = rows.collect();
    let sheet = Sheet { title: "A section of the disk, zooming out".to_owned(), columns, rows, scale: None };
    let moved: Vec<f64> = frames.iter().map(|frames| change(frames, exposure)).collect();
    let unsteady = |at: usize| moved[at + 1] / moved[0];
    let ratio = many[2] / many[0];
    let claims = vec![
        Claim::number("colour error of four Gaussians", many[2]).beside(0.060),
        Claim::number("colour error of Toksvig's method", many[0]).beside(0.165),
        Claim::number("the first over the second", ratio).beside(0.060 / 0.165).holds(ratio <= 0.060 / 0.165),
        Claim::number("the same with the paper's prior in place of ours", many[1] / many[0]),
        Claim::number(
            "colour error of four Gaussians, against a truth of 32 rays (the paper has 16)",
            few[2],
        ),
        Claim::number("change from frame to frame over the truth's, Toksvig", unsteady(0)),
        Claim::number(
            "change from frame to frame over the truth's, four Gaussians: nearer to 1",
            unsteady(2),
        )
        .holds((unsteady(2) - 1.0).abs() < (unsteady(0) - 1.0).abs()),
    ];
    Ok(Drawing {
        sheets: vec![sheet],
        claims,
        why: "Absolute errors are of another disk, and of our reading of the paper's measure; the \
              ratio is judged. Frames follow each other so that what lies at the edge of the \
              picture moves by one pixel.",
    })
}
