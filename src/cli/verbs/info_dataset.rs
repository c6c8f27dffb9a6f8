//! `gs4d info DATASET`: shows what a dataset folder holds.
//!
//! In: a folder, how it is read, the path of a picture. Out: its format, cameras, times, sizes, splits, what is missing
//! and what was assumed; the cameras drawn into the picture. Of footage without cameras: its videos and folders.

use crate::cli::output::failure::Failure;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, lines};
use crate::offline::dataset::CameraOptions;
use crate::offline::dataset::cameras::drawing::draw;
use crate::offline::dataset::splits::split_name;
use crate::offline::dataset::summary::{SplitSummary, Summary};
use crate::offline::footage::uncalibrated;
use crate::offline::store::outputs::Files;
use crate::offline::work::write_png;
use serde_json::{Value, json};
use std::path::Path;

/// Describes a dataset, and draws its cameras into a picture if a path is given.
///
/// # Errors
/// A folder that is no dataset or cannot be read, a picture that cannot be written.
pub(crate) fn run(folder: &Path, options: &CameraOptions, picture: Option<&Path>) -> Result<Report, Failure> {
    if let Some(names) = uncalibrated(folder) {
        return footage_report(folder, &names, picture);
    }
    let files = Files::default().reads_data(folder);
    picture.iter().fold(files, |files, path| files.writes(path, "png")).check()?;
    let summary = Summary::of(folder, options)?;
    if let Some(path) = picture {
        write_png(path, &draw(&summary.cameras))?;
    }
    let sizes: Vec<String> = summary.sizes.iter().map(|size| format!("{} x {}", size.x, size.y)).collect();
    let [first, last] = summary.interval;
    let mut pairs = vec![
        ("dataset", folder.display().to_string()),
        ("format", summary.format.to_owned()),
        ("cameras", summary.cameras.len().to_string()),
        ("times", format!("{} from {first} to {last}", summary.times)),
        ("sizes", sizes.join(", ")),
        ("masks", format!("{} views", summary.masks)),
        ("points", summary.points.as_ref().map_or("none".to_owned(), |path| path.display().to_string())),
    ];
    pairs.extend(picture.map(|path| ("picture", path.display().to_string())));
    pairs.extend(summary.notes.iter().map(|sentence| ("note", sentence.clone())));
    pairs.extend(summary.missing.iter().map(|sentence| ("missing", sentence.clone())));
    let mut table = Table::new(&["split", "views", "cameras", "times"]);
    for split in &summary.splits {
        let counts = [split.views, split.cameras, split.times].map(|count| count.to_string());
        table.row([split_name(split.split).to_owned()].into_iter().chain(counts));
    }
    let split = |split: &SplitSummary| {
        json!({
            "split": split_name(split.split),
            "views": split.views,
            "cameras": split.cameras,
            "times": split.times,
        })
    };
    let json = json!({
        "dataset": folder.display().to_string(),
        "format": summary.format,
        "cameras": summary.cameras.len(),
        "times": summary.times,
        "time_interval": summary.interval,
        "sizes": summary.sizes.iter().map(|size| size.to_array()).collect::<Vec<_>>(),
        "masks": summary.masks,
        "points": summary.points.as_ref().map(|path| path.display().to_string()),
        "splits": summary.splits.iter().map(split).collect::<Vec<Value>>(),
        "notes": summary.notes,
        "missing": summary.missing,
        "picture": picture.map(|path| path.display().to_string()),
    });
    Ok(Report::new(json, format!("{}\n{table}", lines(&pairs))))
}

/// Returns the report of footage whose cameras are not known, given the names of its videos and folders.
fn footage_report(folder: &Path, names: &[String], picture: Option<&Path>) -> Result<Report, Failure> {
    if let Some(path) = picture {
        let message = "cannot be drawn: the cameras of this footage are not known yet; gs4d footage finds them";
        return Err(Failure::about(path, message));
    }
    let command = format!("gs4d footage {} -o DATASET", folder.display());
    let text = lines(&[
        ("footage", folder.display().to_string()),
        ("cameras", format!("{}, whose poses are not known: {}", names.len(), names.join(", "))),
        ("to do", format!("{command} finds them, and makes a dataset")),
    ]);
    let json = json!({ "folder": folder.display().to_string(), "footage": names, "command": command });
    Ok(Report::new(json, text))
}
