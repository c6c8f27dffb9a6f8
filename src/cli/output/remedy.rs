//! The options that mend errors of the library, whose messages name no options.
//!
//! In: an error with its causes. Out: one line ([`line`]): the messages, and what to do, with the options that do it.

use crate::offline::bake::BakeError;
use crate::offline::collide::CollideError;
use crate::offline::compress::CompressError;
use crate::offline::dataset::{DatasetError, FrameProblem};
use crate::offline::draw::DrawError;
use crate::offline::engine::{EngineError, Purpose};
use crate::offline::footage::FootageError;
use crate::offline::forms::FormError;
use crate::offline::measure::MeasureError;
use crate::offline::prune::{PruneError, ValidatedChoice};
use crate::offline::segments::{SegmentsError, Shared};
use crate::offline::store::StoreError;
use crate::offline::train::{StartError, TrainError, TrainerError};
use std::error::Error;
use std::iter;

/// An error of any type.
type AnyError = dyn Error + 'static;

/// The remedies, a function for each type of error. It returns the remedy with the punctuation before it; `None` for
/// errors of other types and errors without a remedy.
const REMEDIES: [fn(&AnyError) -> Option<String>; 15] = [
    of_engine,
    of_dataset,
    of_form,
    of_store,
    of_measure,
    of_prune,
    of_train,
    of_trainer,
    of_start,
    of_draw,
    of_footage,
    of_segments,
    of_compress,
    of_collide,
    of_bake,
];

/// What makes the Gaussians that are trained fewer or smaller.
const FEWER: &str = "--gaussians makes them fewer, gs4d train --sh-degree smaller";

/// Returns the messages of an error and of its causes, and the remedy. A cause whose message is already part of the
/// text is left out.
pub(super) fn line(error: &AnyError) -> String {
    let mut text = String::new();
    for reason in chain(error).map(ToString::to_string) {
        if text.is_empty() {
            text = reason;
        } else if !text.contains(&reason) {
            text = format!("{text}: {reason}");
        }
    }
    text + &of(error)
}

/// Returns an error and its causes, from the outermost to the innermost.
fn chain(error: &AnyError) -> impl Iterator<Item = &AnyError> {
    iter::successors(Some(error), |&error| error.source())
}

/// Returns the remedy of an error or of the first of its causes that has one; empty if none has one.
fn of(error: &AnyError) -> String {
    chain(error).find_map(|error| REMEDIES.iter().find_map(|remedy| remedy(error))).unwrap_or_default()
}

fn of_engine(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<EngineError>()? {
        EngineError::Memory { purpose, .. } => Some(format!(": {}", smaller(*purpose))),
        EngineError::Limit { purpose, .. } => Some(format!(" ({})", smaller(*purpose))),
        EngineError::Gpu(_) => None,
    }
}

/// Returns what makes pictures smaller or fewer.
fn smaller(purpose: Purpose) -> &'static str {
    match purpose {
        Purpose::Dataset => "--resolution makes pictures smaller, by a divisor or a width",
        Purpose::Drawn => "--size makes pictures smaller",
        Purpose::Verified => "--size makes pictures smaller, --verify fewer",
        Purpose::Directions => "--directions and --times make pictures fewer",
        Purpose::Other => "draw smaller pictures, or fewer at once",
    }
}

fn of_dataset(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<DatasetError>()? {
        DatasetError::NoValidation { .. } => Some("; give --validation auto".to_owned()),
        DatasetError::Frame { problem: FrameProblem::NoTime(_), .. } => {
            Some(" (--static reads every frame at time 0)".to_owned())
        }
        _ => None,
    }
}

fn of_form(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<FormError>()? {
        FormError::NotTrained => Some(": convert the checkpoint with --form trained".to_owned()),
        _ => None,
    }
}

fn of_store(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<StoreError>()? {
        StoreError::MissingStage { stage, only, .. } => Some(format!(": run --only {stage} before --only {only}")),
        StoreError::NotAPart { .. } => Some(": parts are written by --shard".to_owned()),
        StoreError::NoParts => Some(": name them with --merge".to_owned()),
        _ => None,
    }
}

fn of_measure(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<MeasureError>()? {
        MeasureError::NotShown { .. } => Some(
            "; is --data the folder that it was trained on, and are its poses those of its images? --trust-images skips \
             this check"
                .to_owned(),
        ),
        MeasureError::UnknownSize { .. } => Some(": give --size WxH".to_owned()),
        _ => None,
    }
}

