//! Han et al., figure 1: a V-groove, whose two directions an average turns into none.

use ndfmap::Error;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::surface::SurfaceRow;
use ndfmap::draw::{Disk, Panel, Rgb, Sheet, SheetRow, enlarged};

use super::texels::{Texel, baked, builtin, compared, lobe_of, methods, peak, true_lobe};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-1",
    paper: Paper::Han,
    place: "Figure 1",
    summary: "a V-groove: its normals, their distribution and their average, and what each reflects",
    draw,
};

/// Reflectance that the distribution is convolved with, and a sharp one that draws the normals themselves.
const BRDF: &str = "blinn-phong:20";
const PEN: &str = "blinn-phong:400";

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let map = builtin(plan, "v-groove", 512)?;
    let surface = &*map.surface;
    let size = surface.size();
    let mut row = SurfaceRow::flat(size.width);
    surface.read_row(0, &mut row);
    let shades = |n: glam::Vec3| -> Rgb { [n.x, n.y, n.z].map(|v| ((v + 1.0) * 127.5).round() as u8) };
    // Two grooves.
    let near = Grid::from_fn(Size { width: 16, height: 16 }, |x, _| shades(row.normal(x * size.width / 64)));
    let last = ndfmap::core::pyramid::level_sizes(size).len() - 1;
    let texel = Texel { level: last, x: 0, y: 0 };
    let disk = Disk::new(66, 3);
    let names = ["naive", "vmf:2"];
    let all = methods(&names);
    let mut rows = Vec::new();
    for (head, brdf) in [("normals", PEN), ("effective BRDF", BRDF)] {
        let truth = true_lobe(surface, brdf, &disk.lattice, texel);
        let peak = peak(&truth);
        let mut panels = vec![Some(Panel::of(disk.draw(&truth, peak)))];
        for method in &all {
            let pyramid = baked(plan, surface, method)?;
            let lobe = lobe_of(&pyramid, method, brdf, (&disk.lattice, texel));
            panels.push(Some(Panel::of(disk.draw(&lobe, peak))));
        }
        rows.push(SheetRow { head: vec![head.to_owned()], panels });
    }
    let close = Panel::of(enlarged(&near, 198)).said(["the map, by normals".to_owned()]);
    rows[0].panels.push(Some(close));
    let columns = ["truth", "average normal", "two lobes", "closeup"].map(str::to_owned).to_vec();
    let title = "A V-groove under one texel, seen from above".to_owned();
    let comparison = compared(plan, surface, BRDF, &names)?;
    let error = |at: usize| comparison.rows[at].levels[last].error;
    let claims = vec![
        Claim::number("error of the average normal, as wrong as black or worse", error(0))
            .holds(error(0) >= 1.0),
        Claim::number("error of two lobes, below a twentieth", error(1)).holds(error(1) < 0.05),
    ];
    Ok(Drawing {
        sheets: vec![Sheet { title, columns, rows, scale: None }],
        claims,
        why: "The paper's figure is a sketch without numbers. Two directions are two lobes; their \
              average is a third direction, in which nothing faces.",
    })
}
