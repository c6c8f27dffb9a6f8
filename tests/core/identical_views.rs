//! Choosing a number of Gaussians if some views are reproduced exactly.
//!
//! In: a synthetic scene, twenty noisy images of it, and four views of the background alone, whose images the scene
//! reproduces exactly. Out: proof that the PSNR of the comparison is finite and that the four views do not change the
//! chosen number.

use bevy_gs4d::internal::offline::dataset::to_draw;
use bevy_gs4d::internal::offline::measure::ReferencePictures;
use bevy_gs4d::internal::offline::prune::{highest, select, smallest_count};
use bevy_gs4d::offline::dataset::{CameraFile, CameraOptions, TrainingView};
use bevy_gs4d::offline::engine::Engine;
use bevy_gs4d::offline::measure::MAX_PSNR;
use bevy_gs4d::offline::work::NoProgress;
use bevy_gs4d::reference;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Background, Camera, RasterFov};
use glam::{Mat4, UVec2, Vec3, Vec4};
use serde_json::json;
use std::fs;
use tempfile::TempDir;

const COUNT: usize = 500;
const VIEWS: usize = 20;
const EMPTY_VIEWS: usize = 4;
const SIZE: UVec2 = UVec2::new(48, 40);
const FOV: f32 = 0.8;

/// A scene, the scores of its Gaussians, and its views: first the views of the scene, then the views of the background
/// alone.
struct Setup {
    scene: GaussianScene,
    runtime: RuntimeScene,
    scores: Vec<f32>,
    views: Vec<TrainingView>,
    /// The images, which are read when they become reference pictures.
    _folder: TempDir,
}

impl Setup {
    /// Draws the images over `background`, which must be a color of 8 bits.
    fn new(background: [f32; 3]) -> Self {
        let scene = synthesize(&SynthSettings { count: COUNT, seed: 5, ..SynthSettings::default() });
        let runtime = scene.clone().into_runtime().expect("a synthetic scene can be drawn");
        let scores = runtime.iter().map(|gaussian| gaussian.opacity).collect();
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut frames = Vec::new();
        for index in 0..VIEWS + EMPTY_VIEWS {
            let (angle, time) = (index as f32 * 2.0, index as f32 / (VIEWS + EMPTY_VIEWS) as f32);
            let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.2);
            let target = if index < VIEWS { Vec3::Z * 0.1 } else { eye * 2.0 };
            let camera = Camera::look_at(eye, target, Vec3::Z, FOV, SIZE);
            let view = camera.view(time, RasterFov::Reference);
            let mut picture = reference::render(&runtime, &view, Background::Color(background)).picture;
            if index < VIEWS {
                // Noise, so that the scene does not reproduce the image exactly.
                for (place, pixel) in picture.pixels.iter_mut().enumerate() {
                    *pixel += ((place * 37 + index * 11) % 21) as f32 / 255.0 - 10.0 / 255.0;
                }
            }
            let name = format!("r_{index:02}.png");
            picture.to_rgb8().save(folder.path().join(&name)).expect("the folder can be written to");
            let flip = Mat4::from_diagonal(Vec4::new(1.0, -1.0, -1.0, 1.0));
            let pose = (camera.world_to_camera.inverse() * flip).transpose().to_cols_array_2d();
            frames.push(json!({ "file_path": name, "time": time, "transform_matrix": pose }));
        }
        let cameras = json!({ "camera_angle_x": FOV, "w": SIZE.x, "h": SIZE.y, "frames": frames });
        let path = folder.path().join("transforms_train.json");
        fs::write(&path, cameras.to_string()).expect("the folder can be written to");
        let views = CameraFile::load(&path, &CameraOptions::default()).expect("a valid camera file");
        Self { scene, runtime, scores, views, _folder: folder }
    }

    /// Returns the smallest count whose PSNR is at most `loss` dB below that of the whole scene, and the PSNR of the
    /// whole scene.
    fn choose(&self, references: &ReferencePictures, loss: f64) -> (usize, f64) {
        let baseline = references.psnr(&mut Engine::Cpu, &self.runtime).expect("the scene can be drawn");
        let psnr = |count| {
            let pruned = select(&self.scene, &highest(&self.scores, count));
            references.psnr(&mut Engine::Cpu, &pruned.into_runtime().expect("a part of the scene can be drawn"))
        };
        let (count, trials) = smallest_count(COUNT, 1, baseline - loss, psnr).expect("the scene can be drawn");
        assert!(baseline.is_finite() && trials.iter().all(|trial| trial.psnr.is_finite()), "{baseline}: {trials:?}");
        (count, baseline)
    }
}

#[test]
fn views_that_are_reproduced_exactly_do_not_change_the_chosen_number() {
    // 51, 102 and 153 of 255 are drawn as they are stored.
    for background in [[0.0; 3], [0.2, 0.4, 0.6]] {
        let setup = Setup::new(background);
        let color = Background::Color(background);
        let trained = &setup.scene.trained_with;
        let references = |views: &[TrainingView]| ReferencePictures::of_images(views, trained, color).expect("images");
        let (seen, empty) = setup.views.split_at(VIEWS);
        let alone = references(empty).psnr(&mut Engine::Cpu, &setup.runtime).expect("the scene can be drawn");
        assert_eq!(alone, MAX_PSNR, "the last views are reproduced exactly");
        for loss in [0.1, 1.0, 6.0] {
            let (without, psnr) = setup.choose(&references(seen), loss);
            let (with, psnr_of_all) = setup.choose(&references(&setup.views), loss);
            assert!((10..COUNT).contains(&without), "some Gaussians are left out: {without}");
            let apart = with.abs_diff(without) as f64 / without as f64;
            assert!(
                apart <= 0.05,
                "{with} Gaussians with all views, {without} without the exact views, within {loss} dB"
            );
            let more = 10.0 * ((VIEWS + EMPTY_VIEWS) as f64 / VIEWS as f64).log10();
            assert!((psnr_of_all - psnr - more).abs() < 1e-6, "the error is spread over more pixels: {psnr_of_all}");
        }
    }
}

#[test]
fn a_scene_that_reproduces_every_view_has_a_finite_psnr() {
    let setup = Setup::new([0.0; 3]);
    let (background, views) = (Background::Color([0.0; 3]), to_draw(&setup.views, setup.runtime.trained_with.optics()));
    let references = ReferencePictures::of_scene(&mut Engine::Cpu, &setup.runtime, views, background, &mut NoProgress);
    let (count, psnr) = setup.choose(&references.expect("the scene can be drawn"), 150.0);
    assert_eq!(psnr, MAX_PSNR, "the scene is compared with its own pictures");
    assert!((1..COUNT).contains(&count), "a loss of 150 dB from the cap allows fewer: {count}");
}
