//! Why a command ended, and the exit status that says it: 1 failed, 2 wrong usage.

use std::process::ExitCode;

use ndfmap_maps::MapError;

/// A command that did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The command line asks for something that does not exist or fit.
    #[error("{0}")]
    Usage(String),
    /// A file could not be read or written.
    #[error(transparent)]
    Map(#[from] MapError),
    /// Something else went wrong.
    #[error("{0}")]
    Failed(String),
}

impl Failure {
    /// The exit status.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_) => ExitCode::from(2),
            Self::Map(_) | Self::Failed(_) => ExitCode::from(1),
        }
    }
}
