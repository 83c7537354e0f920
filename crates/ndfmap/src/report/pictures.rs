//! The contact sheet of a rendering: truth and every method side by side, their differences, and the errors
//! under them. And the same as a film, as the camera drifts.

use glam::Vec3;
use ndfmap_core::grid::{Grid, Size};
use ndfmap_scene::metrics::{Picture, display, to_bytes};

use crate::Error;
use crate::draw::{Panel, Rgb, Scale, Sheet, SheetRow, Theme, enlarged, film, heat};
use crate::render::{Frame, PictureErrors, RenderReport};

/// Pixels of the longer side of the smallest pictures on a sheet; smaller ones are enlarged.
const LEAST_SIDE: usize = 192;

/// Milliseconds of a frame of a film.
const FRAME_MS: u16 = 80;

/// Colours of the differences of display values, over sqrt 3, on one sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceColours {
    /// Difference that is drawn lightest.
    pub lightest: f32,
}

impl DifferenceColours {
    /// Colours that show what differs on a sheet: one in two hundred pixels may be beyond the lightest.
    #[must_use]
    pub fn of<'a>(pairs: impl Iterator<Item = (&'a Picture, &'a Picture)>, exposure: f32) -> Self {
        const STEPS: [f32; 5] = [0.02, 0.05, 0.1, 0.2, 0.5];
        let mut all: Vec<f32> = pairs
            .flat_map(|(a, b)| a.texels().iter().zip(b.texels()))
            .map(|(a, b)| apart(*a, *b, exposure))
            .collect();
        let place = all.len() - all.len() / 200;
        let most = if place == 0 { 0.0 } else { *all.select_nth_unstable_by(place - 1, f32::total_cmp).1 };
        Self { lightest: STEPS.into_iter().find(|step| *step >= most).unwrap_or(STEPS[4]) }
    }

    /// Scale to be drawn beside them.
    #[must_use]
    pub fn scale(self) -> Scale {
        Scale {
            title: "difference of display colours".to_owned(),
            low: "0".to_owned(),
            high: format!("{} and more", self.lightest),
            colour: heat,
        }
    }

    /// Picture of the difference of two pictures.
    ///
    /// # Panics
    /// When the pictures differ in size.
    #[must_use]
    pub fn draw(self, a: &Picture, truth: &Picture, exposure: f32) -> Grid<Rgb> {
        assert_eq!(a.size(), truth.size(), "pictures that are compared have one size");
        Grid::from_fn(a.size(), |x, y| {
            heat(f64::from(apart(a.row(y)[x], truth.row(y)[x], exposure) / self.lightest))
        })
    }
}

/// Distance of the display values of two colours, over sqrt 3.
fn apart(a: Vec3, b: Vec3, exposure: f32) -> f32 {
    display(a, exposure).distance(display(b, exposure)) / 3.0_f32.sqrt()
}

/// Layout of a contact sheet, before its pictures are rendered.
pub struct SheetPlan {
    picture: Size,
    has_truth: bool,
    columns: usize,
    frames: usize,
}

impl SheetPlan {
    /// Plans a sheet for this many methods and frames of pictures of a size, perhaps with the truth.
    #[must_use]
    pub fn new(picture: Size, has_truth: bool, methods: usize, frames: usize) -> Self {
        Self { picture, has_truth, columns: methods + usize::from(has_truth), frames }
    }

    /// Width and height that the pictures take, in pixels, at the least size that their captions ask for.
    #[must_use]
    pub fn size(&self) -> Size {
        let Size { width, height } = self.picture;
        let times = LEAST_SIDE.div_ceil(width.max(height)).max(1);
        let rows = self.frames * if self.has_truth { 2 } else { 1 };
        // Captions are no wider than the smallest pictures.
        let [width, height] = [width, height].map(|side| (side * times).max(LEAST_SIDE));
        Size { width: self.columns * width, height: rows * height }
    }
}

/// Sheet of a rendering whose pictures were kept: a row a frame, with a second for the differences where
/// there is a truth.
///
/// # Errors
/// [`Error::Request`] for pictures that were not kept.
pub fn rendering_sheet(report: &RenderReport, title: &str) -> Result<Sheet, Error> {
    let has_truth = report.frames.first().is_some_and(|f| f.truth.is_some());
    let names = has_truth.then(|| "truth".to_owned()).into_iter().chain(report.methods.iter().cloned());
    let mut rows = Vec::new();
    for frame in &report.frames {
        if frame.pictures.is_empty() {
            return Err(Error::Request("the pictures were not kept".to_owned()));
        }
    }
    let exposure = report.frames.first().map_or(1.0, |f| f.exposure);
    let colours = DifferenceColours::of(report.frames.iter().flat_map(compared), exposure);
    rows.extend(report.frames.iter().flat_map(|frame| rows_of(frame, colours)));
    let scale = has_truth.then(|| colours.scale());
    Ok(Sheet { title: title.to_owned(), columns: names.collect(), rows, scale })
}

/// Pictures of a frame, each with the truth.
fn compared(frame: &Frame) -> Vec<(&Picture, &Picture)> {
    let split = frame.pictures.split_first().filter(|_| frame.truth.is_some());
    split.map_or_else(Vec::new, |(truth, taken)| taken.iter().map(|p| (p, truth)).collect())
}

