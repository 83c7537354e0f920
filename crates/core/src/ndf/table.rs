//! The table of methods, and how their spellings are read.

use std::ops::RangeInclusive;
use std::str::FromStr;

use super::{
    AnyMethod, Representation, fixed, gmm, naive, ndm, phong, sh, slopes, stereographic, toksvig, vmf,
};

/// A row of [`TABLE`].
pub struct Row {
    /// The word before the first colon.
    pub name: &'static str,
    /// Other names that people know it by.
    pub aliases: &'static [&'static str],
    /// Parameters that may follow the name, for help.
    pub parameters: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Paper that published it.
    pub paper: &'static str,
    /// Reads what follows the name, split at colons.
    pub parse: fn(&[&str]) -> Result<AnyMethod, ParameterError>,
    /// Spellings that the conformance suite runs, the plain one first.
    pub samples: &'static [&'static str],
}

/// Every method there is.
pub static TABLE: &[Row] = &[
    fixed::ROW,
    naive::ROW,
    toksvig::ROW,
    ndm::ROW,
    stereographic::ROW,
    slopes::ROW,
    sh::ROW,
    vmf::ROW,
    gmm::ROW,
    phong::ROW,
];

/// Method of every command, unless told otherwise: as many bytes as slopes take, three fifths of their error
/// on real maps, at texels and between them (`docs/choose.md`).
pub const DEFAULT_METHOD: &str = "vmf:2";

/// Parameter of a method that is out of its range, or a word that it does not know.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// A count that is no whole number in its range.
    #[error("the {what} must be a whole number from {least} to {most}, as in `{example}`")]
    Count {
        /// Quantity that is counted.
        what: &'static str,
        /// Least count.
        least: usize,
        /// Largest count.
        most: usize,
        /// Example of a right spelling.
        example: &'static str,
    },
    /// Factors of a lobe that is not known when baking.
    #[error("factors are integrated before the BRDF is known: name `gaussian` or `pearson`")]
    UnknownLobe,
    /// Words that the method does not know.
    #[error("{0}")]
    Words(String),
}

/// A count within its range.
pub(super) fn counted(
    count: usize,
    what: &'static str,
    range: RangeInclusive<usize>,
    example: &'static str,
) -> Result<usize, ParameterError> {
    let (least, most) = (*range.start(), *range.end());
    if range.contains(&count) { Ok(count) } else { Err(ParameterError::Count { what, least, most, example }) }
}

/// A word as a count; 0, which is in no range, for a word that is not a count.
pub(super) fn count_of(word: Option<&&str>) -> usize {
    word.and_then(|word| word.parse().ok()).unwrap_or(0)
}

/// For rows without parameters.
pub(super) fn no_parameters(
    words: &[&str],
    method: impl Representation,
) -> Result<AnyMethod, ParameterError> {
    if words.is_empty() {
        Ok(AnyMethod::from(method))
    } else {
        Err(ParameterError::Words("takes no parameter".to_owned()))
    }
}

/// A spelling that names no method.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ParseMethodError {
    /// No row of the table has this name.
    #[error("there is no method called `{0}`")]
    Unknown(String),
    /// The parameters that follow the name are wrong.
    #[error("method `{spelling}`: {reason}")]
    Parameter {
        /// Spelling as it was written.
        spelling: String,
        /// Reason why it is wrong.
        reason: ParameterError,
    },
}

impl FromStr for AnyMethod {
    type Err = ParseMethodError;

    /// Reads a spelling such as `toksvig`, `sh:7` or `ndm:pearson:integrated`, in small letters or capitals.
    fn from_str(spelling: &str) -> Result<Self, ParseMethodError> {
        let small = spelling.to_lowercase();
        let words: Vec<&str> = small.split(':').collect();
        let row = TABLE
            .iter()
            .find(|row| row.name == words[0] || row.aliases.contains(&words[0]))
            .ok_or_else(|| ParseMethodError::Unknown(words[0].to_owned()))?;
        (row.parse)(&words[1..])
            .map_err(|reason| ParseMethodError::Parameter { spelling: spelling.to_owned(), reason })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_as_people_write_them() {
        let method = |spelling: &str| spelling.parse::<AnyMethod>().unwrap().to_string();
        assert_eq!(method("LEADR"), "slopes");
        assert_eq!(method("Lean:9"), "slopes:9");
        assert_eq!(method("VMF:4:Unaligned"), "vmf:4:unaligned");
        assert_eq!(method(DEFAULT_METHOD), DEFAULT_METHOD);
    }
}
