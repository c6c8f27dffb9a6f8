//! Training from a folder of pictures: everything between the dataset and the trained capture.
//!
//! In: [`TrainSettings`]. Out: the checked and divided views ([`Training`]), and from these the capture with the best
//! parameters ([`TrainedCapture`]). The package OUT is rewritten while training goes on.

use super::densification::Growth;
use super::error::TrainError;
use super::every_view::{EveryView, every_view};
use super::images::{ImageRoom, TrainingImages};
use super::memory::require_room;
use super::reference::terms::Terms;
use super::results::{FineTuned, Resume};
use super::schedule::Rates;
use super::settings::FineTuneSettings;
use super::start::seen::are_seen;
use super::start::{CaptureSettings, Start, StartError, StartSettings, begin, capture_of};
use super::train;
use super::usual::Usual;
use crate::offline::dataset::point_cloud::PointCloud;
use crate::offline::dataset::selection::camera_numbers;
use crate::offline::dataset::splits::{SplitOptions, Splits};
use crate::offline::dataset::{TrainingView, require_images, trained_pixel};
use crate::offline::store::results::{Key, Store};
use crate::offline::work::Progress;
use crate::renderer::Headless;
use crate::scene::{Origin, PlaybackHints, TrainedWith};
use std::path::{Path, PathBuf};

/// What a capture is trained from, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainSettings {
    /// Folder of the dataset.
    pub data: PathBuf,
    /// How the views are read and divided.
    pub splits: SplitOptions,
    /// The settings of the capture that the views do not contain.
    pub capture: CaptureSettings,
    /// How the capture begins.
    pub start: StartSettings,
    /// File of points to begin with; `None`: that of the dataset, if it has one.
    pub points: Option<PathBuf>,
    /// How it is trained.
    pub tuning: FineTuneSettings,
    /// A state is saved at evaluations whose step is a multiple of this.
    pub save_every: usize,
}

impl TrainSettings {
    /// The usual factor on the rates of means, relative to those of fine-tuning.
    pub const MEAN_RATE: f64 = 4.0;

    /// Returns the settings of a training that begins without Gaussians: the usual ones but for the number of steps.
    pub fn tuning(steps: usize) -> FineTuneSettings {
        FineTuneSettings {
            steps,
            rates: Rates { mean: Rates::OURS.mean * Self::MEAN_RATE, ..Rates::OURS },
            terms: Terms { opacity: 0.01, scale: 0.01, ..Terms::default() },
            similarity_share: 0.2,
            evaluate_every: 1000,
            growth: Some(Growth::over(steps)),
            ..FineTuneSettings::default()
        }
    }

    /// Returns the most Gaussians that there are at any step.
    fn capacity(&self) -> usize {
        let cloning = self.tuning.growth.and_then(|growth| growth.cloning);
        cloning.map_or(self.start.gaussians, |cloning| cloning.capacity.max(self.start.gaussians))
    }

    /// Reads the points to begin with, if any are given or named by the dataset, and hashes them. What the dataset
    /// names may be missing or empty unless points are asked for.
    fn cloud(
        &self,
        named: Option<&Path>,
        origin: &Origin,
        progress: &mut dyn Progress,
    ) -> Result<(Option<PointCloud>, Key), TrainError> {
        let none = (None, Key::of(b"no points"));
        let path = match self.start.start {
            Start::Auto | Start::Points => self.points.as_deref().or(named),
            Start::Hull | Start::Random => None,
        };
        let Some(path) = path else { return Ok(none) };
        let is_asked = self.start.start == Start::Points;
        if !is_asked && !path.is_file() {
            progress.note(&format!("note: {}: no such file of points, which the dataset names", path.display()));
            return Ok(none);
        }
        match PointCloud::load(path, origin)? {
            PointCloud(points) if points.is_empty() && is_asked => {
                Err(TrainError::Start { path: path.to_owned(), reason: StartError::NoFinitePoints })
            }
            PointCloud(points) if points.is_empty() => Ok(none),
            cloud => Ok((Some(cloud), Key::of_file(path)?)),
        }
    }

    /// Reads the cameras of the dataset and divides them.
    ///
    /// # Errors
    /// Views that cannot be used, images that are missing.
    pub(crate) fn divide(&self, progress: &mut dyn Progress) -> Result<Divided, TrainError> {
        let Self { data, splits: options, capture, .. } = self;
        let EveryView { views, origin, clock } = every_view(data, options, progress)?;
        let capture = CaptureSettings { origin, ..*capture };
        let of_dataset = |reason| TrainError::Start { path: data.clone(), reason };
        let (trained_with, playback) = capture_of(&views, &capture, clock).map_err(of_dataset)?;
        let splits = Splits::open(data, options, &trained_with, progress)?;
        require_images(&splits.train)?;
        Ok(Divided { splits, views, trained_with, playback })
    }

    /// Returns the usual settings for a dataset, with its usual choices.
    pub fn usual(data: PathBuf, splits: SplitOptions, usual: &Usual) -> Self {
        let start = StartSettings { gaussians: usual.gaussians, ..StartSettings::default() };
        let (exposure, patience) = (usual.is_rig, usual.patience);
        let tuning = FineTuneSettings { exposure, patience, ..Self::tuning(usual.steps) };
        Self { data, splits, capture: CaptureSettings::default(), start, points: None, tuning, save_every: 5000 }
    }
}

