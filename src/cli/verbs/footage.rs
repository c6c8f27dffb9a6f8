//! `gs4d footage FOLDER -o DATASET`: from what several cameras filmed to a dataset that a capture can be trained on.
//!
//! In: a folder with a video or a folder of frames for each camera, with or without a calibration, or a dataset of any
//! format. Out: a dataset with synchronized times, plates and masks of what moves, and points of every moment; a
//! verdict on the footage.

use crate::cli::args::values;
use crate::cli::output::failure::Failure;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::lines;
use crate::offline::footage::{FootageSettings, MadeDataset, Synchronization, footage};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Turn footage of several cameras into a dataset: poses, synchronized times, plates and masks, points of every moment,
/// and a verdict on what the footage can give.
///
/// FOLDER holds a video or a folder of frames for each camera, each with the name of its camera, beside a calibration
/// of the cameras, or without one: then COLMAP finds their poses. A dataset of any format is footage, too. FOLDER is
/// never written to; frames of videos are decoded once, by ffmpeg, to FOLDER.frames beside it.
///
/// An interrupted run resumes from the results in DATASET.footage/ beside DATASET. A stage runs again if any of its
/// inputs has changed: a picture, a camera, an option, the version of gs4d.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d footage treadmill -o dataset
  gs4d footage videos -o dataset --offset left=0.25 --offset right=-0.1
  gs4d footage basketball -o dataset --masks basketball/seg --rehearse --json
  gs4d train --data dataset -o capture.gs4d                # or gs4d bake dataset -o capture.gs4d

DATASET holds images/CAMERA/FRAME, transforms.json, points3d.ply with points of every moment, plates/CAMERA.png (what stands still),
motion/CAMERA/FRAME.png (what moves, white) and verdict.json. Pictures of lenses that do not distort are links to those of FOLDER.")]
pub(crate) struct Footage {
    /// The folder of the footage.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// The folder of the dataset: a new one, or one made from the same footage before.
    #[arg(short = 'o', long, value_name = "DATASET")]
    out: PathBuf,
    /// How the clocks of the cameras are compared: auto, by the sound of their videos if at least two have sound;
    /// motion, by what moves in the pictures, to about half a frame; no, the times of their frames are right.
    #[arg(long, value_name = "WAY", default_value = "auto", value_parser = values::one_of(&Synchronization::NAMES))]
    sync: Synchronization,
    /// The seconds by which the times of the frames of a camera are too late, in place of a comparison of clocks; 0 for
    /// cameras that are not named. May be given for several cameras.
    #[arg(long, value_name = "CAMERA=SECONDS", value_parser = offset, conflicts_with = "sync")]
    offset: Vec<(String, f64)>,
    /// Cameras for the test, by name, or none: the others are trained on [default: as the dataset says; else every
    /// eighth, if there are eight].
    #[arg(long, value_name = "CAMERA,CAMERA", value_delimiter = ',')]
    test: Option<Vec<String>>,
    /// Longest side of the pictures that plates, masks and points are made from, pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = FootageSettings::WORK_SIZE, value_parser = clap::value_parser!(u32).range(16..=8192))]
    work_size: u32,
    /// Smallest part of a picture that is taken to move, as a share of the picture: smaller ones are taken for noise.
    /// Things that fly may need 0.00002.
    #[arg(long, value_name = "SHARE", default_value_t = FootageSettings::SMALLEST, value_parser = values::share, allow_negative_numbers = true)]
    smallest: f64,
    /// Folder of masks of what moves, CAMERA/FRAME.png, white where something moves [default: seg or motion in FOLDER,
    /// if there is one; else what differs from the plates].
    #[arg(long, value_name = "MASKS")]
    masks: Option<PathBuf>,
    /// Leave out the points of every moment, which take most of the time: for a first verdict on a take. A training would
    /// begin at random points; the same command without this option adds them.
    #[arg(long)]
    no_points: bool,
    /// Least share of the cameras that show a place in whose masks it moves, for a point there: 0.75 where trees or walls
    /// hide places from some cameras.
    #[arg(
        long,
        value_name = "SHARE",
        default_value_t = FootageSettings::AGREEING,
        value_parser = values::share,
        allow_negative_numbers = true,
        conflicts_with = "no_points"
    )]
    agreeing: f64,
    /// Train shortly on the dataset without some of its cameras, so that the verdict tells what quality to expect: 1000
    /// steps of 30,000 Gaussians, on pictures of at most 320 pixels. Needs a GPU.
    #[arg(long, conflicts_with = "no_points")]
    rehearse: bool,
}

