//! Faults: why the picture of a time may never be there.
//!
//! In: what is there of a capture in chunk files, a time, its share of the budget. Out: a [`CaptureFailure`] with the remedy, if
//! something is in the way that time alone does not mend.

use crate::codec::stream::{Obstacle, StreamSchedule};
use crate::plugin::asset::CaptureFailure;
use crate::plugin::component::GaussianCapture;
use crate::scene::ChunkTable;
use bevy::asset::{AssetId, AssetPath};

/// Returns why the most important Gaussians of a time may never be there: seconds since the start of a capture, whose
/// index is at a path, within its share of the bytes on the GPU.
pub(super) fn fault(
    schedule: &StreamSchedule,
    seconds: f64,
    share: u64,
    index: &AssetPath<'_>,
) -> Option<CaptureFailure> {
    let path = || index.to_string();
    let file = match schedule.obstacle(seconds, share)? {
        Obstacle::OverBudget { needed } => {
            return Some(CaptureFailure::OverBudget { path: path(), needed, limit: share });
        }
        Obstacle::Failing { file } => file,
    };
    let table = schedule.table();
    let (name, remedy) = match table.first_byte {
        None => {
            let remedy = "check that the folder of the index has all files that were made with it";
            (format!("file {}", ChunkTable::file_name(file, table.files.len())), remedy)
        }
        Some(_) => (format!("chunk file {}", file + 1), "check that the file is whole, and can be reached"),
    };
    let reason = format!(
        "its {name} could not be loaded {} times in a row, for the reasons in the log, and is tried again: {remedy}",
        Obstacle::MANY
    );
    Some(CaptureFailure::Unreadable { path: path(), reason })
}

/// Returns the fault of an index that was not loaded from a file.
pub(super) fn without_folder(index: AssetId<GaussianCapture>) -> CaptureFailure {
    let reason = "the index of a capture in chunk files that was not loaded from a file has none beside it: load it by \
                  AssetServer::load";
    CaptureFailure::NotDrawable { path: index.to_string(), reason: reason.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::stream::{Playhead, StreamLimits, Turn};
    use crate::scene::ChunkFile;

    /// Returns two stretches of a second, with files of layer 0 of 1000 and 3000 bytes on the GPU, and one of layer 1.
    fn schedule() -> StreamSchedule {
        let file = |stretch, layer, gaussians| ChunkFile { stretches: [stretch; 2], layer, gaussians, bytes: 1 };
        let files = vec![file(0, 0, 10), file(1, 0, 30), file(1, 1, 99)];
        StreamSchedule::new(
            ChunkTable { stretches: 2, gaussian_bytes: 100, files, utilities: Vec::new(), first_byte: None }.into(),
            2.0,
        )
    }

    #[test]
    fn the_first_layer_must_fit_the_budget() {
        let schedule = schedule();
        let at = |seconds, gpu_bytes| fault(&schedule, seconds, gpu_bytes, &AssetPath::from("take/index.gs4d"));
        assert_eq!((at(0.5, 1000), at(1.5, 3000)), (None, None), "other layers may be left out");
        let failure = at(1.5, 2999).expect("a fault");
        let (needed, limit) = (3000, 2999);
        let expected = CaptureFailure::OverBudget { path: "take/index.gs4d".into(), needed, limit };
        assert_eq!(failure, expected, "one byte is missing");
        let text = failure.to_string();
        assert!(
            ["take/index.gs4d", "3000", "StreamBudget::gpu_bytes"].iter().all(|word| text.contains(word)),
            "{text}"
        );
    }

    #[test]
    fn a_file_of_the_first_layer_that_fails_again_and_again_is_a_fault() {
        let mut schedule = schedule();
        let head = Playhead { seconds: 1.5, velocity: 0.0, range: [0.0, 2.0], turn: Turn::Loop, delay: 0.0 };
        let fault = |schedule: &StreamSchedule| fault(schedule, 1.5, u64::MAX, &AssetPath::from("take/index.gs4d"));
        for number in 0..Obstacle::MANY {
            assert_eq!(fault(&schedule), None, "{number} failures are none yet");
            // Later than any retry.
            let now = 10.0 * f64::from(number);
            for file in schedule.plan(now, &[head], &StreamLimits::default()).fetch {
                schedule.failed(file, now);
            }
        }
        let Some(CaptureFailure::Unreadable { path, reason }) = fault(&schedule) else { panic!("a fault") };
        assert_eq!(path, "take/index.gs4d", "the path of the index");
        assert!(reason.contains("chunk-00002-of-00003.gs4d"), "the file of layer 0: {reason}");
        for file in schedule.plan(100.0, &[head], &StreamLimits::default()).fetch {
            schedule.arrived(file);
        }
        assert_eq!(fault(&schedule), None, "the file is there");
    }
}
