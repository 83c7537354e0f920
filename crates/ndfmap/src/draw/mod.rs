//! Drawings: sheets of labelled panels, plots, and the canvas and the colours that both are drawn with.
//!
//! A [`Sheet`] is laid out by its contents, and is drawn light or dark. Reports, contact sheets and the
//! figures of the papers are all sheets.

mod canvas;
mod colour;
mod disk;
mod film;
mod plot;
mod sheet;
mod text;

pub use canvas::{Canvas, Rgb, Theme};
pub use colour::{heat, line_colours};
pub use disk::Disk;
pub use film::film;
pub use plot::{Axis, Line, Plot};
pub use sheet::{Content, Panel, Scale, Sheet, SheetRow, enlarged};
pub use text::{Style, width};
