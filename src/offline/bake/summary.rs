//! The stage report of a bake.
//!
//! In: the Gaussians before and after, the package, the choices, the test views. Out: the [`BakeReport`].

use super::choice::Choice;
use super::settings::BakeSettings;
use super::test_comparison::Compared;
use super::tuning::Tuning;
use crate::codec::package;
use crate::gaussian::Gaussian;
use crate::offline::compress::{Quality, broken_promises};
use crate::offline::filter::temporal_filter::filter_name;
use crate::offline::prune::search::Goal;
use crate::offline::report::{
    Activity, BakeReport, Change, SectionSize, StageTime, VarianceHistogram, even_times, filter_shares,
};
use crate::offline::work::FileError;
use crate::scene::{Form, SceneForm, TemporalFilter, TrainedWith};
use std::fs;
use std::io::Cursor;

/// Number of times at which the active sets are computed.
const TIMES: usize = 61;

/// The results of a bake that the report summarizes.
pub(super) struct Facts<'a> {
    pub settings: &'a BakeSettings,
    pub trained_with: &'a TrainedWith,
    pub before: &'a [Gaussian],
    pub after: &'a [Gaussian],
    pub filter: &'a TemporalFilter,
    pub package: &'a [u8],
    pub choice: Choice,
    pub tuning: Option<Tuning>,
    pub stages: Vec<StageTime>,
    pub compared: Option<Compared>,
}

impl Facts<'_> {
    /// Returns the report.
    ///
    /// # Errors
    /// The package cannot be read back, the checkpoint has been removed.
    pub(super) fn report(self) -> Result<BakeReport, FileError> {
        let BakeSettings { checkpoint, data, out, .. } = self.settings;
        let (interval, cutoff) = (self.trained_with.time_interval, self.trained_with.marginal_cutoff);
        let times = even_times(interval, TIMES);
        let info = package::inspect(Cursor::new(self.package)).map_err(|error| FileError::at(out, error))?;
        let original = fs::metadata(checkpoint).map_err(|error| FileError::at(checkpoint, error))?;
        let (choices, warnings) = (self.choices(), self.warnings()?);
        let (split, evaluation, samples) = match self.compared {
            Some(compared) => (Some(compared.split.to_owned()), Some(compared.evaluation), compared.samples),
            None => (None, None, Vec::new()),
        };
        Ok(BakeReport {
            generator: format!("gs4d {}", env!("CARGO_PKG_VERSION")),
            checkpoint: checkpoint.display().to_string(),
            data: data.display().to_string(),
            package: out.display().to_string(),
            gaussians: Change { before: self.before.len(), after: self.after.len() },
            bytes: Change { before: original.len(), after: self.package.len() as u64 },
            choices,
            warnings,
            stages: self.stages,
            sections: SectionSize::by_name(&info.header.sections),
            variances: VarianceHistogram::of(self.before, self.after),
            activity: Change {
                before: Activity::of(self.before, cutoff, &times),
                after: Activity::of(self.after, cutoff, &times),
            },
            filter_share: Some(filter_shares(self.filter, interval, &times)),
            times,
            trials: self.choice.tried,
            fine_tuning: self.tuning.map(|tuning| tuning.curve).unwrap_or_default(),
            split,
            evaluation,
            samples,
        })
    }

    /// Returns what the quality promises and the package does not keep. Its pictures are compared with the images of
    /// the test views, not with those of the checkpoint.
    fn warnings(&self) -> Result<Vec<String>, FileError> {
        let scene = package::read(Cursor::new(self.package));
        match scene.map_err(|error| FileError::at(&self.settings.out, error))?.form {
            SceneForm::Ready(Form::Packed(packed)) => Ok(broken_promises(self.settings.quality, &packed, None)),
            SceneForm::Ready(Form::Sliced(_)) | SceneForm::Trained(_) => Ok(Vec::new()),
        }
    }

    /// Returns the choices of the user and of the bake, as readable names and values.
    fn choices(&self) -> Vec<(String, String)> {
        let pair = |name: &str, value: String| (name.to_owned(), value);
        let goal = match self.settings.goal {
            Goal::Keep(count) => format!("keep {count}"),
            Goal::Remove(ratio) => format!("remove {:.1} %", ratio * 100.0),
            Goal::MaxLoss(loss) => format!("lose at most {loss} dB on validation views"),
            Goal::Size(bytes) => format!("at most {} MB", bytes as f64 / 1e6),
        };
        let quality = Quality::NAMES.iter().find(|(_, quality)| *quality == self.settings.quality);
        let (kind, filter) = (filter_name(self.filter.kind), self.filter);
        vec![
            pair("goal", goal),
            pair("score", self.choice.score.clone()),
            pair("views", self.trained_with.validation.clone().unwrap_or_default()),
            pair("validation views compared", self.choice.compared_with.clone()),
            pair("rounds of pruning", if self.tuning.is_some() { self.settings.rounds } else { 1 }.to_string()),
            pair("fine-tuning", self.tuning.as_ref().map_or("none".to_owned(), in_words)),
            pair("temporal filter", format!("{kind}, {} key-frames", filter.segments + 1)),
            pair("active share", format!("{:.1} %", filter.active_share() * 100.0)),
            pair("quality", quality.map_or("", |(name, _)| name).to_owned()),
        ]
    }
}

/// Returns the gain of fine-tuning.
fn in_words(tuning: &Tuning) -> String {
    let Tuning { curve, best, validation } = tuning;
    let steps = format!("{} steps", best.step);
    match (curve.first().and_then(|point| point.psnr), best.psnr) {
        (Some(from), Some(to)) => format!("{steps}, {from:.2} to {to:.2} dB on {validation} validation views"),
        _ => format!("{steps}, no validation views"),
    }
}
