//! The files of a report.
//!
//! In: a [`BakeReport`], the path of the package. Out: `NAME.report.json` and `NAME.report.html` next to a package `NAME.gs4d`.

use super::BakeReport;
use crate::offline::{OfflineError, Progress, write_beside};
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes the report beside the package, as JSON and as an HTML page. Returns the paths of both.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub fn write_report(
    report: &BakeReport,
    out: &Path,
    progress: &mut dyn Progress,
) -> Result<[PathBuf; 2], OfflineError> {
    let paths = report_paths(out);
    for (path, text) in paths.iter().zip([format!("{:#}\n", report.json()?), report.html()]) {
        progress.uninterrupted(&mut || write_beside(path, |file| file.write_all(text.as_bytes())))?;
    }
    Ok(paths)
}

/// Returns the paths of the report beside a package, as JSON and as an HTML page.
pub fn report_paths(out: &Path) -> [PathBuf; 2] {
    [".report.json", ".report.html"].map(|ending| beside(out, ending))
}

/// Returns the path with `ending` in place of its extension: `scene.report.json` beside `scene.gs4d`.
fn beside(out: &Path, ending: &str) -> PathBuf {
    let mut name: OsString = out.file_stem().unwrap_or_default().to_owned();
    name.push(ending);
    out.with_file_name(name)
}
