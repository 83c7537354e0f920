//! Olano and North, sections 4 to 6: densities on the sphere, and how well they mix.

use ndfmap::Error;
use ndfmap::draw::{Panel, Sheet, SheetRow};
use ndfmap::report::error_plot;

use super::texels::{builtin, compared, mean_error};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "olano-densities",
    paper: Paper::Olano,
    place: "Figure 5, sections 4 to 6",
    summary: "densities of normals by projection and by a Gaussian in space, after mixing",
    draw,
};

/// Methods: Gaussian in space by its exact and by its printed factor, on a plane, on the hemisphere, on the
/// whole sphere by stereographic projection.
const METHODS: [&str; 5] = ["ndm", "ndm:gaussian", "ndm:plane", "slopes", "stereographic"];

/// Maps that are measured.
const MAPS: [&str; 3] = ["foil", "ripples", "weave"];

/// Levels over which errors are averaged.
const LEVELS: std::ops::RangeInclusive<usize> = 2..=6;

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let (mut claims, mut panels) = (Vec::new(), Vec::new());
    for name in MAPS {
        let map = builtin(plan, name, 512)?;
        let comparison = compared(plan, &*map.surface, "blinn-phong:50", &METHODS)?;
        let mean = |at: usize| mean_error(&comparison.rows[at], &LEVELS);
        for (at, method) in METHODS.iter().enumerate() {
            let stereographic = *method == "stereographic";
            let said = if stereographic { ", worse than ndm" } else { "" };
            let claim = Claim::number(format!("{name}: error of {method}{said}"), mean(at));
            claims.push(if stereographic { claim.holds(mean(at) > mean(0)) } else { claim });
        }
        panels.push(Some(Panel::plot(error_plot(&comparison)).said([(*name).to_owned()])));
    }
    let rows = panels.into_iter().map(|panel| SheetRow { head: Vec::new(), panels: vec![panel] }).collect();
    let title = "Densities of normals after mixing".to_owned();
    Ok(Drawing {
        sheets: vec![Sheet { title, columns: Vec::new(), rows, scale: None }],
        claims,
        why: "Judged is the paper's statement that a stereographic Gaussian is no good \
              approximation of a mixture, by whether it is worse than the Gaussian in space. \
              Errors are means over levels 2 to 6.",
    })
}
