//! Captures as Bevy assets.
//!
//! In: the bytes of a package, a checkpoint or a file of another make, from any Bevy asset source, and
//! [`CaptureLoaderSettings`]. Out: a [`GaussianCapture`], decoded on the asset task pool and shared by any number of
//! entities; on each entity a [`CaptureState`], and messages when it changes.
//!
//! ```text
//! file ──▶ CaptureLoader ──▶ GaussianCapture ──▶ PackageSaver ──▶ file
//!                │                  │
//!                │ fails            │ is loaded, or loaded again
//!                ▼        fails     ▼
//!          CaptureFailed ◀─── upload to the GPU
//!                                   │ is complete
//!                                   ▼
//!                             CaptureReady             and CaptureState on the entity
//! ```
//!
//! In `AssetMode::Processed` a [`CaptureProcessor`] makes packages of checkpoints before the game loads them.
//!
//! Loading runs off the main thread, in browsers on it with pauses, and uploading is spread over frames: neither blocks
//! a frame. When a file changes that Bevy watches, or a game calls `AssetServer::reload`, the old capture is drawn
//! until the new one is on the GPU. If the new capture is invalid or does not fit, the old one stays. A capture and its
//! GPU memory are freed with its last handle. Without a renderer, captures are ready once they are loaded.

mod chunk_part;
mod failure;
mod loader;
mod messages;
mod one_file;
mod parts;
mod pause;
mod plugin;
mod processor;
mod saver;
#[cfg(feature = "sound")]
mod sound_loader;
mod state;
mod systems;
mod uploads;

pub use super::component::{CaptureEditError, GaussianCapture, KeyFrames};
pub(crate) use chunk_part::load_part;
pub use failure::CaptureFailure;
pub use loader::{CaptureLoadError, CaptureLoader, CaptureLoaderSettings};
pub(crate) use messages::send;
pub use messages::{CaptureFailed, CaptureReady};
#[cfg(feature = "http_ranges")]
pub(crate) use one_file::PartSources;
pub(crate) use parts::{set_up, set_up_late};
pub use plugin::CaptureAssetPlugin;
pub use processor::{
    CaptureProcessor, CaptureTransformError, CaptureTransformer, CaptureTransformerSettings, ProcessedForm,
};
pub use saver::{CaptureSaveError, PackageSaver, PackageSaverSettings};
#[cfg(feature = "sound")]
pub use sound_loader::{SoundLoadError, SoundLoader};
pub use state::{CaptureAssetSystems, CaptureState};
pub(crate) use uploads::Uploads;
