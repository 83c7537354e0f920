//! Words on stderr, and how many of them: errors always, the rest as `--quiet` and `--verbose` say.

use std::fmt::Display;
use std::path::Path;
use std::sync::OnceLock;

/// Amount of words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Verbosity {
    /// Errors alone.
    Quiet,
    /// Warnings, and what is written and chosen, too.
    #[default]
    Usual,
    /// Evidence and times too.
    Verbose,
}

/// Choice of the command line, made once.
static VERBOSITY: OnceLock<Verbosity> = OnceLock::new();

/// Sets the amount of words; the first choice stays.
pub(crate) fn set(verbosity: Verbosity) {
    VERBOSITY.get_or_init(|| verbosity);
}

/// True where words of this kind are wanted.
pub(crate) fn wants(least: Verbosity) -> bool {
    VERBOSITY.get().copied().unwrap_or_default() >= least
}

/// Says something that is no warning.
pub(crate) fn say(words: impl Display) {
    if wants(Verbosity::Usual) {
        eprintln!("ndfmap: {words}");
    }
}

/// Says a detail, which `--verbose` asks for.
pub(crate) fn detail(words: impl Display) {
    if wants(Verbosity::Verbose) {
        eprintln!("ndfmap: {words}");
    }
}

/// Says a warning about a file.
pub(crate) fn warn(file: &Path, warning: &str) {
    if wants(Verbosity::Usual) {
        eprintln!("ndfmap: warning: {}: {warning}", file.display());
    }
}
