//! A plot of lines, as pixels or as SVG.

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::{
    BitMapBackend, ChartBuilder, Circle, Color, DrawingArea, DrawingBackend, IntoDrawingArea, IntoFont,
    LineSeries, PathElement, RGBColor, SVGBackend, SeriesLabelPosition,
};
use plotters::series::DashedLineSeries;
use plotters::style::{ShapeStyle, TextStyle};

use ndfmap_core::grid::{Grid, Size};

use super::canvas::{Canvas, Rgb, Theme};
use super::colour::line_colours;
use super::text::{FAMILY, FOR_PLOTS};
use crate::Error;

/// Pixels that a plot is drawn with for each of its own, each way: lines are smooth then, and letters stand
/// where they should, not on whole pixels.
const FINER: usize = 3;

/// Plot of lines over two axes.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Width and height in pixels.
    pub size: Size,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Lines, in the order of the legend.
    pub lines: Vec<Line>,
}

/// Axis of a plot.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// Words beside it.
    pub label: String,
    /// Least and greatest number.
    pub range: [f64; 2],
    /// True where equal steps are equal factors; the range is positive then.
    pub logarithmic: bool,
}

/// Line of a plot.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// Name in the legend.
    pub name: String,
    /// Places, from left to right; those below a logarithmic axis lie on its end.
    pub points: Vec<[f64; 2]>,
    /// True for a dashed line, without points: a bound, or what a paper says.
    pub dashed: bool,
}

impl Axis {
    /// Place on the axis: the number, or its logarithm.
    fn place(&self, value: f64) -> f64 {
        if self.logarithmic { value.max(self.range[0]).log10() } else { value }
    }

    fn span(&self) -> std::ops::Range<f64> {
        self.place(self.range[0])..self.place(self.range[1])
    }

    /// Number of ticks to aim at: whole powers of ten where there are several.
    fn ticks(&self) -> usize {
        let decades = if self.logarithmic { (self.range[1] / self.range[0]).log10() } else { 0.0 };
        if decades > 2.0 { decades.ceil() as usize } else { 10 }
    }

    /// Words beside a tick.
    fn tick(&self, place: f64) -> String {
        let value = if self.logarithmic { 10.0_f64.powf(place) } else { place };
        match value.abs() {
            0.0 => "0".to_owned(),
            v if v < 0.001 => format!("{value:.0e}"),
            v if v >= 100.0 || (v - v.round()).abs() < 1e-9 => format!("{value:.0}"),
            // Two digits that count, without zeros at the end.
            v => {
                let digits = (1.0 - v.log10().floor()).clamp(1.0, 5.0) as usize;
                let text = format!("{value:.digits$}");
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            }
        }
    }
}

impl Plot {
    /// Draws the plot.
    #[must_use]
    pub fn draw(&self, theme: Theme) -> Canvas {
        let size = Size { width: self.size.width.max(64), height: self.size.height.max(64) };
        let fine = Size { width: FINER * size.width, height: FINER * size.height };
        let mut bytes = vec![0; 3 * fine.area()];
        {
            let backend = BitMapBackend::with_buffer(&mut bytes, (fine.width as u32, fine.height as u32));
            let drawn = self.on(&backend.into_drawing_area(), theme, FINER as u32);
            drawn.unwrap_or_else(|e| unreachable!("memory takes every pixel: {e}"));
        }
        let mean = |x: usize, y: usize| -> Rgb {
            std::array::from_fn(|c| {
                let at = |i: usize| {
                    let (x, y) = (FINER * x + i % FINER, FINER * y + i / FINER);
                    usize::from(bytes[3 * (y * fine.width + x) + c])
                };
                ((0..FINER * FINER).map(at).sum::<usize>() / (FINER * FINER)) as u8
            })
        };
        let mut canvas = Canvas::new(size, theme);
        canvas.picture((0, 0), &Grid::from_fn(size, mean));
        canvas
    }

    /// The plot as SVG.
    ///
    /// # Errors
    /// [`Error::Failed`] for a plot that cannot be drawn.
    pub fn to_svg(&self, theme: Theme) -> Result<String, Error> {
        let mut svg = String::new();
        {
            let backend =
                SVGBackend::with_string(&mut svg, (self.size.width as u32, self.size.height as u32));
            let drawn = self.on(&backend.into_drawing_area(), theme, 1);
            drawn.map_err(|e| Error::Failed(format!("cannot draw the plot: {e}")))?;
        }
        Ok(svg)
    }

    /// Corner for the legend: the one with the fewest points of lines in it.
    fn emptiest_corner(&self) -> SeriesLabelPosition {
        // Where a point lies along an axis, from 0 to 1.
        let along = |axis: &Axis, value: f64| {
            let span = axis.span();
            (axis.place(value) - span.start) / (span.end - span.start)
        };
        let points: Vec<[f64; 2]> = self
            .lines
            .iter()
            .flat_map(|line| &line.points)
            .map(|[x, y]| [along(&self.x, *x), along(&self.y, *y)])
            .collect();
        let within = |right: bool, upper: bool| {
            let near = |at: f64, far: bool| if far { at > 0.7 } else { at < 0.3 };
            points.iter().filter(|[x, y]| near(*x, right) && near(*y, upper)).count()
        };
        let corners = [
            (SeriesLabelPosition::LowerRight, within(true, false)),
            (SeriesLabelPosition::UpperRight, within(true, true)),
            (SeriesLabelPosition::LowerLeft, within(false, false)),
            (SeriesLabelPosition::UpperLeft, within(false, true)),
        ];
        let [mut corner, others @ ..] = corners;
        for other in others {
            if other.1 < corner.1 {
                corner = other;
            }
        }
        corner.0
    }

