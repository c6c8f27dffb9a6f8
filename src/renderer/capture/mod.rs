//! Captures on the GPU.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene). Out: [`GpuCapture`], uploaded at once or in chunks ([`CaptureUpload`]).

mod buffers;
mod gpu_capture;
mod upload;

pub(super) use gpu_capture::Filter;
pub use gpu_capture::GpuCapture;
pub use upload::CaptureUpload;
