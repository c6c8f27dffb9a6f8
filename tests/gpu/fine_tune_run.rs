//! Complete runs of fine-tuning: with a temporal filter, compressed, interrupted and resumed.
//!
//! In: a small synthetic scene, its own pictures as a dataset. Out: proof that Gaussians which a filter leaves out are
//! not trained, that the filter is computed again, that the PSNR of a compressed result is that of the package, and
//! that a resumed run has the result of an uninterrupted one. Skipped where there is no GPU.

use crate::support::interrupting::Interrupting;
use crate::support::trained::trained_mut;
use crate::support::{dataset, gpu};
use bevy_gs4d::gaussian::{GradientMode, Parameters};
use bevy_gs4d::internal::offline::prune::select;
use bevy_gs4d::internal::offline::store::{Key, Store};
use bevy_gs4d::internal::offline::train::{Sample, Trainer};
use bevy_gs4d::offline::compress::Quality;
use bevy_gs4d::offline::dataset::TrainingView;
use bevy_gs4d::offline::dataset::{SplitOptions, Splits};
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::offline::train::{FineTuneSettings, ImageRoom, Rates, Resume, TrainError, TrainingImages, fine_tune};
use bevy_gs4d::offline::work::{NoProgress, Progress};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Environment, FilterKind, GaussianScene, TemporalFilter};
use bevy_gs4d::view::Background;
use glam::{UVec2, Vec3};
use tempfile::TempDir;

const COUNT: usize = 300;

/// A scene and its views, with images in a folder.
struct Lesson {
    folder: TempDir,
    scene: GaussianScene,
    views: Vec<TrainingView>,
    images: TrainingImages,
}

impl Lesson {
    fn new() -> Self {
        Self::of(synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() }))
    }

    fn of(scene: GaussianScene) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let runtime = scene.clone().into_runtime().expect("a synthetic scene can be drawn");
        let data = folder.path().join("data");
        dataset::write(&data, &runtime, Vec3::ZERO, 4, 4, UVec2::splat(40), true);
        let splits = Splits::open(&data, &SplitOptions::default(), &scene.trained_with, &mut NoProgress);
        let splits = splits.expect("the dataset was just written");
        let images = TrainingImages::load(
            splits.train.clone(),
            &splits.validation,
            &scene.trained_with,
            ImageRoom::of_system(),
            &mut NoProgress,
        );
        Self { scene, images: images.expect("the images were just written"), views: splits.train, folder }
    }

    /// Returns the scene with darker colors and a filter.
    fn disturbed(&self, filter: Option<TemporalFilter>) -> GaussianScene {
        let mut scene = GaussianScene { filter, ..self.scene.clone() };
        trained_mut(&mut scene).harmonics.values.iter_mut().for_each(|value| *value *= 0.7);
        scene
    }

    fn store(&self, name: &str) -> Store {
        Store::beside(&self.folder.path().join(name), ".tune").expect("the folder can be written to")
    }
}

/// Returns a filter of two segments: Gaussians of even index in the first, Gaussians whose index is a multiple of three
/// in the second.
fn filter(kind: FilterKind) -> TemporalFilter {
    let mut bits = vec![0; 2 * TemporalFilter::words(COUNT)];
    for index in 0..COUNT {
        for (segment, divisor) in [2, 3].into_iter().enumerate() {
            bits[segment * TemporalFilter::words(COUNT) + index / 32] |=
                u32::from(index % divisor == 0) << (index % 32);
        }
    }
    TemporalFilter::from_bits(kind, 2, COUNT, bits)
}

