//! The last phase of a run: training of color codebooks together with all other parameters, optionally on rounded geometry, and compression.
//!
//! In: a run with the best parameters. Out: the scene in the packed form, and its PSNR on the validation views.

use super::best::Progressed;
use super::outcome::{CurvePoint, describe_validation};
use super::resume::{Checkpoint, Saves};
use super::rounding::steps_between;
use super::run::Run;
use super::schedule::decay;
use crate::offline::quantize::{self, CompressSettings, Quality, compress_tied, train_codebooks};
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;

/// Factor on the rates while codebooks are trained.
const RATE: f64 = 0.5;

/// Codes the colors by codebooks, whose sizes follow the number of Gaussians, trains these and all other parameters for `steps` more steps,
/// with [`FineTuneSettings::rounding`](super::FineTuneSettings::rounding) on pictures of the packed geometry, and compresses the result.
/// Qualities without codebooks are only compressed. A stored run resumes after its last step. The last point of the curve is measured on the
/// compressed scene.
pub(super) fn compress(
    run: &mut Run<'_>,
    quality: Quality,
    steps: usize,
    found: &mut Progressed,
    stored: Option<Checkpoint>,
    saves: Option<Saves<'_>>,
    progress: &mut dyn Progress,
) -> Result<GaussianScene, OfflineError> {
    let made = run.settings.steps;
    run.trainer.forget_moments();
    let scene = run.trainer.scene()?.into_runtime()?;
    let settings = CompressSettings::suiting(quality, scene.len());
    // Codebooks hold all coefficients but the first.
    let coded = scene.form.as_sliced().is_some_and(|sliced| sliced.harmonics.evaluated() > 1);
    let steps = if settings.codebooks.is_empty() || !coded { 0 } else { steps };
    let bits = settings.geometry.filter(|_| run.settings.rounding && steps > 0);
    let between = steps_between(scene.len());
    let mut step = 0;
    if steps > 0 {
        // Codes are not stored, because the same scene has the same codes.
        run.trainer.tie(train_codebooks(&scene, &settings)?)?;
        if let Some(bits) = &bits {
            run.trainer.round(bits)?;
        }
        let stored = stored.and_then(|stored| Some((stored.coded?, stored.state)));
        if let Some((coded, state)) = stored
            && run.trainer.resume(&state)
        {
            progress.note(&format!("training of codebooks resumes after step {coded}"));
            step = coded;
        }
    }
    progress.begin("training codebooks", steps);
    (0..step).for_each(|_| progress.advance());
    while step < steps {
        if progress.is_interrupted() {
            return Err(run.interrupted(found.clone()));
        }
        // The steps of rounding depend on the step number alone, and the state has the result of the last rounding: a resumed run draws
        // the same pictures.
        if let Some(bits) = &bits
            && step > 0
            && step.is_multiple_of(between)
        {
            run.trainer.round(bits)?;
        }
        run.step(made + step, step + 1, RATE * decay(step, steps, run.settings.last_rate))?;
        step += 1;
        progress.advance();
        if let Some(saves) = saves.filter(|saves| saves.are_due(step)) {
            let Progressed { curve, best, .. } = &*found;
            let state = run.trainer.state()?;
            let checkpoint = Checkpoint { curve: curve.clone(), best: best.clone(), state, coded: Some(step) };
            saves.store(&checkpoint)?;
        }
    }
    progress.finish();
    let scene = run.scene()?.into_runtime()?;
    let (compressed, _) = match run.trainer.codebooks()? {
        Some(books) => compress_tied(scene, &settings, &books)?,
        None => quantize::compress(scene, &settings)?,
    };
    let psnr = run.evaluate_scene(&compressed.clone().into_runtime()?)?;
    // Loss and training PSNR are not measured: no step trains the compressed scene.
    let point = CurvePoint { step: made + step, loss: None, training_psnr: None, psnr };
    progress.note(&format!("compressed: {}", describe_validation(psnr)));
    found.curve.push(point);
    Ok(compressed)
}
