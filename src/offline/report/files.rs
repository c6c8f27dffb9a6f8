//! The files of a report.
//!
//! In: a [`BakeReport`], the package and its path. Out: the package `NAME.gs4d`, and `NAME.report.json` and
//! `NAME.report.html` beside it.

use super::{BakeReport, ReportError};
use crate::offline::work::save::write_together;
use std::path::{Path, PathBuf};

/// Writes the package, and the report beside it as JSON and as an HTML page, all of them or none. Returns the paths of
/// the report.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub(crate) fn write_with_report(report: &BakeReport, package: &[u8], out: &Path) -> Result<[PathBuf; 2], ReportError> {
    let paths = report_paths(out);
    let (json, html) = (format!("{:#}\n", report.json()?), report.html());
    write_together(&[(out, package), (&paths[0], json.as_bytes()), (&paths[1], html.as_bytes())])?;
    Ok(paths)
}

/// Returns the paths of the report beside a package, as JSON and as an HTML page: `scene.report.json` beside
/// `scene.gs4d`.
pub(crate) fn report_paths(out: &Path) -> [PathBuf; 2] {
    ["report.json", "report.html"].map(|extension| out.with_extension(extension))
}