/// The views of a dataset, divided, and the capture that is trained on them: what is known before an image is read.
#[derive(Debug)]
pub(crate) struct Divided {
    pub splits: Splits,
    /// Every training view, including the validation views.
    pub views: Vec<TrainingView>,
    pub trained_with: TrainedWith,
    pub playback: PlaybackHints,
}

/// A training whose views are read.
#[derive(Debug)]
pub struct Training<'a> {
    settings: &'a TrainSettings,
    splits: Splits,
    /// Every training view, including the validation views.
    views: Vec<TrainingView>,
    trained_with: TrainedWith,
    playback: PlaybackHints,
    /// Points to begin with.
    cloud: Option<PointCloud>,
    key: Key,
}

/// A capture trained from pictures.
#[derive(Debug)]
pub struct TrainedCapture {
    /// The capture with the best parameters, and its quality at each evaluation.
    pub tuned: FineTuned,
    /// Where its first Gaussians came from.
    pub started: Start,
    /// Number of views that it was trained on.
    pub views: usize,
    /// The division of the views, in words.
    pub splits: String,
    /// The views that were held out, if these are of several cameras, or else every training view.
    pub compared: Vec<TrainingView>,
    /// Whether the user ended the training before its last step.
    pub interrupted: bool,
}

impl<'a> Training<'a> {
    /// Reads the views of the dataset, divides them, and hashes their images; reads the points to begin with.
    ///
    /// # Errors
    /// Views, images or points that are missing or cannot be used.
    pub fn open(settings: &'a TrainSettings, progress: &mut dyn Progress) -> Result<Self, TrainError> {
        let TrainSettings { start, tuning, .. } = settings;
        let Divided { splits, views, mut trained_with, playback } = settings.divide(progress)?;
        trained_with.validation = Some(splits.to_string());
        let (mut cloud, of_cloud) = settings.cloud(splits.points.as_deref(), &trained_with.origin, progress)?;
        if start.start == Start::Auto
            && let Some(points) = cloud.take_if(|points| !are_seen(points, &views))
        {
            let PointCloud(points) = points;
            let data = settings.data.display();
            progress.note(&format!(
                "note: {data}: most cameras see less than a hundredth of its {} points, which are not used (--start points uses them)",
                points.len()
            ));
        }
        let key = Key::of_images(&splits.train, progress)?
            .with(of_cloud)
            .with(Key::of_images(&splits.validation, progress)?)
            .and(&format!("{start:?} {tuning:?} {trained_with:?} {playback:?}"))
            .with(Key::of_views(&splits.train))
            .with(Key::of_views(&splits.validation))
            .and(env!("CARGO_PKG_VERSION"));
        Ok(Self { settings, splits, views, trained_with, playback, cloud, key })
    }

    /// Returns the views by purpose.
    pub fn splits(&self) -> &Splits {
        &self.splits
    }

    /// Returns the key of everything that the result depends on: images, cameras, settings, version.
    pub fn key(&self) -> Key {
        self.key
    }

    /// Trains the capture. Each better scene is written to `live`, if given; the result is not. State is kept in
    /// `store`, from which a training with the same key resumes.
    ///
    /// # Errors
    /// More Gaussians or images than fit, a lost device, a package or a state that cannot be written.
    pub fn run(
        self,
        headless: &mut Headless,
        store: &Store,
        live: Option<&Path>,
        progress: &mut dyn Progress,
    ) -> Result<TrainedCapture, TrainError> {
        let capacity = self.settings.capacity();
        let Self {
            settings: TrainSettings { data, start, tuning, save_every, .. },
            splits,
            views,
            trained_with,
            playback,
            cloud,
            key,
        } = self;
        // Images of one camera are too similar to show whether they are those of the capture.
        let of_several = camera_numbers(&splits.validation).into_iter().any(|camera| camera > 0);
        let compared = if of_several { splits.validation.clone() } else { views.clone() };
        TrainingImages::require_room(&splits.train, &splits.validation, headless)?;
        require_room(headless, capacity, start.degree, start.degree_t)?;
        let division = splits.to_string();
        let load = if tuning.coarse.is_some() { TrainingImages::load_first } else { TrainingImages::load };
        let images = load(splits.train, &splits.validation, &trained_with, ImageRoom::of_system(), progress)?;
        let begun = begin(&images, trained_with, playback, start, cloud.as_ref());
        let (scene, started) = begun.map_err(|reason| TrainError::Start { path: data.clone(), reason })?;
        let resume = Resume { store, key, every: *save_every };
        let (mut tuned, interrupted) = match train(headless, scene, &images, tuning, Some(resume), live, progress) {
            Err(TrainError::Interrupted { tuned: Some(tuned) }) => (*tuned, true),
            tuned => (tuned?, false),
        };
        tuned.scene.trained_with.pixel = trained_pixel(&tuned.scene, &views);
        tuned.scene.trained_with.iteration = tuned.best.step as u64;
        Ok(TrainedCapture { tuned, started, views: images.len(), splits: division, compared, interrupted })
    }
}
