//! The temporal filter: which Gaussians are active in each segment of time.
//!
//! In: a scene and training views. Out: visibility masks of key-frames, or the interval of each Gaussian (section 4.2
//! of the 4DGS-1K paper).
//!
//! | file | subject |
//! |---|---|
//! | `temporal_filter` | a filter of any kind, whole or in parts on many machines |
//! | `visibility_masks` | the Gaussians that views blend |

mod error;
pub(crate) mod temporal_filter;
pub(crate) mod visibility_masks;

pub use error::FilterError;
pub use temporal_filter::KeyFrames;
