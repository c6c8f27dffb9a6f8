//! Captures on the GPU.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene). Out: [`GpuCapture`], uploaded at once or in chunks ([`CaptureUpload`]).

mod buffers;
mod gpu_capture;
mod prefixes;
mod shared_codebooks;
mod upload;

pub(super) use gpu_capture::Filter;
pub use gpu_capture::GpuCapture;
pub(super) use prefixes::Prefix;
pub(super) use shared_codebooks::SharedCodebooks;
pub use upload::CaptureUpload;
