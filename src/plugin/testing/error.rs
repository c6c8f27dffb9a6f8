//! The reasons why an app could not be drawn into a picture.
//!
//! In: the errors of loading, drawing, reading back and writing. Out: a [`TestingError`].

use crate::codec::CodecError;
use bevy::asset::AssetLoadError;
use std::sync::Arc;

/// The reason why an app could not be drawn into a picture, or could not go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TestingError {
    /// The machine has no GPU adapter: a reason to skip a test, not to fail it.
    #[error("no GPU adapter: install a Vulkan driver (mesa-vulkan-drivers has one in software)")]
    NoGpu,
    /// The machine has a GPU adapter, but the app has no renderer whose pipelines can be monitored.
    #[error(
        "the app has no renderer: make it with bevy_gs4d::testing::app, or add Bevy's RenderPlugin; with \
         PipelinedRenderingPlugin, call settle before any other code finishes the app's plugins"
    )]
    NoRenderer,
    /// A plugin is missing that the called function needs.
    #[error("the app has no {plugin}: add it before the app first runs")]
    NoPlugin {
        /// The plugin.
        plugin: &'static str,
    },
    /// The app has no [`Offscreen`](super::Offscreen).
    #[error("the app has no picture to draw into; make it with bevy_gs4d::testing::app")]
    NotOffscreen,
    /// An HDR picture was read as one of 8 bits, or a picture of 8 bits as one in HDR.
    #[error("this picture has {pixels}: read it with bevy_gs4d::testing::{remedy}")]
    Format {
        /// The pixel format, in words.
        pixels: &'static str,
        /// The function that reads it.
        remedy: &'static str,
    },
    /// An asset that the app waits for cannot be loaded.
    #[error(transparent)]
    Asset(Arc<AssetLoadError>),
    /// A plugin, an asset or a shader is not ready in time.
    #[error("not ready after {seconds} s: {what}")]
    Slow {
        /// The time waited, in seconds.
        seconds: u64,
        /// The plugin, assets or shaders that are not ready.
        what: String,
    },
    /// A shader or a pipeline does not compile.
    #[error("a pipeline failed: {0}")]
    Pipeline(String),
    /// The app has requested its exit, as Bevy does when the GPU reports an error.
    #[error("the app stopped; the log has the reason")]
    Stopped,
    /// The GPU did not deliver the picture, or not all of it.
    #[error("the picture did not come back from the GPU")]
    Readback,
    /// The picture could not be written.
    #[error(transparent)]
    Save(#[from] CodecError),
}
