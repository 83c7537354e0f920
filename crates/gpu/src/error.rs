//! Errors on a GPU, in words that say what to do.

/// A failure of the GPU, or of what was asked of it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The observer cancelled.
    #[error(transparent)]
    Cancelled(#[from] ndfmap_core::observe::Cancelled),
    /// There is no adapter, not even a software one.
    #[error(
        "there is no GPU that can be used, and no software one (such as lavapipe, package mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// The adapter gave no device.
    #[error("{adapter} cannot be opened: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// Reason that the adapter gives.
        reason: String,
    },
    /// A texture that is larger than textures can be.
    #[error(
        "{what} of {width} × {height} in {layers} layers is too large for {adapter}, which takes {most} × {most} in {most_layers}"
    )]
    TooLarge {
        /// Thing that is too large.
        what: String,
        /// Texels, or pixels.
        width: u32,
        /// Texels, or pixels.
        height: u32,
        /// Layers.
        layers: u32,
        /// The adapter's name.
        adapter: String,
        /// Largest side that it takes.
        most: u32,
        /// Most layers that it takes.
        most_layers: u32,
    },
    /// A picture without a pixel.
    #[error("a picture must have a pixel")]
    Empty,
    /// Something that needs a feature the adapter lacks.
    #[error("{adapter} has no {feature}: {instead}")]
    Unsupported {
        /// The adapter's name.
        adapter: String,
        /// Feature that it lacks.
        feature: &'static str,
        /// Advice: what to do instead.
        instead: &'static str,
    },
    /// The device went away.
    #[error("{adapter} was lost: {reason}")]
    Lost {
        /// The adapter's name.
        adapter: String,
        /// Message of the driver.
        reason: String,
    },
    /// Memory ran out.
    #[error("{0} has not enough memory for this picture and its maps")]
    OutOfMemory(String),
    /// A shader that does not hold together: our fault.
    #[error("a shader is not valid: {0}")]
    Shader(String),
    /// A method or a language that cannot have the shader that was asked for.
    #[error("`{subject}` {reason}")]
    Unsuited {
        /// Spelling of the method, or of the language.
        subject: String,
        /// Reason in words.
        reason: &'static str,
    },
    /// Anything else that the driver or wgpu complains about.
    #[error("{adapter}: {reason}")]
    Driver {
        /// The adapter's name.
        adapter: String,
        /// Message of the driver or of wgpu.
        reason: String,
    },
}
