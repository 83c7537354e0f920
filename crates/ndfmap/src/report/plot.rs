//! Plot of the error by level for every method, as SVG.

use plotters::element::DashedPathElement;
use plotters::prelude::{
    BLACK, ChartBuilder, Circle, Color, EmptyElement, IntoDrawingArea, IntoLogRange, LineSeries, PathElement,
    RGBColor, SVGBackend, SeriesLabelPosition, WHITE,
};
use plotters::series::{DashedLineSeries, PointSeries};
use plotters::style::ShapeStyle;

use crate::Error;
use crate::compare::Comparison;

/// Okabe and Ito's colours, which the colour-blind can tell apart; after eight they start again, with other
/// dashes.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 0, 0),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(204, 121, 167),
    RGBColor(150, 150, 150),
];

/// Dashes and the gaps between them, in pixels, of each round of colours; the first is drawn through.
const DASHES: [(i32, i32); 3] = [(1, 0), (7, 4), (2, 3)];

/// Least floor of a plot, below all that half floats can hold of an error.
const LEAST: f64 = 1e-9;

/// Floor of the plot, below every error but those that are 0, which lie on it.
fn floor(comparison: &Comparison) -> f64 {
    let errors = comparison.rows.iter().flat_map(|row| &row.levels).map(|level| level.error);
    let least = errors.filter(|error| *error > 0.0).fold(0.01, f64::min);
    10.0_f64.powf((least.log10() - 0.2).floor()).max(LEAST)
}

/// Draws the plot.
pub(super) fn errors_by_level(comparison: &Comparison) -> Result<String, Error> {
    let mut svg = String::new();
    draw(comparison, &mut svg).map_err(|e| Error::Failed(format!("cannot draw the plot: {e}")))?;
    Ok(svg)
}

fn draw(comparison: &Comparison, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let last = comparison.sizes.len() - 1;
    let worst = comparison.rows.iter().flat_map(|r| &r.levels).map(|l| l.error).fold(1.0, f64::max);
    let floor = floor(comparison);
    let area = SVGBackend::with_string(svg, (860, 460)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d(-0.2..last as f64 + 0.2, (floor..worst * 1.5).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("level (0 is the map itself)")
        .y_desc("relative L2 error")
        .x_labels(last + 1)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| if *y < 0.01 { format!("{y:.0e}") } else { format!("{y}") })
        .light_line_style(BLACK.mix(0.06))
        .draw()?;
    for (at, row) in comparison.rows.iter().enumerate() {
        let colour = COLOURS[at % COLOURS.len()];
        let style: ShapeStyle = colour.stroke_width(2);
        let points = || row.levels.iter().map(|l| (l.level as f64, l.error.max(floor)));
        let (dash, gap) = DASHES[at / COLOURS.len() % DASHES.len()];
        let sample =
            move |(x, y): (i32, i32)| DashedPathElement::new([(x, y), (x + 18, y)], dash, gap, style);
        if gap == 0 {
            chart
                .draw_series(LineSeries::new(points(), style))?
                .label(row.method.clone())
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        } else {
            chart
                .draw_series(DashedLineSeries::new(points(), dash, gap, style))?
                .label(row.method.clone())
                .legend(sample);
        }
        let point = if gap == 0 { colour.filled() } else { style };
        chart.draw_series(PointSeries::of_element(points(), 3, point, &|at, size, style| {
            EmptyElement::at(at) + Circle::new((0, 0), size, style)
        }))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    area.present()?;
    Ok(())
}
