//! The contact sheet of a rendering: truth and every method side by side, their differences, and the errors under them.

use ndfmap_core::metrics::{Picture, display};
use ndfmap_maps::picture::to_bytes;

use super::canvas::{Canvas, LETTER, LINE, Rgb, heat};
use crate::Failure;
use crate::imaging::{Errors, Reel};

/// Difference of display values, over sqrt 3, that is drawn brightest.
const BRIGHTEST: f32 = 0.5;

/// Draws the sheet as a PNG file: two rows a frame where there is a truth, else one.
pub(crate) fn draw(reel: &Reel, title: &str) -> Result<Vec<u8>, Failure> {
    let Some(first) = reel.frames.first() else { return Canvas::new(1, 1).to_png() };
    let size = first.takes[0].picture.size();
    let has_truth = first.truth.is_some();
    let (gap, label) = (8, 2 * LINE);
    let step_x = size.width.max(24 * LETTER) + gap;
    let rows = if has_truth { 2 } else { 1 };
    let step_y = rows * (size.height + gap) + 3 * LINE;
    let columns = reel.methods.len() + usize::from(has_truth);
    let mut canvas = Canvas::new(
        gap + (columns * step_x).max((title.len() + 2) * LETTER),
        2 * LINE + label + reel.frames.len() * step_y,
    );
    canvas.text(gap, 8, title);
    for (row, frame) in reel.frames.iter().enumerate() {
        let y = 2 * LINE + label + row * step_y;
        let column = |at: usize| gap + at * step_x;
        let mut at = 0;
        if let Some(truth) = &frame.truth {
            paint(&mut canvas, (column(0), y), &truth.picture, frame.exposure);
            let below = y + size.height + gap;
            canvas.text(column(0), below, &format!("time {:.3}", frame.time));
            canvas.text(column(0), below + LINE, &format!("{} rays a pixel", truth.rays));
            canvas.text(column(0), below + 2 * LINE, &format!("noise {:.4}", truth.noise));
            canvas.text(column(0), below + 4 * LINE, "right: difference,");
            canvas.text(column(0), below + 5 * LINE, &format!("{BRIGHTEST} and more is light"));
            at = 1;
        }
        for take in &frame.takes {
            paint(&mut canvas, (column(at), y), &take.picture, frame.exposure);
            if let (Some(truth), Some(errors)) = (&frame.truth, take.errors) {
                let below = y + size.height + gap;
                difference(&mut canvas, (column(at), below), (&take.picture, &truth.picture), frame.exposure);
                let [first, second] = lines(errors);
                canvas.text(column(at), below + size.height + 3, &first);
                canvas.text(column(at), below + size.height + 3 + LINE, &second);
            }
            at += 1;
        }
    }
    let names = has_truth.then(|| "truth".to_owned()).into_iter().chain(reel.methods.iter().cloned());
    for (at, name) in names.enumerate() {
        canvas.text(gap + at * step_x, 2 * LINE + 8, &name);
    }
    canvas.to_png()
}

fn lines(e: Errors) -> [String; 2] {
    let flip = e.flip.map_or_else(String::new, |f| format!("flip {f:.3} "));
    let sparkle = e.sparkle.map_or_else(String::new, |s| format!("sparkle {s:.2}"));
    [format!("color {:.4} l2 {:.3}", e.color_error, e.relative_l2), flip + &sparkle]
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
