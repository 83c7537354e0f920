//! A sheet of panels in rows and columns, with a head for each, captions, and a colour scale.

use ndfmap_core::grid::{Grid, Size};

use super::canvas::{Canvas, Rgb, Theme};
use super::plot::Plot;
use super::text::{Style, width};

/// Gap around panels, in pixels.
const GAP: usize = 14;

/// Width and height of a scale's ramp, in pixels.
const RAMP: usize = 16;
const RAMP_HEIGHT: usize = 180;

/// Sheet of panels.
#[derive(Clone, Default)]
pub struct Sheet {
    /// Title over the sheet.
    pub title: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// Rows of panels.
    pub rows: Vec<SheetRow>,
    /// Scale of the colours that stand for numbers, where some do.
    pub scale: Option<Scale>,
}

/// Row of panels with its head.
#[derive(Clone, Default)]
pub struct SheetRow {
    /// Lines of the head.
    pub head: Vec<String>,
    /// Panels from left to right; `None` leaves a place empty.
    pub panels: Vec<Option<Panel>>,
}

/// Panel with its captions.
#[derive(Clone)]
pub struct Panel {
    /// Contents of the panel.
    pub content: Content,
    /// Lines under it.
    pub captions: Vec<String>,
}

/// Contents of a panel.
#[derive(Clone)]
pub enum Content {
    /// A picture, shown as it is.
    Picture(Grid<Rgb>),
    /// A plot, drawn in the sheet's theme.
    Plot(Plot),
}

/// Scale of colours that stand for numbers.
#[derive(Clone)]
pub struct Scale {
    /// Name of the number.
    pub title: String,
    /// Number that is drawn darkest.
    pub low: String,
    /// Number that is drawn lightest.
    pub high: String,
    /// Colour at a place from 0 to 1.
    pub colour: fn(f64) -> Rgb,
}

impl Panel {
    /// A panel of a picture without captions.
    #[must_use]
    pub fn of(picture: Grid<Rgb>) -> Self {
        Self { content: Content::Picture(picture), captions: Vec::new() }
    }

    /// A panel of a plot without captions.
    #[must_use]
    pub fn plot(plot: Plot) -> Self {
        Self { content: Content::Plot(plot), captions: Vec::new() }
    }

    /// This panel with captions.
    #[must_use]
    pub fn said(self, captions: impl IntoIterator<Item = String>) -> Self {
        Self { captions: captions.into_iter().collect(), ..self }
    }

    fn size(&self) -> Size {
        match &self.content {
            Content::Picture(picture) => picture.size(),
            Content::Plot(plot) => plot.size,
        }
    }

    fn width(&self) -> usize {
        let said = self.captions.iter().map(|c| width(c, Style::CAPTION)).max();
        self.size().width.max(said.unwrap_or(0))
    }

    fn height(&self) -> usize {
        self.size().height + 4 + self.captions.len() * Style::CAPTION.line()
    }
}

/// A picture whose pixels are squares of so many that its longer side has at least `side`.
#[must_use]
pub fn enlarged(picture: &Grid<Rgb>, side: usize) -> Grid<Rgb> {
    let own = picture.size();
    let times = side.div_ceil(own.width.max(own.height)).max(1);
    let size = Size { width: own.width * times, height: own.height * times };
    Grid::from_fn(size, |x, y| picture.row(y / times)[x / times])
}

/// Places of a sheet's parts, in pixels.
struct Layout {
    size: Size,
    /// Left edges of the columns.
    columns: Vec<usize>,
    /// Upper edges of the rows.
    rows: Vec<usize>,
    /// Upper edge of the heads of the columns.
    heads: usize,
    /// Left edge of the scale.
    scale: usize,
}

impl Sheet {
    fn layout(&self) -> Layout {
        let widest = |lines: &[String], style| lines.iter().map(|l| width(l, style)).max().unwrap_or(0);
        let head = self.rows.iter().map(|row| widest(&row.head, Style::HEAD)).max().unwrap_or(0);
        let mut x = GAP + if head > 0 { head + GAP } else { 0 };
        let count = self.rows.iter().map(|r| r.panels.len()).max().unwrap_or(0).max(self.columns.len());
        let mut columns = Vec::new();
        for at in 0..count {
            columns.push(x);
            let panels = self.rows.iter().filter_map(|row| row.panels.get(at)?.as_ref());
            let head = self.columns.get(at).map_or(0, |c| width(c, Style::HEAD));
            x += panels.map(Panel::width).max().unwrap_or(0).max(head) + GAP;
        }
        let title = if self.title.is_empty() { 0 } else { Style::TITLE.line() + GAP };
        let heads = GAP + title;
        let mut y = heads + if self.columns.is_empty() { 0 } else { Style::HEAD.line() + 4 };
        let mut rows = Vec::new();
        for row in &self.rows {
            rows.push(y);
            let panels = row.panels.iter().flatten().map(Panel::height).max().unwrap_or(0);
            y += panels.max(row.head.len() * Style::HEAD.line()) + GAP;
        }
        let scale = x;
        if let Some(Scale { title, low, high, .. }) = &self.scale {
            let words = widest(&[low.clone(), high.clone()], Style::CAPTION) + RAMP + 6;
            x += words.max(width(title, Style::CAPTION)) + GAP;
            let top = rows.first().copied().unwrap_or(y);
            y = y.max(top + Style::CAPTION.line() + 4 + RAMP_HEIGHT + GAP);
        }
        let width = x.max(width(&self.title, Style::TITLE) + 2 * GAP);
        Layout { size: Size { width, height: y }, columns, rows, heads, scale }
    }