/// The name in place of cameras for the test, if there are none.
const NONE: &str = "none";

/// Parses `CAMERA=SECONDS`.
fn offset(text: &str) -> Result<(String, f64), String> {
    let parts = text.rsplit_once('=').filter(|(camera, _)| !camera.is_empty());
    let offset = parts.and_then(|(camera, seconds)| Some((camera.to_owned(), seconds.trim().parse::<f64>().ok()?)));
    let offset = offset.filter(|(_, seconds)| seconds.is_finite());
    offset.ok_or_else(|| "expected the name of a camera and a number of seconds, such as left=0.25".to_owned())
}

impl Footage {
    /// Runs every stage whose result is not there yet.
    ///
    /// # Errors
    /// Footage that cannot be used, files that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let made = footage(&self.settings(), &mut Bars::default())?;
        Ok(self.report(&made))
    }

    fn settings(&self) -> FootageSettings {
        let is_none = |names: &Vec<String>| names.len() == 1 && names[0] == NONE;
        let test = self.test.clone().map(|names| if is_none(&names) { Vec::new() } else { names });
        let Self { folder, out, sync, offset, work_size, smallest, masks, no_points, agreeing, rehearse, .. } = self;
        FootageSettings {
            folder: folder.clone(),
            out: out.clone(),
            sync: *sync,
            offsets: offset.clone(),
            test,
            work_size: *work_size,
            smallest: *smallest,
            masks: masks.clone(),
            points: !no_points,
            agreeing: *agreeing,
            rehearse: *rehearse,
        }
    }

    fn report(&self, made: &MadeDataset) -> Report {
        let MadeDataset { cameras, frames, test_frames, moments, sync, offsets, masks, points, .. } = made;
        let MadeDataset { verdict, verdict_json, grave, stages, .. } = made;
        let names = cameras.join(", ");
        let shifted: Vec<String> = std::iter::zip(cameras, offsets)
            .filter(|(_, offset)| **offset != 0.0)
            .map(|(camera, offset)| format!("{camera} {:+.1} ms", offset * 1e3))
            .collect();
        let shifted = if shifted.is_empty() { String::new() } else { format!(": {}", shifted.join(", ")) };
        let seconds: f64 = stages.iter().map(|stage| stage.seconds).sum();
        let text = lines(&[
            ("dataset", self.out.display().to_string()),
            ("cameras", format!("{}: {names}", cameras.len())),
            ("frames", format!("{frames} to train on, {test_frames} for the test, {moments} moments")),
            ("clocks", format!("{sync}{shifted}")),
            ("masks", format!("{masks} frames")),
            ("points", points.to_string()),
            ("time", format!("{seconds:.1} s")),
        ]);
        let by_name: serde_json::Map<String, Value> =
            std::iter::zip(cameras, offsets).map(|(camera, offset)| (camera.clone(), json!(offset))).collect();
        let json = json!({
            "folder": self.folder.display().to_string(),
            "out": self.out.display().to_string(),
            "cameras": cameras,
            "frames": frames,
            "test_frames": test_frames,
            "moments": moments,
            "sync": sync,
            "offsets": by_name,
            "masks": masks,
            "points": points,
            "grave": grave,
            "verdict": verdict_json,
            "stages": stages,
        });
        Report::new(json, format!("{text}\n{}\n", verdict.trim_end()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_are_a_camera_and_seconds() {
        assert_eq!(offset("a=b=-0.5"), Ok(("a=b".to_owned(), -0.5)), "the last sign divides");
        for text in ["", "left", "=1", "left=", "left=fast", "left=nan"] {
            assert!(offset(text).is_err(), "{text:?} is no offset");
        }
    }
}
