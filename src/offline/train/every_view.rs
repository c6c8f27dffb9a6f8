//! The training views of a dataset before its interval of time is known.
//!
//! In: the folder of a dataset, how its views are read and divided. Out: [`EveryView`].

use super::error::TrainError;
use crate::offline::dataset::splits::{SplitOptions, Splits, origin_of};
use crate::offline::dataset::{Clock, TrainingView};
use crate::offline::work::Progress;
use crate::scene::{Origin, TrainedWith};
use std::path::Path;

/// Every training view of a dataset, including the validation views.
pub(crate) struct EveryView {
    pub views: Vec<TrainingView>,
    /// The origin of their places and times.
    pub origin: Origin,
    /// What their times mean.
    pub clock: Clock,
}

/// Returns every training view of the dataset in a folder.
///
/// # Errors
/// Views that cannot be used.
pub(crate) fn every_view(
    data: &Path,
    options: &SplitOptions,
    progress: &mut dyn Progress,
) -> Result<EveryView, TrainError> {
    let origin = origin_of(data, options, progress)?;
    // Every time, before the interval is known.
    let any_time = TrainedWith { time_interval: [f32::NEG_INFINITY, f32::INFINITY], origin, ..TrainedWith::default() };
    let all = Splits::open(data, options, &any_time, progress)?;
    let views = all.all_training(&any_time, progress)?;
    Ok(EveryView { views, origin, clock: all.clock })
}
