//! Training from the pictures of one camera that moves: the capture that deforms, and what it leaves for native Gaussians.
//!
//! In: a dataset made here, in which each moment is seen from one place. Out: proof that the native Gaussians to begin with, and the views that are
//! drawn, show moments that no image does; that runs repeat and resume at the same bytes, and that views whose images are gone are drawn again.
//! Skipped where there is no GPU.

use crate::support::blob::blob;
use crate::support::covered::write_covered;
use crate::support::{dataset, gpu};
use bevy_gs4d::gaussian::{Gaussian, Harmonics};
use bevy_gs4d::internal::offline::store::Store;
use bevy_gs4d::internal::offline::train::{StartSettings, TrainSettings, TrainedCapture, Training, train_dataset};
use bevy_gs4d::offline::dataset::{TrainingView, Validation};
use bevy_gs4d::offline::engine::Engine;
use bevy_gs4d::offline::metrics::SquaredError;
use bevy_gs4d::offline::{NoProgress, SplitOptions, Splits};
use bevy_gs4d::reference;
use bevy_gs4d::scene::RuntimeScene;
use bevy_gs4d::view::{Background, RasterFov};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Moments, and as many places.
const MOMENTS: usize = 30;

/// Returns blobs that stand, move and turn back.
fn blobs() -> RuntimeScene {
    let at = Vec3::new;
    let moving =
        |mean: Vec3, velocity: [f32; 3], scale: f32| Gaussian { velocity, ..blob(mean, Vec3::splat(scale), 0.9) };
    let blobs = [
        (blob(at(-0.5, -0.3, -0.2), at(0.25, 0.2, 0.2), 0.9), at(0.9, 0.2, 0.1)),
        (blob(at(0.5, -0.3, 0.0), at(0.15, 0.25, 0.3), 0.9), at(0.1, 0.7, 0.2)),
        (moving(at(0.0, 0.3, 0.3), [0.0, 0.8, 0.0], 0.2), at(0.2, 0.3, 0.9)),
        (moving(at(0.1, 0.6, -0.3), [-0.8, 0.0, 0.2], 0.15), at(0.9, 0.8, 0.1)),
    ];
    let colors = blobs.iter().flat_map(|(_, color)| ((*color - 0.5) / 0.282_094_79).to_array());
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values: colors.collect() };
    RuntimeScene::sliced(blobs.into_iter().map(|(gaussian, _)| gaussian).collect(), harmonics)
}

/// A dataset in which each moment is seen from a place of its own.
struct Film {
    folder: TempDir,
    data: PathBuf,
}

impl Film {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = folder.path().join("data");
        let scene = blobs();
        dataset::write(&data, &scene, Vec3::ZERO, MOMENTS, MOMENTS, UVec2::splat(48), false);
        let path = data.join("transforms_train.json");
        let text = fs::read_to_string(&path).expect("the dataset was just written");
        let mut json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let frames = json["frames"].as_array_mut().expect("frames");
        let mut index = 0;
        frames.retain(|_| {
            let (camera, moment) = (index / MOMENTS, index % MOMENTS);
            index += 1;
            camera == (moment * 11) % MOMENTS
        });
        assert_eq!(frames.len(), MOMENTS, "a place for each moment");
        fs::write(&path, json.to_string()).expect("the folder can be written to");
        let film = Self { folder, data };
        let splits = Splits::open(&film.data, &film.options(), &scene.trained_with, &mut NoProgress);
        let Splits { train, validation, .. } = splits.expect("the dataset was just written");
        assert!(!validation.is_empty() && train.len() + validation.len() == MOMENTS, "blocks of time are held out");
        train.iter().chain(&validation).for_each(|view| write_covered(&scene, view, 1.0, &view.image));
        film
    }

    fn options(&self) -> SplitOptions {
        SplitOptions { validation: Validation::Times, ..SplitOptions::default() }
    }

    fn settings(&self, deformation: usize) -> TrainSettings {
        let mut settings = TrainSettings::usual(self.data.clone(), self.options());
        settings.start = StartSettings { gaussians: 500, degree: 1, ..StartSettings::default() };
        settings.deformation = deformation;
        settings.tuning = TrainSettings::tuning(30);
        settings.tuning.evaluate_every = 30;
        settings
    }

    /// Trains a capture, with intermediate results under this name; `None` without a GPU.
    fn train(&self, deformation: usize, name: &str) -> Option<TrainedCapture> {
        let (mut headless, settings) = (gpu::headless()?, self.settings(deformation));
        let out = self.folder.path().join(name);
        let store = Store::beside(&out, ".train").expect("the folder can be written to");
        let training = Training::open(&settings, &mut NoProgress).expect("the dataset was just written");
        Some(training.run(&mut headless, &store, &out, &mut NoProgress).expect("the capture is trained"))
    }
}

