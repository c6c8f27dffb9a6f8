//! The chunk files of a baked package, for players that stream it.
//!
//! In: a package. Out: the same capture in chunk files, in a folder beside it: what `split` writes of a package that
//! was compressed in their order. A bake writes them by itself if the package is large.

use super::BakeError;
use crate::codec::{self, ReadOptions};
use crate::offline::compress::{PackedOrder, reorder};
use crate::offline::segments::{Chunks, Cut, LayerShares, Segment, Split, other_chunks, remove_index};
use crate::offline::store::results::CHUNKS;
use crate::offline::work::{FileError, Progress};
use crate::scene::{ChunkTable, Form, GaussianScene, PackedScene, SceneForm};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Bytes above which a bake writes chunk files by itself: those of a second at 50 Mbit/s, within which a player of
/// chunk files has shown its first picture three times over.
const LARGE_BYTES: u64 = 6_250_000;
/// Seconds above which it does: chunk files of one stretch of time have nothing to leave out.
const LONG_SECONDS: f32 = 2.0;

/// Returns whether a bake of a package of so many bytes, which plays for `seconds`, writes chunk files by itself.
pub fn wants_chunk_files(bytes: u64, seconds: f32) -> bool {
    bytes > LARGE_BYTES && seconds > LONG_SECONDS
}

/// Returns the folder of the chunk files of a package: beside it, with the ending `.stream`.
pub fn chunk_folder(package: &Path) -> PathBuf {
    package.with_extension(CHUNKS)
}

/// Returns whether a package has all its chunk files: their index is written last.
pub fn has_chunk_files(package: &Path) -> bool {
    chunk_folder(package).join(ChunkTable::INDEX).exists()
}

/// Writes the chunk files of a package, whose Gaussians are first brought into their order if they are packed in
/// another one. Those of an earlier package in the same folder are removed, their index first. Begins the task
/// "writing".
///
/// # Errors
/// A package that cannot be read, files that cannot be written or removed, an interruption.
pub fn write_chunk_files(package: &Path, progress: &mut dyn Progress) -> Result<Chunks, BakeError> {
    let folder = chunk_folder(package);
    let scene = in_order(codec::load(package, &ReadOptions::default())?)?;
    let segment = Segment { path: package.to_owned(), scene };
    let split = match &segment.scene.form {
        SceneForm::Ready(Form::Packed(_)) => Split::of_runs(&segment)?,
        SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => {
            let Cut { layers, .. } = cut();
            let stretches = cut().stretches(segment.scene.playback.duration_seconds);
            Split::of(&segment, stretches.unwrap_or(ChunkTable::MOST_STRETCHES), &layers)?
        }
    };
    fs::create_dir_all(&folder).map_err(|error| FileError::at(&folder, error))?;
    remove_index(&folder, segment.scene.sound.as_deref())?;
    remove_earlier(&folder, &split)?;
    Ok(split.write(&segment, &folder, None, &[], progress)?)
}

/// Removes the chunk files of an earlier package, but for those that will be written.
fn remove_earlier(folder: &Path, split: &Split) -> Result<(), FileError> {
    let remove = |path: &PathBuf| match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(FileError::at(path, error)),
        _ => Ok(()),
    };
    other_chunks(folder, &split.paths(folder)).iter().try_for_each(remove)
}

/// Returns how the capture is cut: its first layers are small, so that the first picture is soon there.
fn cut() -> Cut {
    let layers = LayerShares::new(vec![5, 20, 25, 50]).unwrap_or_default();
    Cut { layers, ..Cut::default() }
}

/// Returns a scene in the order of chunk files, unless it is in such an order or not packed.
fn in_order(scene: GaussianScene) -> Result<GaussianScene, BakeError> {
    match &scene.form {
        SceneForm::Ready(Form::Packed(PackedScene { runs: None, .. })) => {
            Ok(reorder(scene.into_runtime()?, &PackedOrder::Chunks(cut()))?.0)
        }
        SceneForm::Ready(_) | SceneForm::Trained(_) => Ok(scene),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::package::WriteSettings;
    use crate::offline::compress::{CompressSettings, Quality, compress};
    use crate::offline::segments::unite;
    use crate::offline::work::{NoProgress, save};
    use crate::scene::synth::{SynthSettings, synthesize};

    #[test]
    fn chunk_files_are_wanted_for_large_packages_that_move() {
        assert!(wants_chunk_files(7_150_000, 60.0), "a take of a minute");
        assert!(!wants_chunk_files(2_500_000, 4.0), "a small capture");
        assert!(!wants_chunk_files(50_000_000, 0.0), "a still");
    }

    #[test]
    fn chunk_files_without_an_index_are_those_of_a_bake_that_failed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let package = folder.path().join("take.gs4d");
        assert!(!has_chunk_files(&package), "no folder");
        let chunks = chunk_folder(&package);
        fs::create_dir(&chunks).expect("the folder can be made");
        fs::write(chunks.join(ChunkTable::file_name(0, 3)), b"").expect("the folder can be written to");
        assert!(!has_chunk_files(&package), "one of three chunk files, which the next bake writes again");
        fs::write(chunks.join(ChunkTable::INDEX), b"").expect("the folder can be written to");
        assert!(has_chunk_files(&package), "the index is written last");
    }

    #[test]
    fn chunk_files_have_every_gaussian_of_a_package_in_any_form() {
        let settings = SynthSettings { count: 6000, duration_seconds: 4.0, ..SynthSettings::default() };
        let trained = synthesize(&settings);
        let runtime = trained.clone().into_runtime().expect("a synthetic scene can be drawn");
        let packed = compress(runtime.clone(), &CompressSettings::from(Quality::Balanced)).expect("the scene fits").0;
        for (name, scene) in [("trained", trained), ("sliced", runtime.into()), ("packed", packed)] {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let package = folder.path().join("take.gs4d");
            save(&package, &scene, &WriteSettings::default()).expect("the folder can be written to");
            let chunks = write_chunk_files(&package, &mut NoProgress).expect("the package can be cut");
            assert_eq!(chunks.index, folder.path().join("take.stream/index.gs4d"), "beside the package");
            let files = chunks.files.iter().map(|chunk| {
                let scene = codec::load(&chunk.path, &ReadOptions::default()).expect("a chunk can be read");
                Segment { path: chunk.path.clone(), scene }
            });
            let united = unite(files.collect(), &mut NoProgress).expect("chunks of one capture");
            let visible = |scene: &GaussianScene| {
                let gaussians = scene.gaussians().expect("every Gaussian can be drawn");
                gaussians.iter().filter(|gaussian| gaussian.opacity > 0.0).count()
            };
            assert_eq!(visible(&united), visible(&scene), "all Gaussians of the {name} form");
            let other = folder.path().join("take.stream/chunk-00001-of-00099.gs4d");
            fs::write(&other, b"of another capture").expect("the folder can be written to");
            let again = write_chunk_files(&package, &mut NoProgress).expect("the package can be cut again");
            assert_eq!(again, chunks, "the same files");
            assert!(!other.exists(), "a chunk of another package would be read with these");
        }
    }
}
