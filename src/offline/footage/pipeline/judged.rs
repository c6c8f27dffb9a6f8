//! The verdict on footage, as a file.
//!
//! In: the cameras to train on, with their masks and their clocks; what a short training has reached. Out:
//! `verdict.json`, and the verdict in sentences.

use super::clocks::{Clocks, step};
use super::masking::{Names, read_mask};
use super::rehearsal::Rehearsed;
use super::source::Source;
use crate::offline::footage::FootageError;
use crate::offline::footage::take::Take;
use crate::offline::footage::verdict::{CameraSync, Evidence, Synchrony, verdict};
use crate::offline::footage::working::WorkingPictures;
use crate::offline::work::{FileError, Progress, write_beside};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::path::Path;

/// The file.
const FILE: &str = "verdict.json";

/// A verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Judged {
    /// In sentences.
    pub text: String,
    /// Whether a capture of this footage will be wrong.
    pub grave: bool,
    /// The contents of the file.
    file: String,
}

impl Judged {
    /// Looks at the footage, and writes the verdict.
    ///
    /// # Errors
    /// A folder that cannot be written to, an interruption.
    pub(super) fn write(
        (take, names): (&Take, &Names<'_>),
        working: &WorkingPictures,
        (source, clocks): (&Source, &Clocks),
        rehearsed: Option<Rehearsed>,
        out: &Path,
        progress: &mut dyn Progress,
    ) -> Result<Self, FootageError> {
        // A mask that cannot be read says nothing.
        let mask = |camera: usize, moment: usize| {
            let frame = take.frame(camera, moment)?;
            read_mask(out, &take.cameras[camera], frame, names).ok().flatten()
        };
        let mut evidence = Evidence::of((take, working), mask, progress)?;
        evidence.synchrony = synchrony(take, source, clocks);
        evidence.rehearsal = rehearsed.map(Rehearsed::evidence);
        let verdict = verdict(&evidence);
        let path = out.join(FILE);
        let json = serde_json::to_value(&verdict).map_err(|error| FileError::at(&path, error))?;
        let file = format!("{json:#}\n");
        write_beside(&path, |writer| writer.write_all(file.as_bytes()))?;
        Ok(Self { text: verdict.to_string(), grave: verdict.is_grave(), file })
    }

    /// Returns whether the file is in the folder of the dataset.
    pub(super) fn is_in(&self, out: &Path) -> bool {
        fs::read_to_string(out.join(FILE)).is_ok_and(|found| found == self.file)
    }

    /// Returns the verdict for programs.
    pub(super) fn json(&self) -> Value {
        serde_json::from_str(&self.file).unwrap_or_default()
    }
}

/// Returns how well the cameras are synchronized; `None` if nothing tells it.
fn synchrony(take: &Take, source: &Source, clocks: &Clocks) -> Option<Synchrony> {
    let frame = (step(take) * f64::from(source.clock.unit_seconds)) as f32;
    let of = |(index, name): (usize, &String)| {
        let camera = source.cameras.iter().position(|camera| camera == name)?;
        let offset = clocks.left.get(camera).copied().flatten().map(|frames| frames as f32 * frame);
        let residual = clocks.residuals.get(camera).copied().flatten().map(|seconds| seconds as f32);
        (offset.is_some() || residual.is_some()).then_some(CameraSync { camera: index, offset, residual })
    };
    let cameras: Vec<CameraSync> = take.cameras.iter().map(|camera| &camera.name).enumerate().filter_map(of).collect();
    (!cameras.is_empty()).then_some(Synchrony { frame, cameras })
}