#[test]
fn native_gaussians_begin_with_what_a_deformation_has_learned() {
    let film = Film::new();
    let Some(found) = film.train(500, "found") else { return };
    let plain = film.train(0, "plain").expect("a GPU");
    assert!(plain.drawn.is_empty() && !found.drawn.is_empty(), "views are drawn by a deformation alone");
    let psnr =
        |capture: &TrainedCapture| capture.tuned.curve.iter().map(|point| point.psnr.expect("validation")).collect();
    let (with, without): (Vec<f64>, Vec<f64>) = (psnr(&found), psnr(&plain));
    println!("moments held out: {with:.2?} dB with a deformation, {without:.2?} dB without");
    assert!(with[0] > 28.0, "before the first step: {with:.2?}");
    assert!(with[0] > without[1] + 3.0 && with[1] > with[0], "better than without: {with:.2?}, {without:.2?}");
    let scene = blobs();
    for view in &found.drawn {
        let wanted = reference::render(&scene, &view.camera.view(view.time, RasterFov::Corrected), Background::None);
        let image = view.load_covered().expect("its image was drawn");
        let mut error = SquaredError::default();
        error.add(&image.over(Vec3::ZERO), &wanted.picture.clamped()).expect("pictures of one size");
        let psnr = error.psnr();
        assert!(psnr > 22.0, "{} at {} has {psnr:.2} dB to what was there", view.name, view.time);
    }
}

#[test]
fn a_deformation_repeats_and_resumes_at_the_same_bytes() {
    let film = Film::new();
    let Some(first) = film.train(60, "first") else { return };
    let images = |capture: &TrainedCapture| -> Vec<Vec<u8>> {
        capture.drawn.iter().map(|view| fs::read(&view.image).expect("its image was drawn")).collect()
    };
    let kept = images(&first);
    let other = film.train(60, "other").expect("a GPU");
    assert_eq!(images(&other), kept, "another run draws the same images");
    assert_eq!(other.tuned.scene, first.tuned.scene, "and trains the same capture");
    // The store has the result of the deformation, but no state of training, as if it had been killed then.
    let folder = film.folder.path().join("first.train");
    let written =
        |name: &str| fs::metadata(folder.join(name)).and_then(|file| file.modified()).expect("a stored result");
    let before = ["start", "drawn"].map(written);
    let resumed = film.train(60, "first").expect("a GPU");
    assert_eq!(["start", "drawn"].map(written), before, "the deformation is not trained again");
    assert_eq!(resumed.tuned.scene, first.tuned.scene, "the same capture");
}

#[test]
fn a_bake_draws_the_views_again_if_an_image_of_one_is_missing() {
    let film = Film::new();
    let Some(headless) = gpu::headless() else { return };
    let mut engine = Engine::Gpu(Box::new(headless));
    let (settings, out) = (film.settings(20), film.folder.path().join("capture.gs4d"));
    let mut train = |only: Option<&str>| {
        train_dataset(&settings, &out, only, &mut engine, &mut NoProgress).map_err(|error| error.to_string())
    };
    let (first, drawn) = train(None).expect("the capture is trained");
    let times = || {
        let modified = |view: &TrainingView| fs::metadata(&view.image).and_then(|file| file.modified());
        drawn.iter().map(|view| modified(view).expect("its image was drawn")).collect::<Vec<_>>()
    };
    let before = times();
    assert_eq!(train(None).expect("it was trained before").1, drawn, "the same views");
    assert_eq!(times(), before, "which are not drawn again");
    fs::remove_file(&drawn[0].image).expect("it was drawn");
    let error = train(Some("score")).expect_err("a view is missing");
    assert!(error.contains("run --only train before"), "another stage says what to do: {error}");
    let (again, views) = train(None).expect("the capture is trained again");
    assert_eq!((views, times().len()), (drawn.clone(), drawn.len()), "all views are there again");
    assert_eq!(again, first, "and the capture is the same");
}