fn rows_of(frame: &Frame, colours: DifferenceColours) -> Vec<SheetRow> {
    let shown = |p: &Picture| Panel::of(enlarged(&to_bytes(p, frame.exposure), LEAST_SIDE));
    let time = vec![format!("time {:.3}", frame.time)];
    let (Some(said), Some((truth, taken))) = (frame.truth, frame.pictures.split_first()) else {
        let panels = frame.pictures.iter().map(|p| Some(shown(p))).collect();
        return vec![SheetRow { head: time, panels }];
    };
    let lines = [format!("{} rays a pixel", said.rays), format!("noise {:.4}", said.noise)];
    let pictures = std::iter::once(shown(truth).said(lines)).chain(taken.iter().map(shown)).map(Some);
    let parts = frame.results.iter().zip(taken).map(|(result, picture)| {
        let apart = enlarged(&colours.draw(picture, truth, frame.exposure), LEAST_SIDE);
        Some(Panel::of(apart).said(result.errors.iter().flat_map(|e| lines_of(*e))))
    });
    vec![
        SheetRow { head: time, panels: pictures.collect() },
        SheetRow {
            head: vec!["difference".to_owned()],
            panels: std::iter::once(None).chain(parts).collect(),
        },
    ]
}

fn lines_of(e: PictureErrors) -> Vec<String> {
    let mut lines =
        vec![format!("colour {:.4}", e.color_error), format!("L2 {:.3}, FLIP {:.3}", e.relative_l2, e.flip)];
    lines.extend(e.sparkle.map(|s| format!("sparkle {s:.2}")));
    lines
}

/// Draws the contact sheet of a rendering whose pictures were kept, as a PNG file.
///
/// # Errors
/// [`Error::Request`] for pictures that were not kept, [`Error::Failed`] for a sheet that cannot be encoded.
pub fn contact_sheet(report: &RenderReport, title: &str, theme: Theme) -> Result<Vec<u8>, Error> {
    rendering_sheet(report, title)?.draw(theme).to_png()
}

/// Film of a rendering whose drift was kept, as an animated PNG: truth and every method side by side, as the
/// camera drifts by a pixel. It shows the quarter of the picture in which most changes, enlarged. `None`
/// where no sparkle was measured.
///
/// # Errors
/// [`Error::Failed`] for a film that cannot be encoded.
pub fn drift_film(report: &RenderReport, theme: Theme) -> Result<Option<Vec<u8>>, Error> {
    let Some(frame) = report.frames.first().filter(|f| f.drifts.len() > 1) else { return Ok(None) };
    let names = std::iter::once("truth".to_owned()).chain(report.methods.iter().cloned()).collect::<Vec<_>>();
    let (size, corner) = liveliest(frame);
    let drawn = (0..frame.drifts[0].len()).map(|at| {
        let panel = |drift: &Vec<Picture>| {
            let part = Picture::from_fn(size, |x, y| drift[at].row(corner.1 + y)[corner.0 + x]);
            Some(Panel::of(enlarged(&to_bytes(&part, frame.exposure), LEAST_SIDE)))
        };
        let panels = frame.drifts.iter().map(panel).collect();
        let rows = vec![SheetRow { head: Vec::new(), panels }];
        Sheet { columns: names.clone(), rows, ..Sheet::default() }.draw(theme).into_grid()
    });
    film(&drawn.collect::<Vec<_>>(), FRAME_MS).map(Some)
}

/// Size and upper left corner of the quarter of a frame in which the pictures change most as they drift.
fn liveliest(frame: &Frame) -> (Size, (usize, usize)) {
    let Size { width, height } = frame.drifts[0][0].size();
    let size = Size { width: width.div_ceil(2), height: height.div_ceil(2) };
    let change = |corner: (usize, usize)| {
        let ends = frame.drifts.iter().map(|drift| [&drift[0], &drift[drift.len() / 2]]);
        let of = |[a, b]: [&Picture; 2]| {
            let pixels = (0..size.area()).map(|i| (corner.0 + i % size.width, corner.1 + i / size.width));
            pixels
                .map(|(x, y)| {
                    display(a.row(y)[x], frame.exposure).distance(display(b.row(y)[x], frame.exposure))
                })
                .sum::<f32>()
        };
        ends.map(of).sum::<f32>()
    };
    let steps = (0..9)
        .flat_map(|j| (0..9).map(move |i| ((width - size.width) * i / 8, (height - size.height) * j / 8)));
    let best = steps.max_by(|a, b| change(*a).total_cmp(&change(*b)));
    (size, best.unwrap_or((0, 0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_differences_span_what_differs() {
        let flat = |value: f32| Picture::from_fn(Size { width: 20, height: 20 }, |_, _| Vec3::splat(value));
        let one = |x: usize, y: usize, value: f32| Vec3::splat(if x + y == 0 { value } else { 0.5 });
        let spot = Picture::from_fn(Size { width: 20, height: 20 }, |x, y| one(x, y, 1.0));
        let of = |a: &Picture, b: &Picture| DifferenceColours::of(std::iter::once((a, b)), 1.0).lightest;
        assert_eq!(of(&flat(0.5), &flat(0.5)), 0.02);
        // Two pixels of four hundred may be beyond the lightest.
        assert_eq!(of(&spot, &flat(0.5)), 0.02);
        assert_eq!(of(&flat(0.0), &flat(1.0)), 0.5);
        // 0.5 is 0.735 on a display, 0.6 is 0.798.
        assert_eq!(of(&flat(0.5), &flat(0.6)), 0.1);
        let colours = DifferenceColours { lightest: 0.5 };
        assert_eq!(colours.draw(&flat(0.0), &flat(1.0), 1.0).row(0)[0], heat(1.0));
        assert_eq!(colours.draw(&flat(0.3), &flat(0.3), 1.0).row(0)[0], heat(0.0));
    }
}
