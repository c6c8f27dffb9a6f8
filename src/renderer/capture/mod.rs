//! Captures on the GPU.
//!
//! In: a [`RuntimeScene`](crate::scene::RuntimeScene). Out: [`GpuCapture`], uploaded at once or in chunks ([`CaptureUpload`]). The
//! Gaussians of a capture in chunk files come file by file ([`FileUpload`]), into pages of its buffers, and go again.

mod buffers;
mod file_upload;
mod gpu_capture;
mod instance_settings;
mod page_buffers;
mod paged_gaussians;
mod pages;
mod paging;
mod prefixes;
mod shared_codebooks;
mod upload;

pub use file_upload::FileUpload;
pub(super) use gpu_capture::Filter;
pub use gpu_capture::GpuCapture;
pub(super) use pages::PartListing;
pub use paging::ChunkFiles;
pub(super) use prefixes::Prefix;
pub(super) use shared_codebooks::SharedCodebooks;
pub use upload::CaptureUpload;
