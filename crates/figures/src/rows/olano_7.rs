//! Olano and North, figure 7: two Gaussians mixed into one.

use glam::{DVec3, Vec3};
use ndfmap::Error;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::ndf::Decoded;
use ndfmap::core::surface::{NormalGrid, Wrap, Wraps};
use ndfmap::draw::{Disk, Panel, Sheet, SheetRow};

use super::texels::{Texel, apart, baked, lobe_of, methods, peak, true_lobe};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "olano-7",
    paper: Paper::Olano,
    place: "Figure 7",
    summary: "two points of a shiny bump, and the one Gaussian that their mixture becomes",
    draw,
};

/// Gloss of the bump.
const BRDF: &str = "blinn-phong:60";

/// Tilt of the two normals.
const TILT: f32 = 0.35;

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let tilted = |x: usize| Vec3::new(if x == 0 { -TILT } else { TILT }, 0.12, 1.0).normalize();
    let wraps = Wraps { x: Wrap::Clamp, y: Wrap::Clamp };
    let surface =
        NormalGrid { normals: Grid::from_fn(Size { width: 2, height: 1 }, |x, _| tilted(x)), wraps };
    let disk = Disk::new(72, 3);
    let ndm = &methods(&["ndm"])[0];
    let pyramid = baked(plan, &surface, ndm)?;
    let one = |x: usize| Texel { level: 0, x, y: 0 };
    let both = Texel { level: 1, x: 0, y: 0 };
    let of = |texel: Texel| lobe_of(&pyramid, ndm, BRDF, (&disk.lattice, texel));
    let truth = true_lobe(&surface, BRDF, &disk.lattice, both);
    let single = of(both);
    let white = peak(&of(one(0)));
    let panels = [of(one(0)), of(one(1)), truth.clone(), single.clone()];
    let panels = panels.iter().map(|values| Some(Panel::of(disk.draw(values, white)))).collect();
    let described = |texel: Texel| match ndm.describe(&pyramid.texel(texel.level, texel.x, texel.y)) {
        Decoded::Gaussian { mean, covariance } => (mean, covariance),
        _ => (DVec3::ZERO, glam::DMat3::ZERO),
    };
    let (mean, covariance) = described(both);
    let (a, b) = (described(one(0)).0, described(one(1)).0);
    // Half the distance of the means, squared: what mixing two adds along their axis.
    let expected = (a - b).length_squared() / 4.0;
    let along = covariance.x_axis.x;
    let across = covariance.y_axis.y;
    let claims = vec![
        Claim::number("variance that the mixture gains along the axis of the means", along),
        Claim::number("the same over the square of half their distance: 1", along / expected)
            .holds((along / expected - 1.0).abs() < 0.01),
        Claim::number("variance that it gains across: none", across).holds(across.abs() < 1e-3 * along),
        Claim::number("distance of its mean from the mean of the two: none", mean.distance((a + b) / 2.0))
            .holds(mean.distance((a + b) / 2.0) < 1e-3),
        Claim::number("relative L2 error of the one Gaussian as a lobe", apart(&single, &truth)),
    ];
    let columns =
        ["first point", "second point", "their mixture", "one Gaussian"].map(str::to_owned).to_vec();
    let rows = vec![SheetRow { head: Vec::new(), panels }];
    Ok(Drawing {
        sheets: vec![Sheet { title: "Two points of a shiny bump".to_owned(), columns, rows, scale: None }],
        claims,
        why: "Means and second moments mix as the paper says, to what half floats hold. One \
              Gaussian fills the gap between two directions that are far apart.",
    })
}
