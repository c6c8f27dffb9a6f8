//! The last phase of a run: training of color codebooks together with all other parameters, optionally on rounded
//! geometry, and compression.
//!
//! In: a run with the best parameters. Out: the scene in the packed form, and its PSNR on the validation views.

use super::session::Session;
use crate::offline::compress as packing;
use crate::offline::compress::{CompressSettings, Quality, compress_tied, train_codebooks};
use crate::offline::train::error::TrainError;
use crate::offline::train::parts::rounding::steps_between;
use crate::offline::train::parts::{Request, RoundingSettings};
use crate::offline::train::results::CurvePoint;
use crate::offline::train::results::best_parameters::Progressed;
use crate::offline::train::results::outcome::describe_validation;
use crate::offline::train::results::stored_state::{Checkpoint, Saves};
use crate::offline::train::schedule::decay;
use crate::offline::work::Progress;
use crate::scene::{GaussianScene, RuntimeScene};

/// Factor on the rates while codebooks are trained.
const RATE: f64 = 0.5;

/// Codes the colors by codebooks, whose sizes follow the number of Gaussians, trains these and all other parameters for
/// `steps` more steps, with [`FineTuneSettings::rounding`](super::FineTuneSettings::rounding) on pictures of the packed
/// geometry, and compresses the result. Qualities without codebooks are only compressed. A stored run resumes after its
/// last step. The last point of the curve is measured on the compressed scene.
pub(super) fn compress(
    session: &mut Session<'_>,
    quality: Quality,
    steps: usize,
    found: &mut Progressed,
    stored: Option<Checkpoint>,
    saves: Option<Saves<'_>>,
    progress: &mut dyn Progress,
) -> Result<GaussianScene, TrainError> {
    session.enter(session.settings.steps, progress)?;
    session.trainer.forget_moments();
    let scene = session.trainer.scene()?.into_runtime()?;
    let order = session.settings.order.clone();
    let settings = CompressSettings { order, ..CompressSettings::suiting(quality, scene.len()) };
    // Codebooks hold all coefficients but the first.
    let coded = scene.form.as_sliced().is_some_and(|sliced| sliced.harmonics.evaluated() > 1);
    let steps = if settings.codebooks.is_empty() || !coded { 0 } else { steps };
    if steps > 0 {
        add_codebooks(session, &scene, &settings)?;
    }
    let first = if steps > 0 { resume(session, stored, progress) } else { 0 };
    train(session, first..steps, found, saves, progress)?;
    let scene = session.scene()?.into_runtime()?;
    let (compressed, _) = match session.trainer.codebooks()? {
        Some(books) => compress_tied(scene, &settings, &books)?,
        None => packing::compress(scene, &settings)?,
    };
    let psnr = session.evaluate_scene(&compressed.clone().into_runtime()?)?;
    // Loss and training PSNR are not measured: no step trains the compressed scene.
    let step = session.settings.steps + steps;
    progress.note(&format!("compressed: {}", describe_validation(psnr)));
    found.curve.push(CurvePoint { step, loss: None, training_psnr: None, psnr });
    Ok(compressed)
}

/// Trains codebooks in place of all color coefficients but the first of each Gaussian from now on, and rounds geometry
/// if that is wanted. Codes are not stored, because the same scene has the same codes.
fn add_codebooks(
    session: &mut Session<'_>,
    scene: &RuntimeScene,
    settings: &CompressSettings,
) -> Result<(), TrainError> {
    let books = train_codebooks(scene, settings)?;
    let (first, every) = (session.settings.steps, steps_between(scene.len()));
    let bits = settings.geometry.filter(|_| session.settings.rounding);
    let rounding = bits.map(|bits| RoundingSettings { bits, first, every });
    let request = Request { codebooks: Some(&books), rounding, ..Request::of(session.settings) };
    Ok(session.trainer.prepare(&request)?)
}

/// Goes on from the state of a stored run. Returns the number of steps that it has made in this phase.
fn resume(session: &mut Session<'_>, stored: Option<Checkpoint>, progress: &mut dyn Progress) -> usize {
    let stored = stored.and_then(|stored| Some((stored.coded?, stored.state)));
    if let Some((coded, state)) = stored
        && session.trainer.resume(&state)
    {
        progress.note(&format!("training of codebooks resumes after step {coded}"));
        return coded;
    }
    0
}

/// Makes the steps of this phase that are left. Begins the task "training codebooks".
fn train(
    session: &mut Session<'_>,
    left: std::ops::Range<usize>,
    found: &Progressed,
    saves: Option<Saves<'_>>,
    progress: &mut dyn Progress,
) -> Result<(), TrainError> {
    let settings = session.settings;
    progress.begin("training codebooks", left.end);
    (0..left.start).for_each(|_| progress.advance());
    for step in left.clone() {
        if progress.is_interrupted() {
            return Err(session.interrupted(found.clone()));
        }
        session.step(settings.steps + step, step + 1, RATE * decay(step, left.end, settings.last_rate))?;
        progress.advance();
        let made = step + 1;
        if let Some(saves) = saves.filter(|saves| saves.are_due(made)) {
            saves.store(&found.curve, &found.best, &session.trainer.state()?, Some(made))?;
        }
    }
    progress.finish();
    Ok(())
}
