//! The first phase of a run: its steps, evaluations and states.
//!
//! In: a run, optionally a stored state. Out: the best parameters, and the curve up to the last step.

use super::repair::Repairs;
use super::session::Session;
use crate::offline::score::ScoreError;
use crate::offline::train::error::TrainError;
use crate::offline::train::results::CurvePoint;
use crate::offline::train::results::best_parameters::{Best, Progressed};
use crate::offline::train::results::live_package::Scene;
use crate::offline::train::results::outcome::describe_validation;
use crate::offline::train::results::preview::Preview;
use crate::offline::train::results::stored_state::{Checkpoint, Saves};
use crate::offline::train::schedule::decay;
use crate::offline::train::settings::FineTuneSettings;
use crate::offline::work::Progress;
use std::time::{Duration, Instant};

/// Steps between two looks at gradients that are not finite.
const STEPS_OF_FAULTS: usize = 50;
/// Time after a state from which the next evaluation stores another, whatever its step.
const LATE: Duration = Duration::from_secs(60);
/// That time is at least so many times as long as storing the last state took.
const LEAST_WORK: u32 = 20;

/// Gets a function that returns the scene, whenever there are better parameters.
pub(super) type Watch<'a> = &'a mut dyn FnMut(Scene<'_>) -> Result<(), TrainError>;

/// Makes the steps, from where a stored run ended. Begins the task of the settings.
pub(super) fn train(
    session: &mut Session<'_>,
    stored: Option<Checkpoint>,
    saves: Option<Saves<'_>>,
    watch: Watch<'_>,
    progress: &mut dyn Progress,
) -> Result<Progressed, TrainError> {
    let settings = session.settings;
    let mut phase = StepPhase::begin(session, stored, saves, progress)?;
    progress.begin(session.task(), settings.steps);
    (0..phase.first).for_each(|_| progress.advance());
    while phase.step < settings.steps && !(session.is_whole() && phase.is_over(settings)) {
        // The last state is of an earlier evaluation: a resumed run makes the steps since then again, and ends at the
        // same bytes.
        if progress.is_interrupted() {
            return Err(session.interrupted(phase.end(true)));
        }
        match phase.enter(session, progress) {
            Err(TrainError::Interrupted { .. }) => return Err(session.interrupted(phase.end(true))),
            entered => entered?,
        }
        session.step(phase.step, phase.step + 1, decay(phase.step, settings.steps, settings.last_rate))?;
        phase.step += 1;
        progress.advance();
        // Before a state is stored: a resumed run does not repeat it.
        phase.repairs.after_step(session, phase.step)?;
        phase.tell_faults(session, progress)?;
        if phase.step.is_multiple_of(settings.refresh_filter.max(1)) && phase.step != settings.steps {
            match session.refresh_filter(progress) {
                // The run ends at the next look, with the best result so far, and stores nothing that depends on the
                // filter.
                Err(TrainError::Score(ScoreError::Interrupted(_))) => continue,
                refreshed => refreshed?,
            }
        }
        if phase.step.is_multiple_of(settings.evaluate_every.max(1)) || phase.step == settings.steps {
            phase.evaluate(session, watch, progress)?;
        }
    }
    if phase.step < settings.steps {
        let (task, step, best) = (settings.task(), phase.step, phase.best.point.step);
        progress.note(&format!("{task} ends after step {step}: no evaluation has been better since step {best}"));
    }
    progress.finish();
    if let Some(preview) = phase.preview.take() {
        preview.remove();
    }
    Ok(phase.end(false))
}

/// The steps of a run, as far as they are made.
struct StepPhase<'a> {
    curve: Vec<CurvePoint>,
    best: Best,
    /// Steps of the stored run that this one goes on from.
    first: usize,
    /// Steps made, with these.
    step: usize,
    has_told_faults: bool,
    repairs: Repairs,
    preview: Option<Preview>,
    saves: Option<Saves<'a>>,
    clock: Clock,
}

/// The times of a phase.
struct Clock {
    /// When the phase began.
    begun: Instant,
    /// When the steps since the last evaluation began.
    since: Instant,
    /// Seconds of the steps before the last evaluation.
    seconds: f64,
    /// When the last state was stored, and how long that took.
    stored: (Instant, Duration),
}

impl<'a> StepPhase<'a> {
    /// Begins where a stored run ended, or else with an evaluation of the scene before the first step.
    fn begin(
        session: &mut Session<'_>,
        stored: Option<Checkpoint>,
        saves: Option<Saves<'a>>,
        progress: &mut dyn Progress,
    ) -> Result<Self, TrainError> {
        let settings = session.settings;
        let stored = stored.filter(|stored| session.trainer.resume(&stored.state));
        // The size of the step before: a state that was stored between two sizes goes on like the run that stored it.
        let made = stored.as_ref().and_then(|stored| stored.curve.last()).map_or(0, |point| point.step);
        session.enter(made.saturating_sub(1), progress)?;
        let (curve, best) = match stored {
            Some(Checkpoint { curve, best, .. }) => {
                let step = curve.last().map_or(0, |last| last.step);
                progress.note(&format!("{} resumes after step {step}", settings.task()));
                (curve, best)
            }
            None => {
                let point = CurvePoint { step: 0, loss: None, training_psnr: None, psnr: session.evaluate()? };
                progress.note(&point.describe(None));
                (vec![point], Best { point, state: session.trainer.state()? })
            }
        };
        let mut preview = saves.filter(|_| settings.growth.is_some()).map(|saves| Preview::new(saves.folder()));
        if let Some(preview) = &mut preview {
            preview.write(session.shown()?, progress)?;
        }
        let first = curve.last().map_or(0, |last| last.step);
        let now = Instant::now();
        let clock = Clock { begun: now, since: now, seconds: 0.0, stored: (now, Duration::ZERO) };
        let repairs = Repairs::of(session);
        Ok(Self { curve, best, first, step: first, has_told_faults: false, repairs, preview, saves, clock })
    }

