//! Tan et al., section 5: frame rates of the scenes.

use ndfmap::Error;
use ndfmap::core::lookup::Lookups;
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::pyramid::Precision;
use ndfmap::draw::{Panel, Sheet, SheetRow};
use ndfmap::render::{FrameTimes, RenderJob, render};

use crate::shot::{scene, shown};
use crate::{Claim, Drawing, Figure, Paper, Plan};

pub(crate) const ROW: Figure = Figure {
    name: "tan-speed",
    paper: Paper::Tan,
    place: "Section 5",
    summary: "frames a second of the scenes at 500 × 500",
    draw,
};

/// Scene, method, and the paper's frames a second.
struct Rate {
    scene: &'static str,
    method: &'static str,
    paper: f64,
}

const RATES: [Rate; 6] = [
    Rate { scene: "disk", method: "gmm:4", paper: 120.0 },
    Rate { scene: "disk", method: "toksvig", paper: 125.0 },
    Rate { scene: "disk-oblique", method: "gmm:4", paper: 120.0 },
    Rate { scene: "disk-oblique", method: "phong:4", paper: 13.0 },
    Rate { scene: "desert", method: "gmm:4", paper: 45.0 },
    Rate { scene: "armour", method: "gmm:4", paper: 107.0 },
];

fn draw(plan: &Plan<'_>) -> Result<Drawing, Error> {
    let (mut panels, mut claims) = (Vec::new(), Vec::new());
    for Rate { scene: name, method, paper } in RATES {
        let methods: [AnyMethod; 1] = [method.parse()?];
        let job = RenderJob {
            scene: &scene(name, plan.map(512)),
            times: &[0.0; 5],
            methods: &methods,
            size: plan.picture(500),
            storage: Precision::Half.into(),
            lookups: Lookups::TRILINEAR,
            truth: None,
            sparkle: false,
            keep: true,
            keep_drift: false,
        };
        let report = render(&job, plan.device, plan.observer, &mut |_, _| Ok(()))?;
        let FrameTimes { median, .. } = report.frame_ms(0);
        let rate = 1000.0 / median;
        let frame = &report.frames[0];
        let said = [format!("{rate:.0} a second, the paper {paper:.0}")];
        panels.push(Some(Panel::of(shown(&frame.pictures[0], frame.exposure)).said(said)));
        claims.push(Claim::number(format!("{name} by {method}, frames a second"), rate).beside(paper));
    }
    let of = |at: usize| claims[at].ours;
    let beside_toksvig = of(0) / of(1);
    let beside_peaks = of(2) / of(3);
    claims.push(
        Claim::number("four Gaussians over Toksvig's method on the disk, within a tenth", beside_toksvig)
            .beside(120.0 / 125.0)
            .holds(beside_toksvig >= 0.9),
    );
    claims.push(
        Claim::number(
            "four Gaussians over four peaks on the oblique disk, as many times as the paper's",
            beside_peaks,
        )
        .beside(120.0 / 13.0)
        .holds(beside_peaks >= 120.0 / 13.0),
    );
    let columns = RATES.iter().map(|r| format!("{}, {}", r.scene, r.method)).collect();
    let rows = vec![SheetRow { head: Vec::new(), panels }];
    Ok(Drawing {
        sheets: vec![Sheet { title: "Frames a second".to_owned(), columns, rows, scale: None }],
        claims,
        why: "Rates are those of the device that ran this, beside a graphics card of 2004, and \
              differ from run to run; ratios within one device say more. The bound of a tenth is \
              ours.",
    })
}
