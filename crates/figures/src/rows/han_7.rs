//! Han et al., figure 7: one texel's normals by one to six lobes, spherical and planar.

use glam::DVec3;
use ndfmap::Error;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::pyramid::level_sizes;
use ndfmap::draw::{Disk, Panel, Sheet, SheetRow};

use super::texels::{Texel, apart, baked, builtin, lobe_of, methods, peak, scattered, true_lobe};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-7",
    paper: Paper::Han,
    place: "Figure 7",
    summary: "normals of one texel by one to six lobes, on the sphere and on the plane",
    draw,
};

/// Numbers of lobes.
const LOBES: [usize; 6] = [1, 2, 3, 4, 5, 6];

/// Sharp lobe that draws the normals, and the reflectance of the rendered spheres.
const PEN: &str = "blinn-phong:200";
const BRDF: &str = "blinn-phong:50";

/// Half-vectors in the frames of a sphere's normals, seen from above and lit from the side: a sphere whose
/// every place has the texel's normals under it.
fn on_a_sphere(disk: &Disk) -> Vec<DVec3> {
    let half = (DVec3::new(-0.5, 0.6, 0.7).normalize() + DVec3::Z).normalize();
    let local = |n: &DVec3| {
        let tangent = DVec3::Y.cross(*n).try_normalize().unwrap_or(DVec3::X);
        DVec3::new(half.dot(tangent), half.dot(n.cross(tangent)), half.dot(*n))
    };
    disk.lattice.directions.iter().map(local).collect()
}

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let map = builtin(plan, "armour", 256)?;
    let surface = &*map.surface;
    let level = level_sizes(surface.size()).len() - 4;
    let texel = Texel { level, x: 2, y: 3 };
    let disk = Disk::new(60, 3);
    let side = scattered(disk.from_the_side());
    let ball = scattered(on_a_sphere(&disk));
    let views = [(&disk.lattice, PEN), (&side, PEN), (&ball, BRDF)];
    let truths = views.map(|(lattice, brdf)| true_lobe(surface, brdf, lattice, texel));
    let panel = |view: usize, values: &[f64]| {
        let picture = disk.draw(values, peak(&truths[view]));
        // From the side there is nothing in the lower half.
        let Size { width, height } = picture.size();
        let size = Size { width, height: if view == 1 { height / 2 } else { height } };
        Panel::of(Grid::from_fn(size, |x, y| picture.row(y)[x]))
    };
    let row = |head: &str, view: usize| SheetRow {
        head: head.lines().map(str::to_owned).collect(),
        panels: vec![Some(panel(view, &truths[view]))],
    };
    let mut rows = vec![
        row("Gaussians on the plane,\nfrom above", 0),
        row("lobes on the sphere,\nfrom above", 0),
        row("lobes on the sphere,\nfrom the side", 1),
        row("rendered by lobes\non the sphere", 2),
    ];
    let (mut claims, mut planar, mut spherical, mut rendered) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for count in LOBES {
        let [gmm, vmf]: [AnyMethod; 2] = {
            let both = methods(&[&format!("gmm:{count}:unaligned"), &format!("vmf:{count}:unaligned")]);
            both.try_into().unwrap_or_else(|_| unreachable!("two methods"))
        };
        let (on_plane, on_sphere) = (baked(plan, surface, &gmm)?, baked(plan, surface, &vmf)?);
        let of_plane = lobe_of(&on_plane, &gmm, PEN, (&disk.lattice, texel));
        planar.push(apart(&of_plane, &truths[0]));
        let l2 = |error: f64| [format!("L2 {error:.3}")];
        rows[0].panels.push(Some(panel(0, &of_plane).said(l2(planar[planar.len() - 1]))));
        for (view, (lattice, brdf)) in views.into_iter().enumerate() {
            let lobe = lobe_of(&on_sphere, &vmf, brdf, (lattice, texel));
            let error = apart(&lobe, &truths[view]);
            match view {
                0 => spherical.push(error),
                2 => rendered.push(error),
                _ => {}
            }
            rows[view + 1].panels.push(Some(panel(view, &lobe).said(l2(error))));
        }
    }
    for (at, count) in LOBES.into_iter().enumerate() {
        let says = format!("{count} lobes: L2 error on the sphere, below that on the plane");
        claims.push(Claim::number(says, spherical[at]).holds(spherical[at] < planar[at]));
        claims.push(Claim::number(format!("{count} Gaussians on the plane: L2 error"), planar[at]));
    }
    let better = rendered[3] / rendered[0];
    claims.push(
        Claim::number("rendered: error of four lobes over that of one, a third or less", better)
            .holds(better <= 1.0 / 3.0),
    );
    claims.push(
        Claim::number("rendered: L2 error of four lobes, excellent agreement (below 0.1)", rendered[3])
            .holds(rendered[3] < 0.1),
    );
    claims.push(
        Claim::number("rendered: L2 error of six lobes, below that of four", rendered[5])
            .holds(rendered[5] < rendered[3]),
    );
    let columns = std::iter::once("truth".to_owned()).chain(LOBES.map(|n| n.to_string())).collect();
    Ok(Drawing {
        sheets: vec![Sheet {
            title: "Normals of one texel by one to six lobes".to_owned(),
            columns,
            rows,
            scale: None,
        }],
        claims,
        why: "Lobes are fitted to each texel by itself, in the plane as Tan et al. do and on the \
              sphere as Han et al. do, and widened by the same reflectance. The map is armour of \
              hemispherical scales. The paper prints no number; the bounds are ours.",
    })
}
