//! The offline half: from pictures, or a trained checkpoint and its training views, to a small, fast capture, with the loss of quality.
//!
//! In: a `GaussianScene`, the views it was trained on, an [`Engine`](engine::Engine) that scores and draws them on
//! the GPU or the CPU. Out: a smaller scene, packages, pictures, measurements. Build scripts and editors can call every
//! function as the command does: functions report their [`Progress`] and return data.
//!
//! | module | what it does |
//! |---|---|
//! | [`dataset`], `splits` | reads views and divides them into training, validation and test views |
//! | `belonging` | checks that images show the capture |
//! | `gaps` | finds out whether images have transparent pixels or masks |
//! | `picture_file` | decodes pictures for all other modules |
//! | [`engine`] | opens the GPU or the CPU reference |
//! | [`score`] | sums what every Gaussian contributes to the training views |
//! | `prune`, [`prune_by_views`] | keeps the Gaussians of the highest scores |
//! | `search`, `trained_search`, `quality` | finds the best score and the smallest count that a loss allows |
//! | `temporal_filter`, `seen` | find the active Gaussians of each segment of time |
//! | [`fine_tune`](mod@fine_tune) | trains the remaining Gaussians, to compensate for the removed Gaussians |
//! | `train` | trains a capture from nothing but pictures |
//! | [`quantize`], [`convert`] | changes the form that a scene is stored in |
//! | [`detail`](mod@detail) | makes the same capture with fewer Gaussians, for pictures of few pixels |
//! | [`bake`](mod@bake), [`report`] | runs all steps in order, resumable, and writes a report |
//! | `jobs` | plans a bake as jobs for many machines |
//! | `fleet` | compares the results of many bakes on one page |
//! | [`metrics`], `evaluation`, `fidelity`, `comparison` | measures how close pictures are |
//! | [`ablation`] | tabulates the loss by every score, ratio and filter |
//! | `shaders`, `layout` | compose the passes of scoring and training, and mirror their structures |
//! | `files` | refuses outputs that are inputs or cannot be written, before anything is computed |
//! | `shard` | divides work among machines, and puts their parts together |
//! | `stages`, `store`, `stored` | run stages and keep their results, from which interrupted work resumes |
//! | `unfinished` | lists the files and folders that are removed if a process ends before its work |
//! | `export` | writes files of other makes |
//! | [`orbit`], `render` | draws a scene from all sides, many pictures at a time |

pub mod ablation;
pub mod bake;
mod bake_settings;
pub(crate) mod belonging;
pub(crate) mod comparison;
pub mod convert;
pub mod dataset;
pub mod detail;
pub mod engine;
mod error;
pub(crate) mod evaluation;
pub(crate) mod evaluation_parts;
pub(crate) mod export;
pub(crate) mod fidelity;
pub(crate) mod files;
pub mod fine_tune;
pub(crate) mod fleet;
pub(crate) mod gaps;
pub(crate) mod jobs;
pub(crate) mod layout;
pub(crate) mod memory_check;
pub mod metrics;
mod node;
pub mod orbit;
mod package_size;
pub(crate) mod picture_file;
mod progress;
pub(crate) mod prune;
pub mod prune_by_views;
pub(crate) mod quality;
pub mod quantize;
pub(crate) mod render;
pub mod report;
mod save;
pub mod score;
pub(crate) mod search;
pub(crate) mod seen;
pub(crate) mod shaders;
pub(crate) mod shard;
pub(crate) mod sliced;
pub(crate) mod splits;
pub(crate) mod stages;
pub(crate) mod store;
pub(crate) mod stored;
mod subject;
pub(crate) mod temporal_filter;
pub(crate) mod temporary_file;
mod test_comparison;
pub(crate) mod train;
mod trained_pixel;
pub(crate) mod trained_search;
pub(crate) mod unfinished;

pub use error::OfflineError;
pub use picture_file::PictureError;
pub(crate) use progress::proceed;
pub use progress::{NoProgress, Progress};
pub use save::save;
pub(crate) use save::{write_beside, write_png, write_settings};
pub use search::{Goal, ScoreChoice};
pub(crate) use sliced::sliced;
pub use splits::{SplitOptions, Splits};
pub(crate) use subject::Subject;
pub use temporal_filter::KeyFrames;
pub(crate) use trained_pixel::trained_pixel;