#[test]
fn gaussians_that_a_filter_leaves_out_are_not_trained() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    assert_eq!(lesson.images.len(), 12, "the views of three of four cameras");
    let mut gradients = |scene: GaussianScene, view: &TrainingView| {
        let mut trainer = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
        let image =
            trainer.upload(&view.load_covered().expect("the image was just written")).expect("the image fits the GPU");
        let view = view.camera.view(view.time, lesson.scene.trained_with.raster_fov);
        let background = Background::Color([0.3; 3]);
        let sample = Sample { view: &view, image: &image, background, number: 0 };
        trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
        trainer.gradients().expect("gradients can be read")
    };
    for (time, divisor) in [(0.0, 2), (1.0, 3)] {
        let view = lesson.views.iter().find(|view| view.time == time).expect("both ends have views");
        let mut found = gradients(lesson.disturbed(Some(filter(FilterKind::KeyFrame))), view);
        let kept: Vec<u32> = (0..COUNT as u32).filter(|index| index % divisor == 0).collect();
        let mut alone = gradients(select(&lesson.disturbed(None), &kept), view);
        let mut active = select(&found, &kept);
        assert_eq!(
            trained_mut(&mut active).parameters,
            trained_mut(&mut alone).parameters,
            "geometry equals that without the inactive Gaussians"
        );
        assert_eq!(
            trained_mut(&mut active).harmonics,
            trained_mut(&mut alone).harmonics,
            "color equals that without the inactive Gaussians"
        );
        assert!(
            trained_mut(&mut alone).harmonics.values.iter().any(|&value| value != 0.0),
            "active Gaussians have gradients"
        );
        let parameters = &trained_mut(&mut found).parameters;
        let still = (0..COUNT)
            .filter(|index| index % divisor as usize != 0)
            .all(|index| parameters.mean[index] == [0.0; 3] && parameters.opacity_logit[index] == 0.0);
        assert!(still, "at time {time} inactive Gaussians have no gradient");
    }
}

#[test]
fn filters_by_views_are_computed_again_in_training_and_support_filters_after_it() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let mut run = |kind, refresh_filter| {
        let settings = FineTuneSettings { steps: 6, evaluate_every: 3, refresh_filter, ..FineTuneSettings::default() };
        let scene = lesson.disturbed(Some(filter(kind)));
        let tuned = fine_tune(&mut headless, scene, &lesson.images, &settings, None, &mut NoProgress);
        let filter = tuned.expect("the scene can be trained").scene.filter.expect("the filter is kept");
        assert_eq!(
            (filter.kind, filter.segments, filter.count),
            (kind, 2, COUNT),
            "the filter has the same kind and size"
        );
        filter
    };
    assert_eq!(
        run(FilterKind::KeyFrame, 100),
        filter(FilterKind::KeyFrame),
        "after 6 of 100 steps the filter is unchanged"
    );
    let seen = run(FilterKind::KeyFrame, 2);
    assert!(seen.active_share() > filter(FilterKind::KeyFrame).active_share(), "most Gaussians are visible to a view");
    assert_ne!(
        run(FilterKind::Support, 100),
        filter(FilterKind::Support),
        "support is computed from trained lifespans"
    );
}

#[test]
fn colors_of_one_coefficient_are_compressed_without_codebooks() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let mut scene = lesson.disturbed(None);
    scene.form.truncate_colors(0, 0);
    let settings = FineTuneSettings { steps: 2, compress: Some((Quality::Balanced, 4)), ..FineTuneSettings::default() };
    let tuned = fine_tune(&mut headless, scene, &lesson.images, &settings, None, &mut NoProgress);
    let colors = tuned.expect("the scene can be compressed").scene.form.color_degrees();
    assert_eq!(colors.coefficients, 1, "the color has one coefficient, as before");
}

