//! What a bake has to say in the end.
//!
//! In: the Gaussians before and after, the package, the trials, the test views. Out: the [`BakeReport`], and its two files.

use crate::cli::drawing::Drawing;
use crate::cli::engine::Engine;
use crate::cli::failure::Failure;
use crate::cli::report::{bytes, lines, note, progress};
use crate::cli::splits::{self, SplitArgs};
use crate::cli::{interrupt, opening};
use crate::codec::package;
use crate::gaussian::Gaussian;
use crate::offline;
use crate::offline::dataset::Split;
use crate::offline::metrics::{Evaluation, EvaluationSettings, MetricSet, ViewMetrics, evaluate};
use crate::offline::report::{
    Activity, BakeReport, Change, Sample, SectionSize, StageTime, Tried, VarianceHistogram, even_times, filter_shares,
};
use crate::scene::{RuntimeScene, TemporalFilter, TrainedWith};
use crate::view::{Background, Picture};
use serde_json::Value;
use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Times at which the active sets are looked at.
const TIMES: usize = 61;
/// Views whose pictures are on the page.
const SAMPLES: usize = 3;

/// The test views, drawn before and after.
pub struct Compared {
    /// Name of the split.
    pub split: &'static str,
    /// How close both are.
    pub evaluation: Change<Evaluation>,
    /// A few of the views.
    pub samples: Vec<Sample>,
}

/// Draws the test views of both scenes; nothing if they or their images are not there, which is said.
///
/// # Errors
/// Images that cannot be read, an engine that fails.
pub fn compare(
    data: &SplitArgs,
    engine: &mut Engine,
    before: &RuntimeScene,
    after: &RuntimeScene,
    background: Background,
) -> Result<Option<Compared>, Failure> {
    let dataset = data.open(Split::Test, &before.trained_with);
    let dataset = match dataset.and_then(|dataset| Ok(dataset.require_images().map(|()| dataset)?)) {
        Ok(dataset) => dataset,
        Err(failure) => {
            note(&format!("note: the package is not compared with test views: {}", failure.message()));
            return Ok(None);
        }
    };
    let mut settings = EvaluationSettings::of(&before.trained_with, MetricSet::ALL);
    if let Background::Color(color) = background {
        settings.background = color;
    }
    let count = dataset.views.len();
    let samples = SAMPLES.min(count);
    let sampled: Vec<usize> = (0..samples).map(|k| (2 * k + 1) * count / (2 * samples)).collect();
    let bar = progress(2 * count, "comparing");
    let mut draw = |scene: &RuntimeScene| -> Result<(Evaluation, Vec<[Picture; 2]>), Failure> {
        let mut drawing = Drawing::of(engine, scene, background)?;
        let (mut index, mut kept) = (0, Vec::new());
        let seen = |_: &ViewMetrics, reference: &Picture, render: &Picture| {
            if sampled.contains(&index) {
                kept.push([reference.clone(), render.clone()]);
            }
            index += 1;
            bar.inc(1);
            Ok::<_, Failure>(())
        };
        let evaluation = evaluate(&dataset.views, &settings, |view| drawing.draw(view), seen)?;
        Ok((evaluation, kept))
    };
    let ((before, pictures), (after, pictures_after)) = (draw(before)?, draw(after)?);
    bar.finish_and_clear();
    let pictures = pictures.into_iter().zip(pictures_after);
    let samples = sampled.iter().zip(pictures).map(|(&index, ([reference, before], [_, after]))| {
        let view = &dataset.views[index];
        Sample { name: format!("{}, time {}", view.name, view.time), reference, before, after }
    });
    let samples = samples.collect();
    Ok(Some(Compared { split: splits::split_name(dataset.split), evaluation: Change { before, after }, samples }))
}

/// What the summary is about.
pub struct Facts<'a> {
    pub checkpoint: &'a Path,
    pub data: &'a Path,
    pub out: &'a Path,
    pub trained: &'a TrainedWith,
    pub before: &'a [Gaussian],
    pub after: &'a [Gaussian],
    pub filter: &'a TemporalFilter,
    pub choices: Vec<(String, String)>,
    pub trials: Vec<Tried>,
    pub stages: Vec<StageTime>,
    pub compared: Option<Compared>,
}

impl Facts<'_> {
    /// The report.
    ///
    /// # Errors
    /// The package cannot be read back.
    pub fn report(self) -> Result<BakeReport, Failure> {
        let interval = self.trained.time_interval;
        let times = even_times(interval, TIMES);
        let file = File::open(self.out).map_err(|error| Failure::at(self.out, &error))?;
        let info = package::inspect(file).map_err(|error| Failure::at(self.out, &error))?;
        let (split, evaluation, samples) = match self.compared {
            Some(compared) => (Some(compared.split.to_owned()), Some(compared.evaluation), compared.samples),
            None => (None, None, Vec::new()),
        };
        Ok(BakeReport {
            generator: format!("gs4d {}", env!("CARGO_PKG_VERSION")),
            checkpoint: self.checkpoint.display().to_string(),
            data: self.data.display().to_string(),
            package: self.out.display().to_string(),
            gaussians: Change { before: self.before.len(), after: self.after.len() },
            bytes: Change { before: opening::file_size(self.checkpoint)?, after: opening::file_size(self.out)? },
            choices: self.choices,
            stages: self.stages,
            sections: SectionSize::by_name(&info.header.sections),
            variances: VarianceHistogram::of(self.before, self.after),
            activity: Change { before: Activity::of(self.before, &times), after: Activity::of(self.after, &times) },
            filter_share: Some(filter_shares(self.filter, interval, &times)),
            times,
            trials: self.trials,
            split,
            evaluation,
            samples,
        })
    }
}

/// Writes both forms beside the package, and tells where they are.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub fn write(json: &Value, html: String, out: &Path) -> Result<[PathBuf; 2], Failure> {
    let paths = [beside(out, ".report.json"), beside(out, ".report.html")];
    for (path, text) in paths.iter().zip([format!("{json:#}\n"), html]) {
        interrupt::whole(|| offline::write_beside(path, |file| file.write_all(text.as_bytes())))?;
    }
    Ok(paths)
}

/// `scene.gs4d` and an ending: `scene` with that ending.
fn beside(out: &Path, ending: &str) -> PathBuf {
    let mut name: OsString = out.file_stem().unwrap_or_default().to_owned();
    name.push(ending);
    out.with_file_name(name)
}

/// The report for people, in short.
pub fn in_words(report: &BakeReport, files: &[PathBuf; 2]) -> String {
    let mut pairs = vec![
        ("package", format!("{}, {}", report.package, bytes(report.bytes.after))),
        ("Gaussians", format!("{} of {}", report.gaussians.after, report.gaussians.before)),
    ];
    if let Some(Change { before, after }) = &report.evaluation {
        let (before, after) = (before.mean, after.mean);
        pairs.push(("PSNR", format!("{:.3} dB, checkpoint {:.3} dB", after.psnr, before.psnr)));
        if let (Some(before), Some(after)) = (before.ssim, after.ssim) {
            pairs.push(("SSIM", format!("{after:.4}, checkpoint {before:.4}")));
        }
    }
    let choices = report.choices.iter().map(|(name, value)| (name.as_str(), value.clone()));
    pairs.extend(choices);
    let seconds: f64 = report.stages.iter().map(|stage| stage.seconds).sum();
    pairs.push(("time", format!("{seconds:.1} s")));
    pairs.push(("report", files[1].display().to_string()));
    lines(&pairs)
}
