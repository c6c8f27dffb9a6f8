//! Captures as Bevy assets.
//!
//! In: the bytes of a `.gs4d` package or a `.pth` checkpoint, from any Bevy asset source. Out: a [`GaussianCapture`], decoded on
//! the asset task pool and ready to be shared by any number of entities.

mod capture;
mod key_frames;
mod loader;

pub use capture::GaussianCapture;
pub use key_frames::KeyFrames;
pub use loader::{CaptureLoadError, CheckpointLoader, PackageLoader};
