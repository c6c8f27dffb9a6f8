//! The views of a folder whose views are in one file.
//!
//! In: the results of the reader of a format. Out: views of all splits, before they are divided.

use crate::offline::dataset::{Clock, Split, TrainingView};
use crate::scene::Origin;
use std::path::PathBuf;

/// The views of a folder before they are divided.
pub(crate) struct Undivided {
    /// The camera file.
    pub source: PathBuf,
    pub views: Vec<TrainingView>,
    /// The split of each view, where the dataset has them.
    pub splits: Option<Vec<Option<Split>>>,
    /// The meaning of the times of the views.
    pub clock: Clock,
    /// File of points to begin training with.
    pub points: Option<PathBuf>,
    /// Assumptions and omissions, a sentence each.
    pub notes: Vec<String>,
    /// The origin of the views in the coordinates of the files.
    pub origin: Origin,
}
