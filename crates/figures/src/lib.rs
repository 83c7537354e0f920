//! ndfmap-figures: the figures and tables of the four papers, made again on scenes and maps of our own, with
//! the papers' numbers beside ours.
//!
//! [`TABLE`] has a row for each, and a file of `rows` draws each. A figure is a [`Drawing`]: sheets of
//! labelled panels, [`Claim`]s with both numbers, and a sentence on why they agree or not. [`write()`] puts
//! one into a folder, [`index`] makes a page of many.

mod claim;
mod page;
mod plan;
mod rows;
mod shot;

pub use claim::{Claim, Verdict};
pub use page::{Made, PAGE, digits, index, write};
pub use plan::Plan;

use ndfmap::Error;
use ndfmap::draw::Sheet;

/// Paper that figures are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Paper {
    /// Tan, Lin, Quan, Guo and Shum 2005, Multiresolution Reflectance Filtering.
    Tan,
    /// Han, Sun, Ramamoorthi and Grinspun 2007, Frequency Domain Normal Map Filtering.
    Han,
    /// Olano and North 1997, Normal Distribution Mapping.
    Olano,
    /// Dupuy, Heitz, Iehl, Poulin, Neyret and Ostromoukhov 2013, LEADR mapping, supplemental.
    Leadr,
}

impl Paper {
    /// Every paper, in the order of the page.
    pub const ALL: [Self; 4] = [Self::Tan, Self::Han, Self::Olano, Self::Leadr];

    /// Authors, year and title.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Tan => "Tan et al. 2005, Multiresolution Reflectance Filtering",
            Self::Han => "Han et al. 2007, Frequency Domain Normal Map Filtering",
            Self::Olano => "Olano and North 1997, Normal Distribution Mapping",
            Self::Leadr => "Dupuy et al. 2013, LEADR Mapping, supplemental",
        }
    }
}

/// Figure or table of a paper: a row of [`TABLE`].
pub struct Figure {
    /// Name on the command line.
    pub name: &'static str,
    /// Paper it is from.
    pub paper: Paper,
    /// Place in the paper.
    pub place: &'static str,
    /// Summary in one line.
    pub summary: &'static str,
    /// Draws it.
    draw: fn(&Plan<'_>) -> Result<Drawing, Error>,
}

impl Figure {
    /// Draws the figure and measures what it claims.
    ///
    /// # Errors
    /// [`Error`] of a device, and [`Error::Cancelled`] by the plan's observer.
    pub fn draw(&self, plan: &Plan<'_>) -> Result<Drawing, Error> {
        (self.draw)(plan)
    }
}

/// Figure that was made again.
pub struct Drawing {
    /// Pictures, laid out as in the paper; the first is the figure, the others stand below it.
    pub sheets: Vec<Sheet>,
    /// Numbers of the paper and ours.
    pub claims: Vec<Claim>,
    /// Differences from the paper, and why numbers come out or not, in a sentence or two.
    pub why: &'static str,
}

/// Every figure, by paper and place.
pub static TABLE: &[Figure] = &[
    rows::tan_1::ROW,
    rows::tan_4::ROW,
    rows::tan_5::ROW,
    rows::tan_6::ROW,
    rows::tan_7::ROW,
    rows::tan_8::ROW,
    rows::tan_speed::ROW,
    rows::han_1::ROW,
    rows::han_2::ROW,
    rows::han_3::ROW,
    rows::han_4::ROW,
    rows::han_5::ROW,
    rows::han_6::ROW,
    rows::han_7::ROW,
    rows::han_8::ROW,
    rows::han_9::ROW,
    rows::han_order::ROW,
    rows::olano_1::ROW,
    rows::olano_2::ROW,
    rows::olano_7::ROW,
    rows::olano_densities::ROW,
    rows::leadr_tables::TABLE_3,
    rows::leadr_tables::TABLE_4,
    rows::leadr_tables::TABLE_5,
    rows::leadr_tables::TABLE_6,
    rows::leadr_tables::TABLE_7,
    rows::leadr_tables::TABLE_8,
    rows::leadr_tables::TABLE_9,
    rows::leadr_tables::TABLE_10,
    rows::leadr_figure_5::ROW,
    rows::leadr_figure_6::ROW,
];

/// The figure of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Figure> {
    TABLE.iter().find(|row| row.name.eq_ignore_ascii_case(name))
}