#[test]
fn the_last_point_of_a_compressed_run_is_measured_on_the_compressed_scene() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let validation = Splits::open(
        &lesson.folder.path().join("data"),
        &SplitOptions::default(),
        &lesson.scene.trained_with,
        &mut NoProgress,
    );
    let validation = validation.expect("the dataset was just written").validation;
    for quality in [Quality::Small, Quality::VisuallyLossless, Quality::Lossless] {
        let settings = FineTuneSettings { steps: 0, compress: Some((quality, 2)), ..FineTuneSettings::default() };
        let tuned = fine_tune(&mut headless, lesson.disturbed(None), &lesson.images, &settings, None, &mut NoProgress);
        let tuned = tuned.unwrap_or_else(|error| panic!("{quality:?}: {error}"));
        let runtime = tuned.scene.into_runtime().expect("a compressed scene can be drawn");
        let capture = headless.upload(&runtime).expect("the scene fits the GPU");
        let mut error = SquaredError::default();
        for view in &validation {
            let image = view.load_covered().expect("the image was just written").over(Vec3::ZERO);
            let view = view.camera.view(view.time, runtime.trained_with.raster_fov);
            let frame = headless.render(&capture, &view, Background::Color([0.0; 3])).expect("the view is drawn");
            error.add(&image, &frame.picture.clamped()).expect("one size");
        }
        let last = tuned.curve.last().expect("a point");
        let found = last.psnr.expect("validation views");
        assert!((found - error.psnr()).abs() < 1e-6, "{quality:?}: {found} dB reported, {} dB drawn", error.psnr());
        assert_eq!((last.loss, last.training_psnr), (None, None), "{quality:?}: no loss of the compressed scene");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn an_interrupted_and_resumed_run_has_the_result_of_an_uninterrupted_one() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let settings = FineTuneSettings {
        steps: 8,
        evaluate_every: 2,
        rates: Rates { mean: 2e-3, color: 1e-2, ..Rates::OURS },
        refresh_filter: 3,
        // Geometry is rounded before the first step and after step 50.
        compress: Some((Quality::Balanced, 56)),
        rounding: true,
        ..FineTuneSettings::default()
    };
    let run = |headless: &mut Headless, store: &Store, progress: &mut dyn Progress| {
        let resume = Resume { store, key: Key::of(b"inputs"), every: 2 };
        let scene = lesson.disturbed(Some(filter(FilterKind::KeyFrame)));
        fine_tune(headless, scene, &lesson.images, &settings, Some(resume), progress).map_err(Box::new)
    };
    let whole = run(&mut headless, &lesson.store("whole"), &mut NoProgress).expect("the scene can be trained");
    for (task, left) in [("fine-tuning", 3), ("fine-tuning", 4), ("training codebooks", 2), ("training codebooks", 53)]
    {
        let store = lesson.store(&format!("{task} {left}"));
        let stopped = run(&mut headless, &store, &mut Interrupting::new(task, left));
        let stopped = match stopped.map_err(|error| *error) {
            Err(TrainError::Interrupted { tuned: Some(stopped) }) => stopped,
            other => panic!("{task}: an interrupted run is an error with the best result so far: {other:?}"),
        };
        let made = whole.curve.iter().take(stopped.curve.len());
        assert!(
            made.eq(&stopped.curve),
            "{task}: the curve has the points before the interruption: {:?}",
            stopped.curve
        );
        let resumed = run(&mut headless, &store, &mut NoProgress).expect("the scene can be trained");
        assert!(resumed.scene == whole.scene, "{task}: the resumed run has the same scene");
        assert_eq!(
            (resumed.best, &resumed.curve),
            (whole.best, &whole.curve),
            "{task}: the resumed run has the same curve"
        );
    }
}

#[test]
fn the_last_steps_are_trained_on_rounded_geometry_only_if_requested() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let mut run = |rounding: bool, steps: usize| {
        let compress = Some((Quality::Small, steps));
        let settings = FineTuneSettings { steps: 0, compress, rounding, ..FineTuneSettings::default() };
        let tuned = fine_tune(&mut headless, lesson.disturbed(None), &lesson.images, &settings, None, &mut NoProgress);
        tuned.expect("the scene can be trained").scene
    };
    assert!(run(true, 5) != run(false, 5), "steps on rounded geometry have another result");
    assert!(run(true, 0) == run(false, 0), "without these steps the result is the same");
}

#[test]
fn captures_of_every_model_and_with_an_environment_map_are_trained() {
    let Some(mut headless) = gpu::headless() else { return };
    let texels = (0..3 * 8 * 4).map(|i| i as f32 / 95.0).collect();
    let map = Environment { width: 8, height: 4, texels };
    let cases: [(&str, fn(&mut Parameters), Option<Environment>); 4] = [
        ("rotated", |_| {}, None),
        ("unrotated", |parameters| parameters.rotation_r.clear(), None),
        (
            "static",
            |parameters| {
                parameters.rotation_r.clear();
                parameters.mean_t.clear();
                parameters.log_scale_t.clear();
            },
            None,
        ),
        ("environment", |_| {}, Some(map)),
    ];
    for (name, change, environment) in cases {
        let mut scene = synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() });
        change(&mut trained_mut(&mut scene).parameters);
        scene.environment = environment;
        let lesson = Lesson::of(scene);
        let settings = FineTuneSettings { steps: 20, evaluate_every: 20, ..FineTuneSettings::default() };
        // Validation is on the training views: the test is whether training has an effect.
        let (views, trained_with) = (lesson.views.clone(), &lesson.scene.trained_with);
        let images = TrainingImages::load(views, &lesson.views, trained_with, ImageRoom::of_system(), &mut NoProgress);
        let images = images.expect("the images were just written");
        let tuned = fine_tune(&mut headless, lesson.disturbed(None), &images, &settings, None, &mut NoProgress);
        let tuned = tuned.unwrap_or_else(|error| panic!("{name}: {error}"));
        let [first, .., _] = tuned.curve[..] else { panic!("{name}: a curve") };
        let (before, after) = (first.psnr.expect("validation views"), tuned.best.psnr.expect("validation views"));
        assert!(after > before + 0.5, "{name}: training raises the PSNR by 0.5 dB: {before:.2} to {after:.2} dB");
        let [found, before] = [&tuned.scene, &lesson.scene].map(|scene| scene.environment.as_ref());
        assert_eq!(found.is_some(), before.is_some(), "{name}: a scene with a map keeps one");
        assert!(found.is_none() || found != before, "{name}: the environment map is trained too");
    }
}

