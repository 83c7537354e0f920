//! Errors of the library.

use ndfmap_core::bake::BakeError;
use ndfmap_core::measure::TooNarrow;
use ndfmap_core::ndf::ParseMethodError;
use ndfmap_core::observe::Cancelled;
#[cfg(feature = "shaders")]
use ndfmap_gpu::GpuError;
use ndfmap_maps::MapError;

/// Reason why something was not done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The request names things that do not exist, or that do not fit each other.
    #[error("{0}")]
    Request(String),
    /// A file could not be read or written.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A GPU could not do it.
    #[cfg(feature = "shaders")]
    #[error(transparent)]
    Gpu(GpuError),
    /// The observer cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// Something else went wrong.
    #[error("{0}")]
    Failed(String),
}

impl From<BakeError<MapError>> for Error {
    fn from(error: BakeError<MapError>) -> Self {
        match error {
            BakeError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            BakeError::Sink(error) => Self::Map(error),
        }
    }
}

impl From<TooNarrow> for Error {
    fn from(error: TooNarrow) -> Self {
        Self::Request(error.to_string())
    }
}

impl From<ParseMethodError> for Error {
    fn from(error: ParseMethodError) -> Self {
        Self::Request(error.to_string())
    }
}

#[cfg(feature = "shaders")]
impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Gpu(other),
        }
    }
}
