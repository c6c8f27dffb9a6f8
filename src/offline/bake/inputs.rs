//! The inputs that the stages of a bake share.
//!
//! In: a scene, [`BakeSettings`]. Out: the views of its dataset, divided; the folder of results; the keys of the
//! contents of all inputs.

use super::BakeError;
use super::ahead::check;
use super::job::{Job, Scoring};
use super::settings::BakeSettings;
use crate::offline::compress::require_unpacked;
use crate::offline::dataset::TrainingView;
use crate::offline::dataset::splits::Splits;
use crate::offline::dataset::trained_pixel;
use crate::offline::engine::Engine;
use crate::offline::forms::Subject;
use crate::offline::forms::convert::require_no_windows;
use crate::offline::measure::belonging::require_belonging;
use crate::offline::prune::search::Goal;
use crate::offline::store::results::{BAKE_FOLDER, Key, Store};
use crate::offline::train::{FineTuneSettings, ImageRoom, TrainingImages, untrainable::obstacle};
use crate::offline::work::{FileError, Progress};
use crate::scene::{GaussianScene, MAX_SEGMENTS};
use std::sync::Arc;

/// The inputs that the stages of a bake share.
pub(super) struct Inputs<'a> {
    pub settings: &'a BakeSettings,
    pub engine: &'a mut Engine,
    pub subject: Subject,
    pub splits: Splits,
    /// Every training view, including the validation views.
    pub views: Vec<TrainingView>,
    pub store: Store,
    /// Key of the contents of the checkpoint and of the options it was read with.
    pub scene_key: Key,
    /// Key of the cameras and times of the training and the validation views.
    pub cameras_key: Key,
    /// Keys of the contents of the images to train on, and to validate on.
    pub image_keys: [Key; 2],
    /// The images to train and to validate on, loaded when the first stage needs them.
    images: Option<Arc<TrainingImages>>,
}

impl<'a> Inputs<'a> {
    /// Reads the dataset and checks it against the scene, which [`bakeable`] returned.
    ///
    /// # Errors
    /// Views or images that cannot be used, another bake to the same package, a failure of the engine.
    pub(super) fn open(
        mut scene: GaussianScene,
        settings: &'a BakeSettings,
        job: Option<Job>,
        engine: &'a mut Engine,
        progress: &mut dyn Progress,
    ) -> Result<Self, BakeError> {
        let BakeSettings { checkpoint, data, splits: options, .. } = settings;
        let store = match job {
            Some(_) => Store::shared(&settings.out, BAKE_FOLDER)?,
            None => Store::beside(&settings.out, BAKE_FOLDER)?,
        };
        let splits = Splits::open(data, options, &scene.trained_with, progress)?;
        progress.note(&splits.to_string());
        let views = splits.all_training(&scene.trained_with, progress)?;
        check(settings, &splits, &views, engine)?;
        scene.trained_with.validation = Some(splits.to_string());
        let read = format!("{:?} {:?} {:?}", scene.trained_with, scene.playback, settings.background);
        let scene_key = Key::of_scene(checkpoint)?.and(env!("CARGO_PKG_VERSION")).and(&read);
        // How many Gaussians fit into a package of a given size depends on its other parts.
        let sound = scene.sound.as_ref().filter(|_| matches!(settings.goal, Goal::Size(_)));
        let scene_key = sound.map_or(scene_key, |sound| scene_key.with(Key::of(sound.bytes())));
        let cameras = [&splits.train, &splits.validation, &views];
        let cameras_key = cameras.into_iter().map(|views| Key::of_views(views)).fold(Key::of(b"cameras"), Key::with);
        let trained = Key::of_images(&splits.train, progress)?;
        let image_keys = [trained, Key::of_images(&splits.validation, progress)?];
        let mut subject = Subject::new(checkpoint, scene, settings.background)?;
        let pixel = trained_pixel(&subject.scene, &views);
        (subject.scene.trained_with.pixel, subject.runtime.trained_with.pixel) = (pixel, pixel);
        // Of the jobs of a bake, one checks the images.
        let checks = job.is_none_or(|job| job.stage == "score" && !matches!(job.scoring, Scoring::Shard(_)));
        if checks && !settings.trust_images {
            require_belonging(engine, &subject.runtime, &views, subject.background)?;
        }
        Ok(Self { settings, engine, subject, splits, views, store, scene_key, cameras_key, image_keys, images: None })
    }

    /// Returns the key of the contents of all images that a training depends on.
    pub(super) fn images_key(&self) -> Key {
        self.image_keys[0].with(self.image_keys[1])
    }

    /// Returns the images to train and to validate on. Loads them on the first call.
    pub(super) fn images(&mut self, progress: &mut dyn Progress) -> Result<Arc<TrainingImages>, BakeError> {
        if let Some(images) = &self.images {
            return Ok(images.clone());
        }
        let Splits { train, validation, .. } = &self.splits;
        let images = TrainingImages::load(
            train.clone(),
            validation,
            &self.subject.scene.trained_with,
            ImageRoom::of_system(),
            progress,
        )?;
        Ok(self.images.insert(Arc::new(images)).clone())
    }

    /// Returns the settings of fine-tuning; `None` if the remaining Gaussians are not trained.
    pub(super) fn tunes(&self) -> Option<&FineTuneSettings> {
        let can = matches!(self.engine, Engine::Gpu(_)) && self.obstacle().is_none();
        self.settings.fine_tune.as_ref().filter(|_| can)
    }

    /// Returns why fine-tuning is left out; `None` if the settings do not contain it.
    pub(super) fn reason_to_leave_out(&self) -> Option<String> {
        self.settings.fine_tune.as_ref()?;
        let software = "it needs a GPU; --engine gpu takes one with a software driver, slowly".to_owned();
        Some(self.obstacle().unwrap_or(software))
    }

    /// Returns why the scene cannot be trained; `None` if it can be.
    fn obstacle(&self) -> Option<String> {
        obstacle(&self.subject.scene.form, &self.views)
    }

    /// Returns the number of key-frames of the filter.
    pub(super) fn key_frames(&self) -> u32 {
        key_frames(self.settings, &self.views)
    }

    /// Returns the largest number of bytes that the package may have.
    pub(super) fn limit(&self) -> u64 {
        match self.settings.goal {
            Goal::Size(limit) => limit,
            Goal::Keep(_) | Goal::Remove(_) | Goal::MaxLoss(_) => u64::MAX,
        }
    }
}

/// Returns a scene with the sound of its package, and without what the bake makes anew: its temporal filter and its
/// levels of detail.
///
/// # Errors
/// A scene that is packed already or has windows of time, a sound that cannot be read.
pub(super) fn bakeable(mut scene: GaussianScene, settings: &BakeSettings) -> Result<GaussianScene, BakeError> {
    require_unpacked(&scene.form).map_err(|error| FileError::at(&settings.checkpoint, error))?;
    require_no_windows(scene.filter.as_ref(), "a bake")?;
    scene.sound = settings.sound()?.or(scene.sound);
    scene.filter = None;
    scene.levels.clear();
    Ok(scene)
}

/// Returns the number of key-frames of the filter, given every training view.
pub(super) fn key_frames(settings: &BakeSettings, views: &[TrainingView]) -> u32 {
    u32::try_from(settings.key_frames.count(views)).unwrap_or(u32::MAX).clamp(2, MAX_SEGMENTS + 1)
}
