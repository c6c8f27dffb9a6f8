//! Repairs between steps of training: births where several cameras miss something, floaters before single cameras.
//!
//! In: a rig of six cameras that see a ball at four moments, each time in another place; scenes without the ball, and
//! with a Gaussian right before a camera. Out: proof that the ball is found with births and not without them, that such
//! a run repeats and resumes at the same bytes, and that the Gaussian before the camera is hidden. Skipped where there
//! is no GPU.

use crate::support::blob::blob;
use crate::support::interrupting::Interrupting;
use crate::support::trained::{trained, trained_mut};
use crate::support::training::still_growth;
use crate::support::{dataset, gpu};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::internal::offline::store::{Key, Store};
use bevy_gs4d::internal::offline::train::{Births, Floaters};
use bevy_gs4d::offline::dataset::{SplitOptions, Splits, TrainingView};
use bevy_gs4d::offline::train::{
    FineTuneSettings, FineTuned, Growth, ImageRoom, Resume, TrainError, TrainingImages, fine_tune,
};
use bevy_gs4d::offline::work::{NoProgress, Progress};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use bevy_gs4d::view::RasterFov;
use glam::{UVec2, Vec3};
use tempfile::TempDir;

const SIZE: UVec2 = UVec2::splat(64);
const STEPS: usize = 120;
const MOMENTS: usize = 4;
/// The color behind the ball.
const GRAY: f32 = 0.5;

/// Returns the ball, which is in another place at each moment.
fn ball() -> RuntimeScene {
    let at = |moment: usize| {
        let (angle, height) = (2.0 * moment as f32, 0.2 * moment as f32 - 0.3);
        let place = Vec3::new(0.5 * angle.cos(), 0.5 * angle.sin(), height);
        let mean_t = moment as f32 / (MOMENTS - 1) as f32;
        Gaussian { mean_t, sigma_t: 0.05, ..blob(place, Vec3::splat(0.09), 0.95) }
    };
    let color = (Vec3::new(1.0, 0.9, 0.1) - 0.5) / 0.282_094_79;
    let values = std::iter::repeat_n(color.to_array(), MOMENTS).flatten().collect();
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values };
    let mut scene = RuntimeScene::sliced((0..MOMENTS).map(at).collect(), harmonics);
    scene.trained_with.background = [GRAY; 3];
    scene.trained_with.raster_fov = RasterFov::Corrected;
    scene
}

/// Returns faint gray Gaussians, which cannot be seen on gray.
fn nothing() -> GaussianScene {
    let mut scene = synthesize(&SynthSettings { count: 400, ..SynthSettings::default() });
    scene.trained_with.background = [GRAY; 3];
    let own = trained_mut(&mut scene);
    own.harmonics.values.fill(0.0);
    own.parameters.opacity_logit.fill(-4.0);
    own.parameters.log_scale.iter_mut().flatten().for_each(|scale| *scale -= 1.0);
    scene
}

/// The pictures of the ball.
struct Lesson {
    folder: TempDir,
    views: Vec<TrainingView>,
    images: TrainingImages,
}

impl Lesson {
    fn new() -> Self {
        let (folder, scene) = (tempfile::tempdir().expect("a temporary folder"), ball());
        let data = folder.path().join("data");
        dataset::write(&data, &scene, Vec3::ZERO, 6, MOMENTS, SIZE, true);
        let splits = Splits::open(&data, &SplitOptions::default(), &scene.trained_with, &mut NoProgress);
        let splits = splits.expect("the dataset was just written");
        let views = splits.all_training(&scene.trained_with, &mut NoProgress).expect("the dataset was just written");
        let room = ImageRoom::of_system();
        let images = TrainingImages::load(views.clone(), &[], &scene.trained_with, room, &mut NoProgress);
        Self { folder, views, images: images.expect("the images were just written") }
    }

    /// Trains without validation views: the last step is kept.
    fn train(
        &self,
        headless: &mut Headless,
        scene: GaussianScene,
        growth: Growth,
        store: Option<&Store>,
        progress: &mut dyn Progress,
    ) -> Result<FineTuned, Box<TrainError>> {
        let settings = FineTuneSettings {
            steps: STEPS,
            evaluate_every: STEPS / 4,
            growth: Some(growth),
            ..FineTuneSettings::default()
        };
        let resume = store.map(|store| Resume { store, key: Key::of(b"ball"), every: 1 });
        fine_tune(headless, scene, &self.images, &settings, resume, progress).map_err(Box::new)
    }

