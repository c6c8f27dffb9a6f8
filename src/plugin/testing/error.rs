//! Why an app could not be drawn into a picture.
//!
//! In: the errors of loading, drawing, reading back and writing. Out: a [`TestingError`].

use crate::codec::CodecError;
use bevy::asset::AssetLoadError;
use std::sync::Arc;

/// Why an app could not be drawn into a picture.
#[derive(Debug, thiserror::Error)]
pub enum TestingError {
    /// The machine has no GPU adapter: a reason to skip a test, not to fail it.
    #[error("no GPU adapter: install a Vulkan driver (mesa-vulkan-drivers has one in software)")]
    NoGpu,
    /// The app has no [`Offscreen`](super::Offscreen).
    #[error("the app has no picture to draw into; make it with bevy_gs4d::testing::app")]
    NotOffscreen,
    /// An asset that is waited for cannot be loaded.
    #[error(transparent)]
    Asset(Arc<AssetLoadError>),
    /// An asset or a shader is not ready in time.
    #[error("not ready after {seconds} s: {what}")]
    Slow {
        /// The time waited, in seconds.
        seconds: u64,
        /// What is missing.
        what: String,
    },
    /// A shader or a pipeline does not compile.
    #[error("a pipeline failed: {0}")]
    Pipeline(String),
    /// The app asked to exit, as Bevy does when the GPU reports an error.
    #[error("rendering stopped; the log says why")]
    Stopped,
    /// The GPU did not deliver the picture, or not all of it.
    #[error("the picture did not come back from the GPU")]
    Readback,
    /// The picture could not be written.
    #[error(transparent)]
    Save(#[from] CodecError),
}
