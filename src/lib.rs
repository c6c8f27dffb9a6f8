//! Dynamic captures in Bevy games: native 4D Gaussian Splatting, played to the pixel.
#[cfg(feature = "bevy")]
pub mod asset;
pub mod codec;
pub mod dataset;
pub mod frame;
pub mod gaussian;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod metrics;
pub mod picture;
#[cfg(feature = "bevy")]
pub mod playback;
pub mod reference;
#[cfg(feature = "bevy")]
pub mod render;
pub mod scene;
