//! The exposures of cameras in reports.
//!
//! In: the exposures that a training has found. Out: a row of text.

use crate::offline::train::FineTuned;

/// Returns the row with the number of cameras, and the least and the largest gain of a channel; `None` if no exposures
/// were trained.
pub(crate) fn exposure_row(tuned: &FineTuned) -> Option<(&'static str, String)> {
    let gains = tuned.exposures.iter().flat_map(|[r, g, b]| [r[0], g[1], b[2]]);
    let [least, most] = [gains.clone().fold(f32::MAX, f32::min), gains.fold(f32::MIN, f32::max)];
    let cameras = tuned.exposures.len();
    (cameras > 0).then(|| ("exposure", format!("of {cameras} cameras, gains {least:.2} to {most:.2}; not stored")))
}
