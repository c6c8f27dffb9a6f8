//! The capture asset and the component that places it in the world: every other module of the plugin builds on these.
//!
//! In: a scene in memory, a handle. Out: a [`GaussianCapture`] that entities share, and an entity with a
//! [`GaussianCapture3d`], which cameras draw once the asset is loaded. The other components of such an entity (loading
//! state, playback, settings) are registered as required components by the plugins that own them.

mod capture;
mod capture_3d;
mod edited;
mod key_frames;
mod picture;
mod sound_track;
mod upright;

pub use capture::GaussianCapture;
pub use capture_3d::GaussianCapture3d;
pub use edited::CaptureEditError;
pub use key_frames::KeyFrames;
pub(crate) use picture::StreamedPicture;
pub use sound_track::SoundTrack;
pub(crate) use upright::stand_upright;
pub use upright::{Upright, UprightTurn};
