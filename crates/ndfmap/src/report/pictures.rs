//! The contact sheet of a rendering: truth and every method side by side, their differences, and the errors
//! under them. And the same as a film, as the camera drifts.

use ndfmap_core::grid::{Grid, Size};
use ndfmap_scene::metrics::{Picture, display, to_bytes};

use crate::Error;
use crate::draw::{Panel, Rgb, Scale, Sheet, SheetRow, Theme, enlarged, film, heat};
use crate::render::{Frame, PictureErrors, RenderReport};

/// Difference of display values, over sqrt 3, that is drawn brightest.
const BRIGHTEST: f32 = 0.5;

/// Pixels of the longer side of the smallest pictures on a sheet; smaller ones are enlarged.
const LEAST_SIDE: usize = 192;

/// Milliseconds of a frame of a film.
const FRAME_MS: u16 = 80;

/// Scale of the pictures of differences.
#[must_use]
pub fn difference_scale() -> Scale {
    Scale {
        title: "difference of display colours".to_owned(),
        low: "0".to_owned(),
        high: format!("{BRIGHTEST} and more"),
        colour: heat,
    }
}

/// Picture of the difference of two pictures' display values, by the colours of [`difference_scale`].
///
/// # Panics
/// When the pictures differ in size.
#[must_use]
pub fn difference(a: &Picture, truth: &Picture, exposure: f32) -> Grid<Rgb> {
    assert_eq!(a.size(), truth.size(), "pictures that are compared have one size");
    Grid::from_fn(a.size(), |x, y| {
        let distance = display(a.row(y)[x], exposure).distance(display(truth.row(y)[x], exposure));
        heat(f64::from(distance / 3.0_f32.sqrt() / BRIGHTEST))
    })
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

    /// Width and height that the pictures take, in pixels; words and gaps come on top.
    #[must_use]
    pub fn size(&self) -> Size {
        let Size { width, height } = self.picture;
        let times = LEAST_SIDE.div_ceil(width.max(height)).max(1);
        let rows = self.frames * if self.has_truth { 2 } else { 1 };
        Size { width: self.columns * width * times, height: rows * height * times }
    }
}

/// Sheet of a rendering whose pictures were kept: a row a frame, with a second for the differences where there
/// is a truth.
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
        rows.extend(rows_of(frame));
    }
    let scale = has_truth.then(difference_scale);
    Ok(Sheet { title: title.to_owned(), columns: names.collect(), rows, scale })
}

fn rows_of(frame: &Frame) -> Vec<SheetRow> {
    let shown = |p: &Picture| Panel::of(enlarged(&to_bytes(p, frame.exposure), LEAST_SIDE));
    let time = vec![format!("time {:.3}", frame.time)];
    let (Some(said), Some((truth, taken))) = (frame.truth, frame.pictures.split_first()) else {
        let panels = frame.pictures.iter().map(|p| Some(shown(p))).collect();
        return vec![SheetRow { head: time, panels }];
    };
    let lines = [format!("{} rays a pixel", said.rays), format!("noise {:.4}", said.noise)];
    let pictures = std::iter::once(shown(truth).said(lines)).chain(taken.iter().map(shown)).map(Some);
    let parts = frame.results.iter().zip(taken).map(|(result, picture)| {
        let apart = enlarged(&difference(picture, truth, frame.exposure), LEAST_SIDE);
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
/// camera drifts by a pixel. It shows the quarter of the picture in which most changes, enlarged. `None` where
/// no sparkle was measured.
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
