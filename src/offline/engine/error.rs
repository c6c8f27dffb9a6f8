//! The errors of `engine`.
//!
//! In: what is wrong, or the error of the GPU. Out: [`EngineError`]; a command adds the option that mends it.

use super::Purpose;
use crate::renderer::GpuError;
use glam::UVec2;

/// Why pictures cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// Pictures are too large for the memory.
    #[error(
        "{} {:.1} GB of memory, and {:.1} GB are available",
        pictures(*.count, *.size), *.needed as f64 / 1e9, *.available as f64 / 1e9
    )]
    Memory {
        /// Number of pictures held at once.
        count: u64,
        /// Width and height of the largest picture, pixels.
        size: UVec2,
        /// Bytes needed.
        needed: u64,
        /// Bytes available.
        available: u64,
        /// What the pictures are drawn for.
        purpose: Purpose,
    },
    /// Pictures are too large for the GPU.
    #[error("{reason}")]
    Limit {
        /// The limit.
        #[source]
        reason: GpuError,
        /// What the pictures are drawn for.
        purpose: Purpose,
    },
    /// The GPU failed.
    #[error("{0}")]
    Gpu(#[from] GpuError),
}

/// Returns the subject and the verb of a sentence about the need of pictures.
fn pictures(count: u64, UVec2 { x, y }: UVec2) -> String {
    match count {
        1 => format!("a picture of {x}x{y} pixels needs"),
        _ => format!("{count} pictures of up to {x}x{y} pixels need"),
    }
}
