//! Footage of several cameras, from which a dataset is made.
//!
//! In: a folder with a video or a folder of frames for each camera. Out: a dataset, with poses, times of one clock,
//! plates and masks of what moves, points of every moment, and a verdict on what the footage can give.
//!
//! | module | subject |
//! |---|---|
//! | `settings` | what is made, and how |
//! | `take` | the frames of cameras to work with, by moments |
//! | `working` | their pictures at the sizes to work with, decoded once |
//! | `sync` | the offsets between the clocks of cameras |
//! | `colmap` | poses by the program COLMAP |
//! | `plates` | what stands still before a camera, and what moves |
//! | `points` | points of what moves and of what stands |
//! | `verdict` | what the footage can give, and how it can be mended |
//! | `pipeline` | all of this in stages, which resume, and the dataset |

mod colmap;
mod error;
mod pipeline;
mod plates;
mod points;
mod settings;
mod sync;
mod take;
mod verdict;
mod working;

pub use colmap::ColmapError;
pub use error::FootageError;
pub use pipeline::{MadeDataset, footage, prepared};
pub(crate) use pipeline::{is_raw, uncalibrated};
pub use settings::{FootageSettings, Synchronization};