    /// Width and height of the drawing, in pixels.
    #[must_use]
    pub fn size(&self) -> Size {
        self.layout().size
    }

    /// Draws the sheet.
    #[must_use]
    pub fn draw(&self, theme: Theme) -> Canvas {
        let layout = self.layout();
        let mut canvas = Canvas::new(layout.size, theme);
        canvas.text((GAP, GAP), &self.title, Style::TITLE);
        for (x, head) in layout.columns.iter().zip(&self.columns) {
            canvas.text((*x, layout.heads), head, Style::HEAD);
        }
        for (y, row) in layout.rows.iter().zip(&self.rows) {
            for (line, text) in row.head.iter().enumerate() {
                canvas.text((GAP, y + line * Style::HEAD.line()), text, Style::HEAD);
            }
            for (x, panel) in layout.columns.iter().zip(&row.panels) {
                let Some(panel) = panel else { continue };
                match &panel.content {
                    Content::Picture(picture) => canvas.picture((*x, *y), picture),
                    Content::Plot(plot) => canvas.picture((*x, *y), &plot.draw(theme).into_grid()),
                }
                let below = y + panel.size().height + 4;
                for (line, caption) in panel.captions.iter().enumerate() {
                    canvas.text((*x, below + line * Style::CAPTION.line()), caption, Style::CAPTION);
                }
            }
        }
        if let (Some(scale), Some(top)) = (&self.scale, layout.rows.first()) {
            scale.draw(&mut canvas, (layout.scale, *top));
        }
        canvas
    }
}

impl Scale {
    fn draw(&self, canvas: &mut Canvas, (x, y): (usize, usize)) {
        canvas.text((x, y), &self.title, Style::CAPTION);
        let top = y + Style::CAPTION.line() + 4;
        for j in 0..RAMP_HEIGHT {
            let colour = (self.colour)(1.0 - j as f64 / (RAMP_HEIGHT - 1) as f64);
            (0..RAMP).for_each(|i| canvas.set(x + i, top + j, colour));
        }
        let beside = x + RAMP + 6;
        canvas.text((beside, top), &self.high, Style::CAPTION);
        canvas.text((beside, top + RAMP_HEIGHT - Style::CAPTION.line()), &self.low, Style::CAPTION);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet() -> Sheet {
        let panel = |value: u8, side: usize| {
            let picture = Grid::from_fn(Size { width: side, height: side }, |_, _| [value; 3]);
            Some(Panel::of(picture).said(["a caption, longer than its picture".to_owned()]))
        };
        Sheet {
            title: "Title".to_owned(),
            columns: vec!["one".to_owned(), "two".to_owned()],
            rows: vec![
                SheetRow { head: vec!["first".to_owned()], panels: vec![panel(100, 30), panel(110, 50)] },
                SheetRow { head: vec!["second".to_owned()], panels: vec![None, panel(120, 20)] },
            ],
            scale: Some(Scale {
                title: "error".to_owned(),
                low: "0".to_owned(),
                high: "0.5".to_owned(),
                colour: super::super::heat,
            }),
        }
    }

    #[test]
    fn panels_lie_whole_on_the_sheet_and_apart() {
        for theme in Theme::ALL {
            let canvas = sheet().draw(theme);
            assert_eq!(canvas.size(), sheet().size());
            let grid = canvas.into_grid();
            let count = |value: u8| grid.texels().iter().filter(|p| **p == [value; 3]).count();
            // Every pixel of every panel is there: nothing is drawn over it. Ink may have the same grey.
            assert!(count(100) >= 900 && count(110) >= 2500 && count(120) >= 400);
            assert_eq!(grid.row(0)[0], theme.paper());
        }
    }

    #[test]
    fn small_pictures_grow_by_whole_pixels() {
        let picture = Grid::from_fn(Size { width: 3, height: 2 }, |x, y| [(10 * x + y) as u8; 3]);
        let large = enlarged(&picture, 10);
        assert_eq!(large.size(), Size { width: 12, height: 8 });
        assert!((0..8).all(|y| (0..12).all(|x| large.row(y)[x] == picture.row(y / 4)[x / 4])));
        assert_eq!(enlarged(&picture, 2).size(), picture.size());
    }
}
