//! The contact sheet of a rendering: truth and every method side by side, their differences, and the errors
//! under them.

use ndfmap_core::grid::Size;
use ndfmap_scene::metrics::{Picture, display, to_bytes};

use super::canvas::{Canvas, LETTER, LINE, Rgb, heat};
use crate::Error;
use crate::render::{PictureErrors, RenderReport};

/// Difference of display values, over sqrt 3, that is drawn brightest.
const BRIGHTEST: f32 = 0.5;

/// Layout of a contact sheet.
pub struct SheetPlan {
    picture: Size,
    has_truth: bool,
    columns: usize,
    frames: usize,
}

/// Gap between pictures, and above the first.
const GAP: usize = 8;
const TOP: usize = 4 * LINE;

impl SheetPlan {
    /// Plans a sheet for this many methods and frames of pictures of a size, perhaps with the truth.
    #[must_use]
    pub fn new(picture: Size, has_truth: bool, methods: usize, frames: usize) -> Self {
        Self { picture, has_truth, columns: methods + usize::from(has_truth), frames }
    }

    /// Width and height of the sheet, in pixels.
    #[must_use]
    pub fn size(&self) -> Size {
        Size { width: GAP + self.columns * self.step_x(), height: TOP + self.frames * self.step_y() }
    }

    fn step_x(&self) -> usize {
        self.picture.width.max(24 * LETTER) + GAP
    }

    /// Height of a frame: its pictures, their differences where there is a truth, and lines of text.
    fn step_y(&self) -> usize {
        (if self.has_truth { 2 } else { 1 }) * (self.picture.height + GAP) + 4 * LINE
    }
}

/// Draws the contact sheet of a rendering whose pictures were kept, as a PNG file: two rows a frame where
/// there is a truth, else one.
///
/// # Errors
/// [`Error::Failed`] for a sheet that cannot be encoded.
pub fn contact_sheet(report: &RenderReport, title: &str) -> Result<Vec<u8>, Error> {
    let Some(first) = report.frames.first() else { return Canvas::new(1, 1).to_png() };
    let has_truth = first.truth.is_some();
    let kept = first.pictures.first();
    let size = kept.ok_or_else(|| Error::Request("the pictures were not kept".to_owned()))?.size();
    let plan = SheetPlan::new(size, has_truth, report.methods.len(), report.frames.len());
    let Size { width, height } = plan.size();
    let mut canvas = Canvas::new(width.max((title.len() + 2) * LETTER), height);
    canvas.text(GAP, 8, title);
    let column = |at: usize| GAP + at * plan.step_x();
    for (row, frame) in report.frames.iter().enumerate() {
        let y = TOP + row * plan.step_y();
        let below = y + size.height + GAP;
        for (at, picture) in frame.pictures.iter().enumerate() {
            paint(&mut canvas, (column(at), y), picture, frame.exposure);
        }
        if let (Some(said), Some((truth, taken))) = (frame.truth, frame.pictures.split_first()) {
            let lines = [
                format!("time {:.3}", frame.time),
                format!("{} rays a pixel", said.rays),
                format!("noise {:.4}", said.noise),
                "right: difference,".to_owned(),
                format!("{BRIGHTEST} and more is light"),
            ];
            for (line, text) in lines.iter().enumerate() {
                canvas.text(column(0), below + line * LINE, text);
            }
            for (at, (result, picture)) in frame.results.iter().zip(taken).enumerate() {
                difference(&mut canvas, (column(at + 1), below), (picture, truth), frame.exposure);
                for (line, text) in result.errors.iter().flat_map(|e| lines_of(*e)).enumerate() {
                    canvas.text(column(at + 1), below + size.height + 3 + line * LINE, &text);
                }
            }
        }
    }
    let names = has_truth.then(|| "truth".to_owned()).into_iter().chain(report.methods.iter().cloned());
    for (at, name) in names.enumerate() {
        canvas.text(column(at), 2 * LINE + 8, &name);
    }
    canvas.to_png()
}

fn lines_of(e: PictureErrors) -> [String; 2] {
    let sparkle = e.sparkle.map_or_else(String::new, |s| format!(" sparkle {s:.2}"));
    [format!("color {:.4} l2 {:.3}", e.color_error, e.relative_l2), format!("flip {:.3}{sparkle}", e.flip)]
}

fn paint(canvas: &mut Canvas, at: (usize, usize), picture: &Picture, exposure: f32) {
    let bytes = to_bytes(picture, exposure);
    fill(canvas, at, picture, |x, y| bytes.row(y)[x]);
}

fn difference(canvas: &mut Canvas, at: (usize, usize), (a, truth): (&Picture, &Picture), exposure: f32) {
    fill(canvas, at, a, |x, y| {
        let distance = display(a.row(y)[x], exposure).distance(display(truth.row(y)[x], exposure));
        heat(f64::from((distance / 3.0_f32.sqrt() / BRIGHTEST).min(1.0)))
    });
}

fn fill(canvas: &mut Canvas, (x0, y0): (usize, usize), like: &Picture, colour: impl Fn(usize, usize) -> Rgb) {
    for y in 0..like.size().height {
        for x in 0..like.size().width {
            canvas.set(x0 + x, y0 + y, colour(x, y));
        }
    }
}
