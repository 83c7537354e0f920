//! Han et al., section 5.2: the order of harmonics that a gloss asks for.

use ndfmap::Error;
use ndfmap::core::grid::Size;
use ndfmap::draw::{Axis, Line, Panel, Plot, Sheet, SheetRow};

use super::texels::{builtin, compared, mean_error};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "han-order",
    paper: Paper::Han,
    place: "Section 5.2",
    summary: "the order of spherical harmonics that a gloss asks for",
    draw,
};

/// Orders, and the spellings of the methods.
const ORDERS: [usize; 8] = [2, 4, 6, 7, 8, 10, 13, 16];

/// Lobes, and their names on the plot.
const LOBES: [(&str, &str); 3] = [
    ("blinn-phong:12", "Blinn-Phong, s = 12"),
    ("torrance-sparrow:0.2", "Torrance-Sparrow, σ = 0.2"),
    ("blinn-phong:50", "Blinn-Phong, s = 50"),
];

/// Levels over which errors are averaged.
const LEVELS: std::ops::RangeInclusive<usize> = 2..=6;

/// Error that counts as enough.
const ENOUGH: f64 = 0.05;

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let map = builtin(plan, "foil", 512)?;
    let names = ORDERS.map(|order| format!("sh:{order}"));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let (mut lines, mut claims, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    for (brdf, name) in LOBES {
        let comparison = compared(plan, &*map.surface, brdf, &names)?;
        let mean = |at: usize| mean_error(&comparison.rows[at], &LEVELS);
        let of_order: Vec<f64> = (0..ORDERS.len()).map(mean).collect();
        let points = ORDERS.iter().zip(&of_order).map(|(order, error)| [*order as f64, *error]).collect();
        lines.push(Line { name: name.to_owned(), points, dashed: false });
        errors.push(of_order);
    }
    let enough = |errors: &[f64]| {
        let at = errors.iter().position(|e| *e <= ENOUGH);
        at.map_or(f64::INFINITY, |at| ((ORDERS[at] + 1) * (ORDERS[at] + 1)) as f64)
    };
    let at_seven = |lobe: usize| errors[lobe][3];
    claims.push(
        Claim::number("s = 12: error of 64 terms, enough (0.05 or less)", at_seven(0))
            .holds(at_seven(0) <= ENOUGH),
    );
    claims.push(
        Claim::number("σ = 0.2: error of 64 terms, enough (0.05 or less)", at_seven(1))
            .holds(at_seven(1) <= ENOUGH),
    );
    claims.push(
        Claim::number("s = 50: error of 64 terms, not enough", at_seven(2)).holds(at_seven(2) > ENOUGH),
    );
    let thirteen = errors[2][6];
    claims.push(
        Claim::number("s = 50: error of 196 terms, enough (0.05 or less)", thirteen)
            .holds(thirteen <= ENOUGH),
    );
    for ((_, name), (errors, paper)) in LOBES.iter().zip(errors.iter().zip([64.0, 64.0, 200.0])) {
        let terms = enough(errors);
        claims.push(if terms.is_finite() {
            Claim::number(format!("{name}: terms until the error is 0.05 or less"), terms).beside(paper)
        } else {
            let least = errors.iter().copied().fold(f64::INFINITY, f64::min);
            Claim::number(format!("{name}: least error of all orders, none enough"), least)
        });
    }
    let bound = Line { name: "enough".to_owned(), points: vec![[2.0, ENOUGH], [16.0, ENOUGH]], dashed: true };
    lines.push(bound);
    let plot = Plot {
        size: Size { width: 900, height: 520 },
        x: Axis { label: "order of the harmonics".to_owned(), range: [1.5, 16.5], logarithmic: false },
        y: Axis { label: "relative L2 error".to_owned(), range: [1e-4, 1.0], logarithmic: true },
        lines,
    };
    let rows = vec![SheetRow { head: Vec::new(), panels: vec![Some(Panel::plot(plot))] }];
    let title = "Order of harmonics against gloss, on crumpled foil".to_owned();
    Ok(Drawing {
        sheets: vec![Sheet { title, columns: Vec::new(), rows, scale: None }],
        claims,
        why: "Errors are means over levels 2 to 6. The paper does not say which error is enough: \
              0.05 is our bound, and orders between those drawn are not tried.",
    })
}
