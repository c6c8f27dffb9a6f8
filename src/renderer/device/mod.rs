//! The device: what the renderer creates on it, its limits and its errors.
//!
//! In: a device of the app, or none. Out: buffers, textures, bind groups and pipelines, or a [`GpuError`]; counters of what was created.

pub(crate) mod bind;
mod context;
mod error;
pub(crate) mod memory;
mod quiet;
mod work;

pub use context::GpuContext;
pub use error::GpuError;
pub use quiet::silence_wayland;
pub use work::WorkCounters;