    /// Returns the mean error of the pixels that show the ball.
    fn error_of_ball(&self, headless: &mut Headless, scene: &GaussianScene) -> f64 {
        let runtime = scene.clone().into_runtime().expect("a trained scene can be drawn");
        let capture = headless.upload(&runtime).expect("the scene fits the GPU");
        let (mut sum, mut count) = (0.0, 0);
        for view in &self.views {
            let image = view.load_covered().expect("the image was just written").over(Vec3::ZERO);
            let view = view.camera.view(view.time, runtime.trained_with.raster_fov);
            let frame = headless.render(&capture, &view, runtime.trained_background()).expect("the view is drawn");
            for (image, drawn) in image.pixels.iter().zip(&frame.picture.pixels) {
                if (*image - GRAY).abs().max_element() > 0.2 {
                    sum += f64::from((*image - *drawn).abs().element_sum() / 3.0);
                    count += 1;
                }
            }
        }
        assert!(count > 24 * 10, "every view shows the ball: {count} pixels");
        sum / f64::from(count)
    }
}

fn with_births() -> Growth {
    let births = Births { every: 20, from: 10, until: 90, moments: 3, most: 200 };
    Growth { births: Some(births), ..still_growth() }
}

#[test]
fn a_ball_that_the_scene_lacks_is_found_with_births() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let mut error = |growth: Option<Growth>| {
        let scene = match growth {
            Some(growth) => {
                let tuned = lesson.train(&mut headless, nothing(), growth, None, &mut NoProgress);
                tuned.expect("the scene can be trained").scene
            }
            None => nothing(),
        };
        assert_eq!(scene.len(), 400, "the number of Gaussians stays");
        lesson.error_of_ball(&mut headless, &scene)
    };
    let (first, without, with) = (error(None), error(Some(still_growth())), error(Some(with_births())));
    println!("error of the ball: {first:.3} at first, {without:.3} without births, {with:.3} with them");
    assert!(first > 0.2, "the ball is not there at first: {first:.3}");
    assert!(with < 0.7 * without, "births find the ball: {with:.3} with them, {without:.3} without");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn training_with_births_repeats_and_resumes_at_the_same_bytes() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let mut run = |store: Option<&Store>, progress: &mut dyn Progress| {
        lesson.train(&mut headless, nothing(), with_births(), store, progress)
    };
    let whole = run(None, &mut NoProgress).expect("the scene can be trained");
    let again = run(None, &mut NoProgress).expect("the scene can be trained");
    assert!(whole.scene == again.scene && whole.curve == again.curve, "a second run has the same result");
    // A state is stored after step 60, after which there are births.
    let store = Store::beside(&lesson.folder.path().join("births"), ".train").expect("the folder can be written to");
    let stopped = run(Some(&store), &mut Interrupting::new("training", 75)).map_err(|error| *error);
    assert!(matches!(stopped, Err(TrainError::Interrupted { tuned: Some(_) })), "interrupted");
    let resumed = run(Some(&store), &mut NoProgress).expect("the scene can be trained");
    assert!(resumed.scene == whole.scene && resumed.curve == whole.curve, "the resumed run has the same result");
}

#[test]
fn a_gaussian_before_a_camera_is_hidden() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let mut scene = nothing();
    let eye = lesson.views[0].camera.view(0.0, RasterFov::Corrected).camera_position;
    let parameters = &mut trained_mut(&mut scene).parameters;
    // A tenth of the way to what the cameras look at.
    parameters.mean[0] = (0.9 * eye).to_array();
    parameters.log_scale[0] = [0.02f32.ln(); 3];
    parameters.opacity_logit[0] = 2.0;
    let floaters = Floaters { every: 20, from: 10, until: 90 };
    let mut logits = |floaters: Option<Floaters>| {
        let growth = Growth { floaters, ..still_growth() };
        let tuned = lesson.train(&mut headless, scene.clone(), growth, None, &mut NoProgress);
        trained(&tuned.expect("the scene can be trained").scene).parameters.opacity_logit.clone()
    };
    let (stays, hidden) = (logits(None), logits(Some(floaters)));
    assert!(stays[0] > -5.0, "without the search it stays: {}", stays[0]);
    assert!(hidden[0] < -7.0, "with it, it is hidden: {}", hidden[0]);
    assert!(hidden[1..].iter().all(|&logit| logit > -7.9), "and no other Gaussian is");
}
