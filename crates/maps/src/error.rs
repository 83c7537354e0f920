//! Errors of files, always with the file's name.

use std::io;
use std::path::{Path, PathBuf};

/// A file that could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is damaged, or not what its name says.
    #[error("{}: {reason}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Damage, in words.
        reason: String,
    },
    /// The file is a sound picture, but holds neither normals nor heights.
    #[error("{}: {reason}", path.display())]
    NoMap {
        /// The file.
        path: PathBuf,
        /// Kind that it looks like, and the evidence.
        reason: String,
    },
    /// The file is sound, but of a kind that cannot be used here.
    #[error("{}: {reason}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Kind that is not supported, and kinds that are.
        reason: String,
    },
}

impl MapError {
    /// The operating system's error on `path`.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), source }
    }

    /// A damaged file.
    pub fn invalid(path: &Path, reason: impl ToString) -> Self {
        Self::Invalid { path: path.to_owned(), reason: reason.to_string() }
    }

    /// A sound file of the wrong kind.
    pub fn unsupported(path: &Path, reason: impl ToString) -> Self {
        Self::Unsupported { path: path.to_owned(), reason: reason.to_string() }
    }

    /// A baked map where a picture is due.
    pub(crate) fn baked(path: &Path) -> Self {
        let reason = "is already a baked map: `inspect` reads it, and `compare MAP --baked FILE` measures it";
        Self::NoMap { path: path.to_owned(), reason: reason.to_owned() }
    }
}
