//! The errors of `draw`.
//!
//! In: what is wrong, or the error of a part. Out: [`DrawError`]; a command adds the option that mends it.

use crate::codec::CodecError;
use crate::offline::engine::EngineError;
use crate::offline::work::Interrupted;

/// Why no pictures can be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DrawError {
    /// An orbit of a scene without Gaussians.
    #[error("the scene has no Gaussians, so that no orbit of cameras can be placed around it")]
    NothingToOrbit,
    /// Gaussians are so far apart that no camera sees them all.
    #[error("the Gaussians are too far apart for an orbit of cameras around them")]
    TooFarApart,
    /// The threads that write pictures panicked.
    #[error("the threads that write pictures panicked: a defect of gs4d, please report it")]
    WritersPanicked,
    /// The threads that write pictures cannot be started.
    #[error("{0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The engine failed.
    #[error("{0}")]
    Engine(#[from] EngineError),
    /// A picture cannot be written.
    #[error("{0}")]
    Codec(#[from] CodecError),
    /// The user has interrupted the work.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}
