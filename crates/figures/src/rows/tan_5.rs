//! Tan et al., figure 5: mixtures that a filter has mixed, aligned and not.

use ndfmap::Error;
use ndfmap::compare::{Subject, compare};
use ndfmap::core::pyramid::Precision;
use ndfmap::report::corner_sheet;

use super::texels::{builtin, lobe, methods};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-5",
    paper: Paper::Tan,
    place: "Figure 5",
    summary: "interpolation of mixtures that were fitted apart, and of aligned ones",
    draw,
};

/// Methods, in the order of the errors.
const METHODS: [&str; 3] = ["gmm:4:unaligned", "gmm:4:prior", "gmm:4"];

/// Levels over which errors are averaged.
const LEVELS: std::ops::RangeInclusive<usize> = 2..=5;

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let map = builtin(plan, "carved-disk", 256)?;
    let lobe = lobe("blinn-phong:50");
    let subject = Subject {
        name: "builtin:carved-disk",
        surface: &*map.surface,
        lobe: &*lobe,
        methods: &methods(&METHODS),
        baked: &[],
        engines: &[],
        storage: Precision::Half.into(),
        filtering: true,
    };
    let comparison = compare(&subject, plan.observer)?;
    let mean = |at: usize, reference: bool| {
        let errors = comparison.rows[at].filtering.iter().filter(|e| LEVELS.contains(&e.level));
        let errors: Vec<f64> =
            errors.map(|e| if reference { e.reference.error } else { e.filtered.error }).collect();
        errors.iter().sum::<f64>() / errors.len().max(1) as f64
    };
    let unaligned = mean(0, false);
    let below = |says: &str, at: usize| {
        let ours = mean(at, false);
        Claim::number(says, ours).holds(ours < unaligned)
    };
    let claims = vec![
        Claim::number("error between texels, unaligned", unaligned),
        below("error between texels, aligned by the paper's prior", 1),
        below("error between texels, aligned by ours", 2),
        Claim::number("error of shading each texel by itself, unaligned", mean(0, true)),
        Claim::number("error of shading each texel by itself, aligned by ours", mean(2, true)),
    ];
    let sheets = corner_sheet(&subject, &comparison)?.into_iter().collect();
    Ok(Drawing {
        sheets,
        claims,
        why: "The paper draws one corner and prints no number; errors here are means over levels 2 \
              to 5.",
    })
}
