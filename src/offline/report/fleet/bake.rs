//! The results of one bake.
//!
//! In: the path of a package. Out: its figures, from its header and from the report beside it, or the reason why there
//! are none.

use super::stored_report::StoredReport;
use crate::codec::package::{self, PackageInfo};
use crate::codec::text::printable;
use crate::offline::report::{Change, report_paths};
use crate::offline::store::results::{BAKE_FOLDER, folder_beside};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The results of one bake.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bake {
    /// The package.
    pub package: PathBuf,
    /// The page of the report beside it, if there is one.
    pub page: Option<PathBuf>,
    /// The figures; `None` if the package cannot be read.
    pub figures: Option<Figures>,
    /// Remarks about the figures, sentences.
    pub notes: Vec<String>,
    /// Why the bake counts as failed; `None` if the package is intact, and its report, if it has one, can be read.
    pub failure: Option<String>,
}

/// The figures of one bake.
#[derive(Debug, Clone, Default)]
pub(crate) struct Figures {
    /// Name of the form of the Gaussians.
    pub form: &'static str,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Bytes of the package.
    pub bytes: u64,
    /// The figures of the report beside the package; `None` without a report.
    pub reported: Option<Reported>,
}

/// The figures of the report of a bake.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reported {
    /// Path of the checkpoint.
    pub checkpoint: Option<String>,
    /// Number of Gaussians of the checkpoint.
    pub gaussians: Option<usize>,
    /// Bytes of the checkpoint.
    pub bytes: Option<u64>,
    /// PSNR over the test views of the checkpoint and of the package, dB.
    pub psnr: Option<Change<f64>>,
    /// SSIM over the test views of the package.
    pub ssim: Option<f64>,
    /// Seconds of all stages that ran.
    pub seconds: f64,
    /// The choices of the user and of the bake, as names and values.
    pub choices: Vec<(String, String)>,
}

impl Bake {
    /// Reads the package, verifies its checksums, and reads the report beside it.
    pub(crate) fn read(package: &Path) -> Self {
        let [json, page] = report_paths(package);
        let mut bake = Self { package: package.to_owned(), page: page.is_file().then_some(page), ..Self::default() };
        match inspect(package) {
            Ok(info) => bake.figures = Some(Figures::of(&info)),
            Err(failure) => {
                bake.failure = Some(failure);
                return bake;
            }
        }
        match fs::read(&json) {
            Ok(bytes) => bake.take_report(&bytes),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                bake.note("has no report beside it, which gs4d bake writes: only its header is known");
            }
            Err(error) => bake.failure = Some(format!("its report cannot be read: {error}")),
        }
        bake
    }

    fn take_report(&mut self, bytes: &[u8]) {
        let report: StoredReport = match serde_json::from_slice(bytes) {
            Ok(report) => report,
            Err(error) => {
                let reason = printable(&error.to_string());
                self.failure = Some(format!("its report is damaged ({reason}): bake it again, or remove the report"));
                return;
            }
        };
        let Some(figures) = &mut self.figures else { return };
        let described = report.bytes.map(|bytes| bytes.after);
        if described.is_some_and(|described| described != figures.bytes) {
            self.note("was replaced after its report was written: only its header is known");
            return;
        }
        let skipped = report.stages.iter().filter(|stage| stage.skipped).count();
        figures.reported = Some(Reported::of(report));
        if skipped > 0 {
            let stages = if skipped == 1 { "a stage".to_owned() } else { format!("{skipped} stages") };
            self.note(&format!("was resumed: its time is without {stages} of an earlier run"));
        }
    }

    fn note(&mut self, note: &str) {
        self.notes.push(note.to_owned());
    }
}

impl Figures {
    fn of(info: &PackageInfo) -> Self {
        let header = &info.header;
        let following = header.chunks.iter().filter(|_| header.chunks_follow).flat_map(|table| &table.files);
        let following = following.map(|file| file.gaussians as usize).sum::<usize>();
        let gaussians = header.gaussians + following;
        Self { form: header.form.name(), gaussians, bytes: info.file_length, reported: None }
    }
}

impl Reported {
    fn of(report: StoredReport) -> Self {
        let StoredReport { checkpoint, gaussians, bytes, choices, stages, evaluation } = report;
        let psnr = evaluation.as_ref().and_then(|evaluation| {
            Some(Change { before: evaluation.before.mean.psnr?, after: evaluation.after.mean.psnr? })
        });
        Self {
            checkpoint,
            gaussians: gaussians.map(|gaussians| gaussians.before),
            bytes: bytes.map(|bytes| bytes.before),
            psnr,
            ssim: evaluation.and_then(|evaluation| evaluation.after.mean.ssim),
            seconds: stages.iter().filter(|stage| !stage.skipped).map(|stage| stage.seconds).sum(),
            choices,
        }
    }
}

/// Reads the header of a package, and verifies its checksums.
///
/// # Errors
/// A sentence that says why there is no intact package.
fn inspect(path: &Path) -> Result<PackageInfo, String> {
    let file = File::open(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound if folder_beside(path, BAKE_FOLDER).is_dir() => {
            "its bake has not ended: run the same command again, which resumes".to_owned()
        }
        ErrorKind::NotFound => "there is no such file: check the path".to_owned(),
        _ => format!("it cannot be opened: {error}"),
    })?;
    let info = package::inspect(file).map_err(|error| error.to_string())?;
    match info.damage() {
        None => Ok(info),
        Some(damage) => Err(format!("{damage}: copy or bake it again")),
    }
}
