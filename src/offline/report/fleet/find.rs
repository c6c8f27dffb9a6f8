//! The packages of a report.
//!
//! In: paths of files and folders. Out: the paths of packages, those of unfinished bakes included, each once.

use crate::offline::store::results::{BAKE_FOLDER, CHUNKS, WORK_ENDINGS};
use crate::offline::work::FileError;
use crate::scene::ChunkTable;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The extension of packages, with its dot.
const PACKAGE: &str = ".gs4d";
/// The ending of the capture that a bake trains from pictures and keeps beside its package. It is not a result.
const TRAINED: &str = ".trained.gs4d";

/// Returns the packages that paths name, in their order. A file is a package whether it exists or not. A folder stands
/// for the packages in it and in its folders, sorted by name, and for the packages that unfinished bakes would write
/// there; trained captures (`NAME.trained.gs4d`), chunk files (`NAME.stream/`) and hidden files are left out.
///
/// # Errors
/// A folder that cannot be read, or has no packages.
pub(crate) fn find_packages(paths: &[PathBuf]) -> Result<Vec<PathBuf>, FileError> {
    let (mut found, mut seen) = (Vec::new(), HashSet::new());
    for path in paths {
        let packages = if path.is_dir() { in_folder(path)? } else { vec![path.clone()] };
        // Two paths may lead to one file.
        let same = |package: &PathBuf| fs::canonicalize(package).unwrap_or_else(|_| package.clone());
        found.extend(packages.into_iter().filter(|package| seen.insert(same(package))));
    }
    Ok(found)
}

fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        let at = |error| FileError::at(&folder, error);
        for entry in fs::read_dir(&folder).map_err(at)? {
            let entry = entry.map_err(at)?;
            let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
            // A link to a folder is not followed: it may lead in a circle.
            let is_folder = entry.file_type().map_err(at)?.is_dir();
            if name.starts_with('.') {
            } else if !is_folder {
                found.extend((name.ends_with(PACKAGE) && !name.ends_with(TRAINED)).then_some(path));
            } else if path.extension() == Some(CHUNKS.as_ref()) && path.join(ChunkTable::INDEX).exists() {
                // Chunk files: the package that they are of is listed itself.
            } else if !WORK_ENDINGS.iter().any(|ending| name.ends_with(ending)) {
                folders.push(path);
            } else if name.ends_with(BAKE_FOLDER) && name.trim_end_matches(BAKE_FOLDER).ends_with(PACKAGE) {
                let package = path.with_extension("");
                found.extend((!package.exists()).then_some(package));
            }
        }
    }
    found.sort();
    match found.is_empty() {
        true => Err(FileError::at(folder, "has no packages (.gs4d): name a folder that gs4d bake has written to")),
        false => Ok(found),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_stands_for_its_results_and_its_unfinished_bakes() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["b", "b/c.gs4d.bake", "d.gs4d.bake", "e.tune"] {
            fs::create_dir_all(path(name)).expect("the folder can be written to");
        }
        for name in ["a.gs4d", "a.trained.gs4d", "a.report.json", ".gs4d-x.part", "b/c.gs4d", "e.tune/f.gs4d"] {
            fs::write(path(name), "").expect("the folder can be written to");
        }
        let found =
            find_packages(&[path("missing.gs4d"), folder.path().to_owned(), path("a.gs4d"), path("b/../a.gs4d")]);
        let expected = ["missing.gs4d", "a.gs4d", "b/c.gs4d", "d.gs4d"].map(path);
        assert_eq!(found.expect("folders that can be read"), expected, "each result once, and nothing else");
        fs::create_dir(path("empty")).expect("the folder can be written to");
        let message = find_packages(&[path("empty")]).expect_err("no packages").to_string();
        assert!(message.contains("empty: has no packages"), "the folder and its fault: {message}");
    }
}