    /// Uses images of the size of the next step, with its own task. Evaluations at another size are not comparable:
    /// from then on, the best is looked for anew.
    fn enter(&mut self, session: &mut Session<'_>, progress: &mut dyn Progress) -> Result<(), TrainError> {
        let seconds = self.clock.since.elapsed().as_secs_f64();
        if session.enter(self.step, progress)? {
            self.best = Best::unmeasured(self.step, session.trainer.state()?);
            self.clock.seconds += seconds;
            progress.finish();
            progress.begin(session.task(), session.settings.steps);
            (0..self.step).for_each(|_| progress.advance());
            self.clock.since = Instant::now();
        }
        Ok(())
    }

    /// Returns whether no evaluation has been better for as many as patience allows.
    fn is_over(&self, settings: &FineTuneSettings) -> bool {
        let waited = self.curve.iter().rev().take_while(|point| point.step > self.best.point.step).count();
        settings.patience.is_some_and(|patience| waited >= patience)
    }

    /// Reports the first gradient that was not finite, from time to time until there is one.
    fn tell_faults(&mut self, session: &Session<'_>, progress: &mut dyn Progress) -> Result<(), TrainError> {
        if !self.has_told_faults && self.step.is_multiple_of(STEPS_OF_FAULTS) {
            self.has_told_faults = session.tell_faults(progress)?;
        }
        Ok(())
    }

    /// Measures the quality after the steps made so far, and keeps the parameters if they are the best.
    fn evaluate(
        &mut self,
        session: &mut Session<'_>,
        watch: &mut dyn FnMut(Scene<'_>) -> Result<(), TrainError>,
        progress: &mut dyn Progress,
    ) -> Result<(), TrainError> {
        let (settings, step) = (session.settings, self.step);
        // Waits for the steps made so far.
        let totals = session.trainer.totals()?;
        self.clock.seconds += self.clock.since.elapsed().as_secs_f64();
        let (loss, training_psnr) = (Some(totals.loss), Some(totals.psnr));
        let point = CurvePoint { step, loss, training_psnr, psnr: session.evaluate()? };
        let speed = (step - self.first) as f64 / self.clock.seconds;
        let growth = self.growth(session)?;
        progress.note(&format!("{}{growth}", point.describe(Some(speed))));
        progress.show(&describe_validation(point.psnr));
        self.curve.push(point);
        if let Some(preview) = &mut self.preview {
            preview.write(session.shown()?, progress)?;
        }
        if point.psnr > self.best.point.psnr || point.psnr.is_none() {
            self.best = Best { point, state: session.trainer.state()? };
            if step < settings.steps {
                watch(&|| session.scene())?;
            }
        }
        if step < settings.steps || settings.compress.is_some() {
            self.store(session)?;
        }
        self.clock.since = Instant::now();
        Ok(())
    }

    /// Returns the number of Gaussians, what has been done to them since the last evaluation, and the time left, in
    /// words; nothing if the scene is fine-tuned.
    fn growth(&mut self, session: &mut Session<'_>) -> Result<String, TrainError> {
        let Some(changes) = session.trainer.report() else { return Ok(String::new()) };
        let changes = changes + &self.repairs.report();
        let (made, left) = (self.step - self.first, session.settings.steps - self.step);
        let left = (self.clock.begun.elapsed().as_secs_f64() * left as f64 / made as f64).round() as u64;
        let count = session.trainer.live_count()?;
        // Later steps at a larger size take longer.
        let at_least = if session.is_whole() { "" } else { "at least " };
        Ok(format!(", {count} Gaussians, {changes}, {at_least}{} min {} s left", left / 60, left % 60))
    }

    /// Stores the state if that is due.
    fn store(&mut self, session: &Session<'_>) -> Result<(), TrainError> {
        let (stored_at, storing) = self.clock.stored;
        let is_late = stored_at.elapsed() > LATE.max(storing * LEAST_WORK);
        if let Some(saves) = self.saves.filter(|saves| saves.are_due(self.step) || is_late) {
            let begun = Instant::now();
            saves.store(&self.curve, &self.best, &session.trainer.state()?, None)?;
            self.clock.stored = (Instant::now(), begun.elapsed());
        }
        Ok(())
    }

    /// Returns what the phase has found. `is_running`: steps have been made since the last evaluation.
    fn end(self, is_running: bool) -> Progressed {
        let Self { curve, best, first, step, clock, .. } = self;
        let running = if is_running { clock.since.elapsed().as_secs_f64() } else { 0.0 };
        Progressed { curve, best, pace: (step - first, clock.seconds + running) }
    }
}
