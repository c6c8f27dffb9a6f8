//! The stage train of a bake whose input is a dataset: the capture that the stages after it prune and compress.
//!
//! In: [`TrainSettings`], the path of the package of a bake. Out: the capture, trained now or by an earlier run with
//! the same inputs; its package in the trained form at [`trained_path`], from which smaller packages can be baked
//! later.

use super::BakeError;
use crate::codec::{self, ReadOptions};
use crate::offline::engine::Engine;
use crate::offline::store::StoreError;
use crate::offline::store::outputs::Files;
use crate::offline::store::results::{BAKE_FOLDER, Key, Store};
use crate::offline::train::{TrainError, TrainSettings, TrainedCapture, Training};
use crate::offline::work::{Interrupted, Progress, save, write_settings};
use crate::scene::GaussianScene;
use std::path::{Path, PathBuf};

/// Name of the stored result: the hash of the package.
const STAGE: &str = "train";

/// Returns the path of the trained capture beside the package `out`: `NAME.trained.gs4d`.
pub fn trained_path(out: &Path) -> PathBuf {
    out.with_extension("trained.gs4d")
}

/// Returns the capture of a dataset. Begins the task "training" unless an earlier run has finished it; an interrupted
/// training resumes from the folder `OUT.bake`. `only` is the only stage of the bake that may run: another stage than
/// this one needs a training that is done, and the same stage on another machine is waited for.
///
/// # Errors
/// No GPU; views or images that cannot be used, Gaussians that do not fit, a package that cannot be written; an
/// interruption.
pub fn train_dataset(
    settings: &TrainSettings,
    out: &Path,
    only: Option<&'static str>,
    engine: &mut Engine,
    progress: &mut dyn Progress,
) -> Result<GaussianScene, BakeError> {
    let Engine::Gpu(headless) = engine else { return Err(TrainError::WithoutGpu.into()) };
    let trained = trained_path(out);
    Files::default().reads_data(&settings.data).writes_regular(&trained, "gs4d").check()?;
    let store = match only {
        Some(_) => Store::shared(out, BAKE_FOLDER)?,
        None => Store::beside(out, BAKE_FOLDER)?,
    };
    let training = Training::open(settings, progress)?;
    let key = training.key();
    let is_done = || {
        let done = store.load(STAGE, key).zip(Key::of_file(&trained).ok());
        done.is_some_and(|(stored, found)| stored == found.bytes())
    };
    let mut reserved = None;
    match only {
        Some(STAGE) => reserved = Some(store.reserve(STAGE, progress)?),
        Some(only) if !is_done() => {
            let folder = store.folder().to_owned();
            return Err(StoreError::MissingStage { folder, stage: STAGE, only }.into());
        }
        Some(_) | None => {}
    }
    if is_done() {
        progress.note("train: skipped, done before");
    } else {
        let TrainedCapture { tuned, interrupted, .. } = training.run(headless, &store, None, progress)?;
        // What has been trained so far is in the store; a package of an earlier bake stays until this one is complete.
        if interrupted {
            return Err(Interrupted.into());
        }
        save(&trained, &tuned.scene, &write_settings(&tuned.scene.form, None))?;
        store.store(STAGE, key, Key::of_file(&trained)?.bytes())?;
    }
    drop(reserved);
    // The stages after this one read the package, so that a resumed run begins with the same bytes.
    Ok(codec::load(&trained, &ReadOptions::default())?)
}