fn of_prune(error: &AnyError) -> Option<String> {
    let PruneError::NoValidation { choice } = error.downcast_ref::<PruneError>()? else { return None };
    let instead = match choice {
        ValidatedChoice::Loss => "give --ratio or --keep in its place",
        ValidatedChoice::Score => "name a score with --variant",
        ValidatedChoice::Rows => "measure on the views of another --split",
    };
    Some(format!(
        " (the dataset has too few cameras and times to hold some out by default, or --validation none is given): give \
         --validation cameras or times, add a split `val` (Blender: transforms_val.json), or {instead}"
    ))
}

fn of_train(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<TrainError>()? {
        TrainError::Memory { .. } => Some(format!(": {FEWER}")),
        TrainError::Limit { .. } => Some(format!(" ({FEWER})")),
        TrainError::WithoutGpu => Some("; --engine gpu takes one with a software driver, slowly".to_owned()),
        _ => None,
    }
}

fn of_trainer(error: &AnyError) -> Option<String> {
    let remedy = match error.downcast_ref::<TrainerError>()? {
        TrainerError::NotTrained => ": give the checkpoint, or a package written with --form trained",
        TrainerError::Model => " with gs4d finetune",
        _ => return None,
    };
    Some(remedy.to_owned())
}

fn of_start(error: &AnyError) -> Option<String> {
    let remedy = match error.downcast_ref::<StartError>()? {
        StartError::NoRegion => ": give views of one scene, or begin with points: gs4d train --points FILE",
        StartError::NoPoints => ": give one with --points, or another --start",
        StartError::NoFinitePoints => ": give another file, or another --start",
        StartError::NoSilhouettes => ": give --start random",
        StartError::NoSurroundings => ": leave out --environment, or give 0",
        StartError::NoHull => ": if both are right, begin elsewhere: gs4d train --start random",
        StartError::OnePlace { .. } | StartError::Time { .. } | StartError::Interval { .. } => return None,
    };
    Some(remedy.to_owned())
}

fn of_draw(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<DrawError>()? {
        DrawError::NothingToOrbit => Some(": give --cameras".to_owned()),
        DrawError::TooFarApart => Some(": give --cameras, or prune the scene".to_owned()),
        _ => None,
    }
}

fn of_footage(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<FootageError>()? {
        FootageError::NothingToTrainOn => Some(" with --test".to_owned()),
        FootageError::NoMasks { .. } => Some("; without --masks, what differs from the plates moves".to_owned()),
        FootageError::Train(_) => Some("; without --rehearse nothing is trained".to_owned()),
        _ => None,
    }
}

fn of_segments(error: &AnyError) -> Option<String> {
    let remedy = match error.downcast_ref::<SegmentsError>()? {
        SegmentsError::Packed { .. } => " (gs4d bake --quality lossless writes one)",
        SegmentsError::NoRuns { .. } | SegmentsError::OtherRuns { .. } => {
            ": gs4d compress --chunk stores it in that order"
        }
        SegmentsError::Differs { what, .. } => of_shared(*what)?,
        SegmentsError::Still { .. } => " (gs4d convert --duration)",
        SegmentsError::Overlap { .. } => "; without --keep-times, it begins then",
        SegmentsError::Speed { .. } => "; without --keep-times, it is stretched",
        SegmentsError::Sound { .. } => " (gs4d sound --extract, then --remove), and published beside it",
        SegmentsError::ManyChunks { .. } => ": give a longer --chunk, or fewer --layers",
        _ => return None,
    };
    Some(remedy.to_owned())
}

fn of_compress(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<CompressError>()? {
        CompressError::AlreadyPacked => {
            Some(" (gs4d compress with --progressive or --chunk alone changes its order)".to_owned())
        }
        _ => None,
    }
}

fn of_collide(error: &AnyError) -> Option<String> {
    let remedy = match error.downcast_ref::<CollideError>()? {
        CollideError::NoExtent => ": choose a box around the capture with --bounds",
        CollideError::TooManyStretches { .. } => ": choose a lower --rate",
        CollideError::TooLarge => ": choose fewer --cells, a lower --rate or a larger --error",
        CollideError::NothingSolid { .. } => ": choose a lower --level or --smallest",
        _ => return None,
    };
    Some(remedy.to_owned())
}

/// Returns what makes a setting of segments the same.
fn of_shared(what: Shared) -> Option<&'static str> {
    match what {
        Shared::Background => Some(": gs4d convert --background replaces it"),
        Shared::Up => Some(": gs4d convert --up replaces it"),
        Shared::Cutoff => Some(": gs4d convert --cutoff replaces it"),
        Shared::RasterFov => Some(": gs4d convert --raster-fov replaces it"),
        Shared::Cameras => Some(": gs4d convert --trained-cameras replaces it"),
        Shared::ShDirection => Some(": gs4d convert --sh-direction replaces it"),
        Shared::Degrees => Some(": lower the higher one with gs4d convert --sh-degree --sh-degree-t"),
        Shared::ColorPeriod => Some(": gs4d convert --sh-degree-t 0 makes the colors of all rest"),
        _ => None,
    }
}

