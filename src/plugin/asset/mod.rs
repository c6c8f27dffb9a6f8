//! Captures as Bevy assets.
//!
//! In: the bytes of a `.gs4d` package or a `.pth` checkpoint, from any Bevy asset source. Out: a [`GaussianCapture`], decoded on
//! the asset task pool and shared by any number of entities; on each of those a [`CaptureState`], and messages when it changes.
//!
//! ```text
//! file ──▶ PackageLoader, CheckpointLoader ──▶ GaussianCapture ──▶ PackageSaver ──▶ file
//!                      │                              │
//!                      │ fails                        │ is loaded, or loaded again
//!                      ▼                              ▼
//!                CaptureFailed                  CaptureReady             and CaptureState on the entity
//! ```
//!
//! Loading runs off the main thread and blocks no frame. When a file changes that Bevy watches, or a game calls
//! `AssetServer::reload`, the old capture is drawn until the new one is loaded, and stays if the new one is broken. A capture is
//! dropped with its last handle, and its memory on the GPU with it.

mod loader;
mod messages;
mod plugin;
mod saver;
mod state;
mod systems;
mod upload_failures;

pub use super::component::{GaussianCapture, KeyFrames};
pub use loader::{CaptureLoadError, CheckpointLoader, PackageLoader};
pub(crate) use messages::send;
pub use messages::{CaptureFailed, CaptureReady};
pub(crate) use plugin::CaptureAssetPlugin;
pub use saver::{CaptureSaveError, PackageSaver, PackageSaverSettings};
pub use state::{CaptureAssetSystems, CaptureState};
pub(crate) use upload_failures::UploadFailures;
