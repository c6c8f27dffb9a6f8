//! Training on pictures that are small at first.
//!
//! In: a dataset of blobs made here. Out: proof that a training whose pictures are a quarter, half and whole size one
//! after the other finds the scene, resumes at the same bytes, and is the usual training if all pictures are small.
//! Skipped where there is no GPU.

use crate::support::blob::blob;
use crate::support::interrupting::Interrupting;
use crate::support::{dataset, gpu};
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::internal::offline::dataset::Clock;
use bevy_gs4d::internal::offline::store::{Key, Store};
use bevy_gs4d::internal::offline::train::{CaptureSettings, Start, StartSettings, begin, capture_of, train};
use bevy_gs4d::offline::dataset::{SplitOptions, Splits};
use bevy_gs4d::offline::train::{
    Coarse, FineTuneSettings, FineTuned, Growth, ImageRoom, Rates, Resume, Terms, TrainError, TrainingImages,
};
use bevy_gs4d::offline::work::{NoProgress, Progress};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::RuntimeScene;
use glam::{UVec2, Vec3};
use tempfile::TempDir;

/// A dataset of three blobs before black, in pictures of 64 by 64 pixels.
struct Lesson {
    folder: TempDir,
    splits: Splits,
}

impl Lesson {
    fn new() -> Self {
        let places = [Vec3::new(-0.5, -0.3, -0.2), Vec3::new(0.5, -0.2, 0.1), Vec3::new(0.0, 0.5, 0.3)];
        let colors = [Vec3::new(0.9, 0.2, 0.1), Vec3::new(0.1, 0.7, 0.2), Vec3::new(0.2, 0.3, 0.9)];
        let values = colors.iter().flat_map(|color| ((*color - 0.5) / 0.282_094_79).to_array());
        let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values: values.collect() };
        let blobs = places.map(|place| blob(place, Vec3::splat(0.25), 0.9)).to_vec();
        let scene = RuntimeScene::sliced(blobs, harmonics);
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = folder.path().join("data");
        dataset::write(&data, &scene, Vec3::ZERO, 10, 2, UVec2::splat(64), true);
        let splits = Splits::open(&data, &SplitOptions::default(), &scene.trained_with, &mut NoProgress);
        Self { splits: splits.expect("the dataset was just written"), folder }
    }

    fn store(&self, name: &str) -> Store {
        Store::beside(&self.folder.path().join(name), ".train").expect("the folder can be written to")
    }

    /// Trains a capture from random points, with validation on the camera that is held out.
    fn train(
        &self,
        headless: &mut Headless,
        coarse: Option<Coarse>,
        store: Option<&Store>,
        progress: &mut dyn Progress,
    ) -> Result<FineTuned, Box<TrainError>> {
        let settings = FineTuneSettings {
            steps: 300,
            evaluate_every: 30,
            similarity_share: 0.2,
            rates: Rates { mean: 1e-3, ..Rates::OURS },
            terms: Terms { opacity: 0.01, scale: 0.01, ..Terms::default() },
            growth: Some(Growth::over(300)),
            coarse,
            ..FineTuneSettings::default()
        };
        let Splits { train: views, validation, .. } = &self.splits;
        let (trained_with, playback) =
            capture_of(views, &CaptureSettings::default(), Clock::default()).expect("nine places");
        let load = if coarse.is_some() { TrainingImages::load_first } else { TrainingImages::load };
        let images = load(views.clone(), validation, &trained_with, ImageRoom::of_system(), &mut NoProgress);
        let images = images.expect("the images were just written");
        let start = StartSettings { gaussians: 400, start: Start::Random, degree: 1, ..StartSettings::default() };
        let (scene, _) = begin(&images, trained_with, playback, &start, None).expect("the cameras look at the blobs");
        let resume = store.map(|store| Resume { store, key: Key::of(b"blobs"), every: 1 });
        train(headless, scene, &images, &settings, resume, None, progress).map_err(Box::new)
    }
}

/// The tasks of a training, in their order.
#[derive(Default)]
struct Tasks(Vec<&'static str>);

impl Progress for Tasks {
    fn begin(&mut self, task: &'static str, _: usize) {
        self.0.push(task);
    }

    fn advance(&mut self) {}

    fn finish(&mut self) {}

    fn note(&mut self, _: &str) {}
}

fn coarse() -> Coarse {
    Coarse { whole_up_to: 32, ..Coarse::default() }
}

#[test]
fn a_training_on_small_pictures_first_finds_the_scene() {
    let Some(mut headless) = gpu::headless() else { return };
    let (lesson, mut tasks) = (Lesson::new(), Tasks::default());
    let whole = lesson.train(&mut headless, None, None, &mut NoProgress).expect("the capture is trained");
    let found = lesson.train(&mut headless, Some(coarse()), None, &mut tasks).expect("the capture is trained");
    let [expected, reached] = [&whole, &found].map(|tuned| tuned.best.psnr.expect("validation views"));
    println!("{expected:.2} dB at whole size, {reached:.2} dB on small pictures first");
    assert_eq!(found.scene.len(), 400, "the number of Gaussians stays");
    assert!(reached > 22.0, "{reached:.2} dB on the camera that is held out, more than 22 dB expected");
    assert!(reached > expected - 2.0, "{reached:.2} dB, {expected:.2} dB at whole size");
    assert!(found.best.step > 180, "the best parameters are of an evaluation at whole size: {}", found.best.step);
    let steps: Vec<&str> = tasks.0.into_iter().filter(|task| task.starts_with("training")).collect();
    let expected = ["training at a quarter of the size", "training at half the size", "training"];
    assert_eq!(steps, expected, "each size is a task");
}

#[test]
fn a_training_on_small_pictures_first_resumes_at_the_same_bytes() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let whole = lesson.train(&mut headless, Some(coarse()), None, &mut NoProgress).expect("the capture is trained");
    // Sizes change after steps 90 and 180, which are evaluated. The second run stops at step 100, with the state of 90.
    for (task, left) in [("training at a quarter of the size", 60), ("training at half the size", 100)] {
        let store = lesson.store(task);
        let stopped = lesson.train(&mut headless, Some(coarse()), Some(&store), &mut Interrupting::new(task, left));
        let stopped = stopped.map_err(|error| *error);
        assert!(matches!(stopped, Err(TrainError::Interrupted { tuned: Some(_) })), "{task}: interrupted");
        let resumed = lesson.train(&mut headless, Some(coarse()), Some(&store), &mut NoProgress);
        let resumed = resumed.expect("the capture is trained");
        assert!(resumed.scene == whole.scene, "{task}: the resumed run has the same scene");
        assert_eq!(resumed.curve, whole.curve, "{task}: the resumed run has the same curve");
    }
}

#[test]
fn small_pictures_are_trained_whole() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let [usual, found] = [None, Some(Coarse::default())]
        .map(|coarse| lesson.train(&mut headless, coarse, None, &mut NoProgress).expect("the capture is trained"));
    assert!(found.scene == usual.scene && found.curve == usual.curve, "the same result to the bit");
}