fn of_bake(error: &AnyError) -> Option<String> {
    match error.downcast_ref::<BakeError>()? {
        BakeError::MissingShard { shard, .. } => Some(format!(": run --only score --shard {shard} before")),
        BakeError::MissingImage { .. } => {
            Some("; put them beside the camera file, or give --ratio or --keep".to_owned())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::store::shard::Shard;
    use crate::renderer::GpuError;
    use glam::UVec2;
    use std::path::PathBuf;

    fn memory(purpose: Purpose) -> EngineError {
        EngineError::Memory { count: 2, size: UVec2::ONE, needed: 2_000_000_000, available: 1_000_000_000, purpose }
    }

    #[test]
    fn the_remedy_follows_the_message_of_the_error() {
        let folder = || PathBuf::from("out.bake");
        let frame = FrameProblem::NoTime("a.png".to_owned());
        let errors: [(Box<dyn Error>, &str); 10] = [
            (TrainError::WithoutGpu.into(), "needs a GPU; --engine gpu takes one with a software driver, slowly"),
            (FootageError::from(TrainError::WithoutGpu).into(), "needs a GPU; without --rehearse nothing is trained"),
            (FormError::NotTrained.into(), "to the trained form: convert the checkpoint with --form trained"),
            (
                StoreError::MissingStage { folder: folder(), stage: "score", only: "prune" }.into(),
                "with these inputs: run --only score before --only prune",
            ),
            (
                BakeError::MissingShard { folder: folder(), shard: Shard::WHOLE }.into(),
                "the stage score: run --only score --shard 0/1 before",
            ),
            (MeasureError::UnknownSize { path: folder() }.into(), ": give --size WxH"),
            (DrawError::NothingToOrbit.into(), "around it: give --cameras"),
            (
                DatasetError::Frame { path: folder(), frame: 3, problem: frame }.into(),
                "of all frames (--static reads every frame at time 0)",
            ),
            (
                TrainError::Start { path: folder(), reason: StartError::NoSilhouettes }.into(),
                "so that they have no hull: give --start random",
            ),
            (
                SegmentsError::ManyChunks { path: folder(), found: 100_000 }.into(),
                "100000 chunk files, more than 99999: give a longer --chunk, or fewer --layers",
            ),
        ];
        for (error, end) in errors {
            let line = line(&*error);
            assert!(line.ends_with(end), "{end}: {line}");
        }
    }

    #[test]
    fn the_remedy_of_a_cause_ends_the_line() {
        let cause = || MeasureError::from(memory(Purpose::Verified));
        let line = "2 pictures of up to 1x1 pixels need 2.0 GB of memory, and 1.0 GB are available: --size makes pictures \
                    smaller, --verify fewer";
        let errors: [Box<dyn Error>; 3] =
            [cause().into(), PruneError::from(cause()).into(), BakeError::from(cause()).into()];
        for error in errors {
            assert_eq!(super::line(&*error), line, "the message is printed once, with its remedy");
        }
    }

    #[test]
    fn every_purpose_of_pictures_has_its_own_remedy() {
        let purposes = [Purpose::Dataset, Purpose::Drawn, Purpose::Verified, Purpose::Directions, Purpose::Other];
        let remedies = purposes.map(|purpose| of(&memory(purpose)));
        for (index, remedy) in remedies.iter().enumerate() {
            assert!(remedy.starts_with(": ") && !remedies[..index].contains(remedy), "its own remedy: {remedy}");
        }
        let limit = EngineError::Limit { reason: GpuError::Device("full".to_owned()), purpose: Purpose::Drawn };
        assert_eq!(of(&limit), " (--size makes pictures smaller)", "the remedy of a limit of the GPU is in brackets");
    }

    #[test]
    fn every_choice_on_validation_views_has_its_own_alternative() {
        for (choice, instead) in [
            (ValidatedChoice::Loss, "or give --ratio or --keep in its place"),
            (ValidatedChoice::Score, "or name a score with --variant"),
            (ValidatedChoice::Rows, "or measure on the views of another --split"),
        ] {
            let remedy = of(&PruneError::NoValidation { choice });
            assert!(remedy.contains("give --validation cameras or times") && remedy.ends_with(instead), "{remedy}");
        }
    }

    #[test]
    fn errors_without_a_remedy_are_unchanged() {
        assert_eq!(of(&PruneError::NoScore), "", "an error of a known type");
        assert_eq!(of(&std::io::Error::other("full")), "", "an error of another type");
    }
}
