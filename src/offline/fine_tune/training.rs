//! The first phase of a run: its steps, evaluations and states.
//!
//! In: a run, optionally a stored state. Out: the best parameters, and the curve up to the last step.

use super::best::{Best, Progressed};
use super::grown::Grown;
use super::outcome::CurvePoint;
use super::preview::Preview;
use super::resume::{Checkpoint, Saves};
use super::run::Run;
use super::schedule::decay;
use super::settings::FineTuneSettings;
use crate::offline::score::ScoreError;
use crate::offline::{OfflineError, Progress};
use crate::scene::GaussianScene;
use std::time::{Duration, Instant};

/// Steps between two looks at gradients that are not finite.
const STEPS_OF_FAULTS: usize = 50;
/// Time after a state from which the next evaluation stores another, whatever its step.
const LATE: Duration = Duration::from_secs(60);
/// That time is at least so many times as long as storing the last state took.
const LEAST_WORK: u32 = 20;

/// Gets a function that returns the scene, whenever there are better parameters.
pub(crate) type Watch<'a> = &'a mut dyn FnMut(Scene<'_>) -> Result<(), OfflineError>;

/// Returns the scene with the parameters that were found just now.
pub(crate) type Scene<'a> = &'a dyn Fn() -> Result<GaussianScene, OfflineError>;

/// Makes the steps, from where a stored run ended.
pub(super) fn train(
    run: &mut Run<'_>,
    stored: Option<Checkpoint>,
    saves: Option<Saves<'_>>,
    watch: Watch<'_>,
    progress: &mut dyn Progress,
) -> Result<Progressed, OfflineError> {
    let settings = run.settings;
    let every = settings.evaluate_every.max(1);
    let stored = stored.filter(|stored| run.trainer.resume(&stored.state));
    let (mut curve, mut best) = match stored {
        Some(Checkpoint { curve, best, .. }) => {
            let step = curve.last().map_or(0, |last| last.step);
            progress.note(&format!("{} resumes after step {step}", settings.task()));
            (curve, best)
        }
        None => {
            let point = CurvePoint { step: 0, loss: None, training_psnr: None, psnr: run.evaluate()? };
            progress.note(&point.describe(None));
            (vec![point], Best { point, state: run.trainer.state()? })
        }
    };
    let mut preview = saves.filter(|_| settings.growth.is_some()).map(|saves| Preview::new(saves.folder()));
    if let Some(preview) = &mut preview {
        preview.write(run, progress)?;
    }
    let first = curve.last().map_or(0, |last| last.step);
    progress.begin(settings.task(), settings.steps);
    (0..first).for_each(|_| progress.advance());
    let (mut seconds, mut told, mut grown) = (0.0, false, Grown::default());
    let begun = Instant::now();
    let (mut stored_at, mut storing) = (begun, Duration::ZERO);
    let mut start = begun;
    let mut step = first;
    while step < settings.steps && !is_over(settings, &curve, &best) {
        // The last state is of an earlier evaluation: a resumed run makes the steps since then again, and ends at the same bytes.
        if progress.is_interrupted() {
            let pace = (step - first, seconds + start.elapsed().as_secs_f64());
            return Err(run.interrupted(Progressed { curve, best, pace }));
        }
        run.step(step, step + 1, decay(step, settings.steps, settings.last_rate))?;
        step += 1;
        grown += run.grow(step)?;
        progress.advance();
        if !told && step.is_multiple_of(STEPS_OF_FAULTS) {
            told = run.tell_faults(progress)?;
        }
        if step.is_multiple_of(settings.refresh_filter.max(1)) && step != settings.steps {
            match run.refresh_filter(progress) {
                // The run ends at the next look, with the best result so far, and stores nothing that depends on the filter.
                Err(OfflineError::Score(ScoreError::Interrupted)) => continue,
                refreshed => refreshed?,
            }
        }
        if !step.is_multiple_of(every) && step != settings.steps {
            continue;
        }
        // Waits for the steps made so far.
        let totals = run.trainer.totals()?;
        seconds += start.elapsed().as_secs_f64();
        let (loss, training_psnr) = (Some(totals.loss), Some(totals.psnr));
        let point = CurvePoint { step, loss, training_psnr, psnr: run.evaluate()? };
        let speed = (step - first) as f64 / seconds;
        let count = run.trainer.taken()?;
        let growth = settings.growth.map_or(String::new(), |growth| {
            let left = begun.elapsed().as_secs_f64() * (settings.steps - step) as f64 / (step - first) as f64;
            let left = left.round() as u64;
            let Grown { relocated, cloned, split, removed } = grown;
            let changes = match growth.cloning {
                Some(_) => format!("{cloned} cloned, {split} split, {removed} removed"),
                None => format!("{relocated} relocated"),
            };
            format!(", {count} Gaussians, {changes}, {} min {} s left", left / 60, left % 60)
        });
        progress.note(&format!("{}{growth}", point.describe(Some(speed))));
        grown = Grown::default();
        curve.push(point);
        if let Some(preview) = &mut preview {
            preview.write(run, progress)?;
        }
        if point.psnr > best.point.psnr || point.psnr.is_none() {
            best = Best { point, state: run.trainer.state()? };
            if step < settings.steps {
                watch(&|| run.scene())?;
            }
        }
        let goes_on = step < settings.steps || settings.compress.is_some();
        let is_late = stored_at.elapsed() > LATE.max(storing * LEAST_WORK);
        if let Some(saves) = saves.filter(|saves| (saves.are_due(step) || is_late) && goes_on) {
            let begun = Instant::now();
            let checkpoint = Checkpoint { curve, best, state: run.trainer.state()?, coded: None };
            saves.store(&checkpoint)?;
            Checkpoint { curve, best, .. } = checkpoint;
            (stored_at, storing) = (Instant::now(), begun.elapsed());
        }
        start = Instant::now();
    }
    if step < settings.steps {
        progress.note(&format!(
            "{} ends after step {step}: no evaluation has been better since step {}",
            settings.task(),
            best.point.step
        ));
    }
    progress.finish();
    if let Some(preview) = preview {
        preview.remove();
    }
    Ok(Progressed { curve, best, pace: (step - first, seconds) })
}

/// Returns whether no evaluation has been better for as many as patience allows.
fn is_over(settings: &FineTuneSettings, curve: &[CurvePoint], best: &Best) -> bool {
    let waited = curve.iter().rev().take_while(|point| point.step > best.point.step).count();
    settings.patience.is_some_and(|patience| waited >= patience)
}
