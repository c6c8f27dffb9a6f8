//! Captures as Bevy assets.
//!
//! In: the bytes of a `.gs4d` package or a `.pth` checkpoint, from any Bevy asset source. Out: a [`GaussianCapture`], decoded on
//! the asset task pool and ready to be shared by any number of entities; on each of those a [`CaptureState`], and messages when it
//! changes.
//!
//! ```text
//! file ──▶ PackageLoader, CheckpointLoader ──▶ GaussianCapture ──▶ PackageSaver ──▶ file
//!                      │                              │
//!                      │ fails                        │ arrives, arrives again
//!                      ▼                              ▼
//!                CaptureFailed                  CaptureReady             CaptureState on the entity says which
//! ```
//!
//! Loading runs off the main thread: frames go on meanwhile. When a file changes that Bevy watches, or a game calls
//! `AssetServer::reload`, the old capture is drawn until the new one is there, and goes on if the new one is broken. Once no handle
//! is left a capture goes, and its memory on the GPU with it.

mod loader;
mod messages;
mod plugin;
mod saver;
mod state;
mod upload_failures;

pub use super::component::{GaussianCapture, KeyFrames};
pub use loader::{CaptureLoadError, CheckpointLoader, PackageLoader};
pub(crate) use messages::send;
pub use messages::{CaptureFailed, CaptureReady};
pub(crate) use plugin::CaptureAssetPlugin;
pub use saver::{CaptureSaveError, PackageSaver, PackageSaverSettings};
pub use state::{CaptureAssetSystems, CaptureState};
pub(crate) use upload_failures::UploadFailures;
