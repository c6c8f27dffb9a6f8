//! Segments: long captures from short ones, and their cut into stretches of time.
//!
//! In: captures that were trained apart, each of a stretch of time, or one capture. Out: one capture of all segments, in
//! which each Gaussian is only drawn within the time of its segment; or chunks of one capture, each a capture of the
//! Gaussians that are alive in a stretch of time, and from the chunks the capture again.
//!
//! | file | subject |
//! |---|---|
//! | `clock` | where each segment begins on the clock of all, and the segments of the filter |
//! | `windows` | the filter segments in which each Gaussian may be drawn |
//! | `forms` | Gaussians are moved in time and space |
//! | `alike` | what segments must have in common |
//! | `join` | one capture of segments |
//! | `files` | the names of chunk files, and which paths are chunks of one capture |
//! | `covers` | runs: the Gaussians of a stretch of chunks |
//! | `layers` | the Gaussians of a run by importance |
//! | `cut`, `parts` | how a capture is cut, and the Gaussians of each chunk file |
//! | `split` | chunk files of a capture, and their index |
//! | `sound_beside` | the sound of a capture in chunk files |
//! | `unite` | the capture of chunks |

mod alike;
mod clock;
mod covers;
mod cut;
mod error;
mod files;
mod forms;
mod join;
mod layers;
mod parts;
mod segment;
mod sound_beside;
mod split;
mod unite;
mod windows;

pub use cut::Cut;
pub use error::{SegmentsError, Shared};
pub use files::{Source, sources};
pub use join::{Joined, JoinedSegment, Times, join};
pub use layers::LayerShares;
pub(crate) use parts::{LEAST_PACKED, lives, parts};
pub use segment::Segment;
pub(crate) use sound_beside::remove_index;
pub use sound_beside::{require_own_sound, sound_beside, sound_path};
pub use split::{Chunk, Chunks, Split, other_chunks};
pub use unite::unite;