    fn on<D: DrawingBackend>(
        &self,
        area: &DrawingArea<D, Shift>,
        theme: Theme,
        scale: u32,
    ) -> Result<(), Box<dyn std::error::Error>>
    where
        D::ErrorType: 'static,
    {
        std::sync::LazyLock::force(&FOR_PLOTS);
        let (paper, ink, faint) = (rgb(theme.paper()), rgb(theme.ink(false)), rgb(theme.ink(true)));
        let pixels = |n: u32| n * scale;
        let words = |n: u32| TextStyle::from((FAMILY, pixels(n)).into_font()).color(&ink);
        area.fill(&paper)?;
        let mut chart = ChartBuilder::on(area)
            .margin(pixels(12))
            .x_label_area_size(pixels(44))
            .y_label_area_size(pixels(64))
            .build_cartesian_2d(self.x.span(), self.y.span())?;
        chart
            .configure_mesh()
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .axis_desc_style(words(15))
            .label_style(words(14))
            .axis_style(faint.stroke_width(scale))
            .x_labels(self.x.ticks())
            .y_labels(self.y.ticks())
            .set_all_tick_mark_size(pixels(5))
            .x_label_formatter(&|x| self.x.tick(*x))
            .y_label_formatter(&|y| self.y.tick(*y))
            .bold_line_style(faint.mix(0.25).stroke_width(scale))
            .light_line_style(faint.mix(0.0))
            .draw()?;
        let long = pixels(20) as i32;
        for (line, colour) in self.lines.iter().zip(line_colours(self.lines.len())) {
            let colour = rgb(colour);
            let style: ShapeStyle = colour.stroke_width(pixels(2));
            let points = || line.points.iter().map(|[x, y]| (self.x.place(*x), self.y.place(*y)));
            if line.dashed {
                chart
                    .draw_series(DashedLineSeries::new(points(), pixels(6), pixels(4), style))?
                    .label(&line.name)
                    .legend(move |(x, y)| {
                        DashedPathElement::new([(x, y), (x + long, y)], pixels(6), pixels(4), style)
                    });
                continue;
            }
            chart
                .draw_series(LineSeries::new(points(), style))?
                .label(&line.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + long, y)], style));
            chart.draw_series(points().map(|at| Circle::new(at, pixels(3), colour.filled())))?;
        }
        chart
            .configure_series_labels()
            .position(self.emptiest_corner())
            .label_font(words(14))
            .legend_area_size(pixels(30))
            .margin(pixels(8))
            .background_style(paper.mix(0.85))
            .border_style(faint.mix(0.5).stroke_width(scale))
            .draw()?;
        area.present()?;
        Ok(())
    }
}

fn rgb([r, g, b]: Rgb) -> RGBColor {
    RGBColor(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_show_every_line_in_both_themes() {
        let line = |i: usize| Line {
            name: format!("line {i}"),
            points: vec![[0.0, 0.1 * (i + 1) as f64], [5.0, 0.01 * (i + 1) as f64]],
            dashed: i == 0,
        };
        let plot = Plot {
            size: Size { width: 480, height: 300 },
            x: Axis { label: "level".to_owned(), range: [0.0, 5.0], logarithmic: false },
            y: Axis { label: "error".to_owned(), range: [0.001, 1.0], logarithmic: true },
            lines: (0..4).map(line).collect(),
        };
        for theme in Theme::ALL {
            let grid = plot.draw(theme).into_grid();
            for colour in line_colours(4) {
                // Half of a line's width is its edges, mixed with paper.
                let near = |p: &&Rgb| p.iter().zip(colour).all(|(a, b)| a.abs_diff(b) < 40);
                assert!(grid.texels().iter().filter(near).count() > 50, "{theme:?} {colour:?}");
            }
            let svg = plot.to_svg(theme).unwrap();
            assert!(svg.contains("line 3") && svg.contains("error"), "{theme:?}");
        }
    }

    #[test]
    fn ticks_are_short() {
        let axis = |logarithmic| Axis { logarithmic, ..Axis::default() };
        assert_eq!(
            [0.0, 0.5, 2.0, 0.25, 250.0, 0.0001].map(|v| axis(false).tick(v)),
            ["0", "0.5", "2", "0.25", "250", "1e-4"]
        );
        assert_eq!([-1.0, 0.0, 2.0, -0.5].map(|v| axis(true).tick(v)), ["0.1", "1", "100", "0.32"]);
        assert_eq!([axis(true).tick(0.3), axis(false).tick(10.04)], ["2", "10"]);
    }
}
