//! The table of lobes, and how their spellings are read.

use std::str::FromStr;

use super::{AnyLobe, beckmann, blinn_phong, ggx, lambert, measured, torrance_sparrow};

/// A row of [`TABLE`].
pub struct Row {
    /// The word before the colon.
    pub name: &'static str,
    /// Parameter that follows the name, for help: `:S`, `:ALPHA` or nothing.
    pub parameter: &'static str,
    /// Summary in one line, for help and docs.
    pub summary: &'static str,
    /// Reads the parameter.
    pub parse: fn(&str) -> Result<AnyLobe, String>,
    /// Spellings that the conformance tests run.
    pub samples: &'static [&'static str],
}

/// Every lobe there is.
pub static TABLE: &[Row] = &[
    lambert::ROW,
    blinn_phong::ROW,
    torrance_sparrow::ROW,
    beckmann::ROW,
    ggx::ROW,
    measured::SGD,
    measured::ABC,
];

/// Other spellings of lobes in [`TABLE`].
pub static ALIASES: &[Row] = &[ggx::ROUGHNESS];

/// A spelling that names no lobe.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParseLobeError {
    /// No row of the table has this name.
    #[error("there is no BRDF called `{0}`")]
    Unknown(String),
    /// The parameter is missing, superfluous or out of range.
    #[error("BRDF `{spelling}`: {reason}")]
    Parameter {
        /// Spelling as it was written.
        spelling: String,
        /// Reason why it is wrong.
        reason: String,
    },
}

impl FromStr for AnyLobe {
    type Err = ParseLobeError;

    /// Reads a spelling such as `blinn-phong:50`, `ggx:0.2`, `roughness:0.45` or `lambert`; its name in small
    /// letters or capitals.
    fn from_str(spelling: &str) -> Result<Self, ParseLobeError> {
        let (name, parameter) = spelling.split_once(':').unwrap_or((spelling, ""));
        let row = TABLE
            .iter()
            .chain(ALIASES)
            .find(|row| row.name.eq_ignore_ascii_case(name))
            .ok_or_else(|| ParseLobeError::Unknown(name.to_owned()))?;
        let wrong = |reason| ParseLobeError::Parameter { spelling: spelling.to_owned(), reason };
        if parameter.is_empty() && !row.parameter.is_empty() {
            return Err(wrong(format!("{} must follow, as in `{}`", &row.parameter[1..], row.samples[0])));
        }
        (row.parse)(parameter).map_err(wrong)
    }
}

/// Reads the one number of a lobe into its unit.
pub(super) fn number<U, E: ToString>(text: &str, unit: fn(f64) -> Result<U, E>) -> Result<U, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    unit(value).map_err(|e| e.to_string())
}