#[test]
fn images_that_are_read_when_they_are_needed_train_the_same_scene() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let settings = FineTuneSettings { steps: 20, evaluate_every: 10, ..FineTuneSettings::default() };
    let (validation, training) = lesson.views.split_at(4);
    let mut train = |room: ImageRoom| {
        let trained_with = &lesson.scene.trained_with;
        let images = TrainingImages::load(training.to_vec(), validation, trained_with, room, &mut NoProgress);
        let images = images.expect("the images were just written");
        let tuned = fine_tune(&mut headless, lesson.disturbed(None), &images, &settings, None, &mut NoProgress);
        (images.in_memory(), tuned.expect("the scene can be trained"))
    };
    let (all, expected) = train(ImageRoom::of_system());
    assert_eq!(all, lesson.views.len(), "there is memory for all images");
    // An image has 6,400 bytes.
    let (few, found) = train(ImageRoom { first: 1, all: 3 * 6_400 });
    assert!((1..=4).contains(&few), "the images of the first moment, and as many as fit: {few}");
    assert!(found.scene == expected.scene, "the same Gaussians, bit for bit");
    assert_eq!(found.curve, expected.curve, "the same losses, and the same PSNR of validation");
}

#[test]
fn validation_views_that_are_reproduced_exactly_do_not_keep_the_first_step() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let settings = FineTuneSettings { steps: 20, evaluate_every: 10, ..FineTuneSettings::default() };
    // Cameras that look away from the scene, with black images.
    let black = lesson.folder.path().join("black.png");
    image::RgbImage::new(40, 40).save(&black).expect("the folder can be written to");
    let mut validation = lesson.views.clone();
    for index in 0..lesson.views.len() {
        let mut view = lesson.views[index].clone();
        view.name = format!("black {index}");
        view.image = black.clone();
        let away = glam::Mat4::from_translation(Vec3::new(0.0, 0.0, -1000.0));
        view.camera.world_to_camera = away * view.camera.world_to_camera;
        validation.push(view);
    }
    let (views, trained_with) = (lesson.views.clone(), &lesson.scene.trained_with);
    let images = TrainingImages::load(views, &validation, trained_with, ImageRoom::of_system(), &mut NoProgress);
    let images = images.expect("the images were just written");
    let tuned = fine_tune(&mut headless, lesson.disturbed(None), &images, &settings, None, &mut NoProgress);
    let tuned = tuned.expect("the scene can be trained");
    assert_eq!(tuned.validation, 24, "twelve views of the scene and twelve black views");
    let finite = |psnr: Option<f64>| psnr.is_some_and(f64::is_finite);
    assert!(tuned.curve.iter().all(|point| finite(point.psnr)), "every PSNR is finite: {:?}", tuned.curve);
    assert_eq!(tuned.best.step, 20, "training helps, and the last step is kept: {:?}", tuned.curve);
}

#[test]
fn training_ends_early_when_it_no_longer_helps() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let rates = Rates {
        color: 0.0,
        harmonics: 0.0,
        opacity: 0.0,
        scale: 0.0,
        rotation: 0.0,
        mean: 0.0,
        mean_t: 0.0,
        environment: 0.0,
        exposure: 0.0,
    };
    let settings = FineTuneSettings { steps: 50, evaluate_every: 1, patience: Some(3), rates, ..Default::default() };
    let tuned = fine_tune(&mut headless, lesson.disturbed(None), &lesson.images, &settings, None, &mut NoProgress);
    let tuned = tuned.expect("the scene can be trained");
    assert_eq!((tuned.curve.len(), tuned.best.step), (4, 0), "three evaluations without an improvement");
}
