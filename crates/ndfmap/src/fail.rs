//! Why a command ended, and the exit status that says it: 1 failed, 2 wrong usage.

use std::process::ExitCode;

use ndfmap_core::bake::BakeError;
use ndfmap_core::observe::Cancelled;
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
    /// The observer wanted no more.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
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
            Self::Map(_) | Self::Cancelled(_) | Self::Failed(_) => ExitCode::from(1),
        }
    }
}

impl From<BakeError<MapError>> for Failure {
    fn from(error: BakeError<MapError>) -> Self {
        match error {
            BakeError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            BakeError::Sink(error) => Self::Map(error),
        }
    }
}
