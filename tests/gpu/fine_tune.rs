//! The passes of training against the original's gradients and their CPU references.
//!
//! In: the golden scenes with their gradients; synthetic scenes. Out: proof that gradients, loss and optimizer are right, and that training
//! lowers the loss. Skipped where there is no GPU.

use crate::support::{golden, gpu};
use bevy_gs4d::gaussian::{GradientMode, Harmonics, Parameters};
use bevy_gs4d::offline::dataset::CoveredImage;
use bevy_gs4d::offline::fine_tune::{GpuImage, Moments, Rates, Sample, Trainer, adam, loss};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, SceneForm, Trained};
use bevy_gs4d::view::{Background, Camera, RasterFov, View};
use glam::{UVec2, Vec3};
use serde_json::{Value, json};

/// Returns the tensors of a scene or its gradients, each as one list, by name.
fn tensors(parameters: &Parameters, harmonics: &Harmonics) -> Vec<(&'static str, Vec<f32>)> {
    vec![
        ("mean", parameters.mean.as_flattened().to_vec()),
        ("mean_t", parameters.mean_t.clone()),
        ("log_scale", parameters.log_scale.as_flattened().to_vec()),
        ("log_scale_t", parameters.log_scale_t.clone()),
        ("rotation_l", parameters.rotation_l.as_flattened().to_vec()),
        ("rotation_r", parameters.rotation_r.as_flattened().to_vec()),
        ("opacity_logit", parameters.opacity_logit.clone()),
        ("harmonics", harmonics.values.clone()),
    ]
}

/// Returns the norm of the difference relative to that of the expected values, or the norm itself if these are zero.
fn relative_error(found: &[f32], expected: &[f32]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let error = norm(&mut found.iter().zip(expected).map(|(a, b)| f64::from(*a) - f64::from(*b)));
    let size = norm(&mut expected.iter().map(|v| f64::from(*v)));
    if size > 0.0 { error / size } else { error }
}

fn trained(scene: &GaussianScene) -> &Trained {
    let SceneForm::Trained(trained) = &scene.form else { panic!("the trained form") };
    trained
}

#[test]
fn gradients_are_those_of_the_original() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut compared = 0;
    for golden in golden::all_views() {
        let (scene_name, view_name) = golden.name.split_once('/').expect("scene and view");
        let folder = golden::folder().join(scene_name);
        let Ok(text) = std::fs::read_to_string(folder.join(format!("{view_name}.grad.json"))) else { continue };
        let expected: Value = serde_json::from_str(&text).expect("JSON");
        let json: Value =
            serde_json::from_str(&std::fs::read_to_string(folder.join("scene.json")).expect("scene.json"))
                .expect("JSON");
        let (parameters, harmonics) = golden::raw_scene(&json);
        let degrees = golden.scene.form.color_degrees();
        let harmonics = Harmonics { degree: degrees.degree, degree_t: degrees.degree_t, ..harmonics };
        let scene = GaussianScene {
            form: SceneForm::Trained(Trained { parameters, harmonics }),
            environment: golden.scene.environment.clone(),
            filter: None,
            trained_with: golden.scene.trained_with.clone(),
            playback: golden.scene.playback,
        };
        let weights = |key: &str| golden::floats(&folder.join(expected[key].as_str().expect("a file")));
        let (color, depth, alpha) = (weights("w_color"), weights("w_depth"), weights("w_alpha"));
        let count = alpha.len();
        let pixels: Vec<[f32; 4]> =
            (0..count).map(|i| [color[i], color[count + i], color[2 * count + i], alpha[i]]).collect();
        for (mode, name) in [(GradientMode::Exact, "exact"), (GradientMode::Compat, "compat")] {
            let mut trainer = Trainer::new(&mut headless, scene.clone(), mode).expect("the scene can be trained");
            trainer.accumulate_pixels(&golden.view, golden.background, &pixels, &depth).expect("the picture fits");
            let gradients = trainer.gradients().expect("they can be read");
            let found = trained(&gradients);
            let (parameters, harmonics) = golden::raw_scene(&json!({ "raw": expected[name]["raw"] }));
            let expected = tensors(&parameters, &harmonics);
            for ((tensor, found), (_, expected)) in tensors(&found.parameters, &found.harmonics).iter().zip(&expected) {
                let error = relative_error(found, expected);
                println!("{:28} {name:7} {tensor:14} {error:.1e}", golden.name);
                assert_eq!(found.len(), expected.len(), "{}: {tensor}", golden.name);
                assert!(error <= 1e-3, "{}, {name}: {tensor} differs by {error:.1e}", golden.name);
                compared += 1;
            }
            assert_eq!(trainer.faults().expect("they can be read"), None, "every gradient is finite");
        }
    }
    assert_eq!(compared, 2 * 5 * 8, "five views have gradients");
}

/// A trained scene of a few hundred Gaussians, views of it, and its own pictures as their images.
struct Lesson {
    scene: GaussianScene,
    views: Vec<View>,
    images: Vec<CoveredImage>,
}

impl Lesson {
    fn new(headless: &mut Headless) -> Self {
        let scene = synthesize(&SynthSettings { count: 400, ..SynthSettings::default() });
        let capture = headless.upload(&scene.clone().into_runtime().expect("it can be drawn")).expect("it fits");
        let size = UVec2::new(70, 54);
        let view = |i: usize| {
            let angle = i as f32 * 0.7;
            let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.2);
            Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, size).view(i as f32 / 6.0, RasterFov::Reference)
        };
        let views: Vec<View> = (0..6).map(view).collect();
        let mut image = |view: &View| {
            let frame = headless.render(&capture, view, Background::Color(BEHIND)).expect("it is drawn");
            let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
            let texel = |pixel: &Vec3| [byte(pixel.x), byte(pixel.y), byte(pixel.z), 255];
            CoveredImage { size, texels: frame.picture.pixels.iter().map(texel).collect(), has_gaps: false }
        };
        let images = views.iter().map(&mut image).collect();
        Self { scene, views, images }
    }

    /// Returns the scene with every parameter moved a little.
    fn disturbed(&self) -> GaussianScene {
        let mut scene = self.scene.clone();
        let SceneForm::Trained(Trained { parameters, harmonics }) = &mut scene.form else { panic!("the trained form") };
        let attributes = [
            parameters.mean.as_flattened_mut(),
            parameters.log_scale.as_flattened_mut(),
            parameters.log_scale_t.as_mut_slice(),
            parameters.opacity_logit.as_mut_slice(),
            harmonics.values.as_mut_slice(),
        ];
        for (values, amount) in attributes.into_iter().zip([0.02, 0.2, 0.2, 0.5, 0.1]) {
            for (i, value) in values.iter_mut().enumerate() {
                *value += amount * ((i * 37 % 64) as f32 / 32.0 - 1.0);
            }
        }
        scene
    }

    fn upload(&self, trainer: &Trainer<'_>) -> Vec<GpuImage> {
        self.images.iter().map(|image| trainer.upload(image).expect("it fits")).collect()
    }

    fn sample<'a>(&'a self, images: &'a [GpuImage], index: usize) -> Sample<'a> {
        Sample {
            view: &self.views[index],
            image: &images[index],
            background: Background::Color(BEHIND),
            number: index as u32,
        }
    }
}

const BEHIND: [f32; 3] = [0.2, 0.1, 0.4];

#[test]
fn the_loss_and_its_gradient_are_those_of_the_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut trainer = Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("it can be trained");
    // A hole in the image shows the background.
    let mut image = lesson.images[0].clone();
    image.texels[500..560].fill([20, 10, 5, 100]);
    let images = [trainer.upload(&image).expect("it fits")];
    let sample = lesson.sample(&images, 0);
    trainer.accumulate(&[sample], 0.2).expect("it is drawn");
    let found = trainer.gradients().expect("they can be read");
    let totals = trainer.totals().expect("they can be read");
    let picture = trainer.draw(&lesson.views[0], Background::Color(BEHIND)).expect("it is drawn").picture;
    let expected = loss(&picture, &image.over(Vec3::from(BEHIND)), 0.2).expect("the same size");
    assert!((totals.loss - expected.value).abs() < 1e-6, "loss {} is {}", totals.loss, expected.value);
    assert_eq!(totals.views, 1, "of one view");
    let pixels: Vec<[f32; 4]> = expected.gradient.iter().map(|g| [g.x, g.y, g.z, 0.0]).collect();
    let scene = trainer.scene().expect("it can be read");
    let mut other = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("it can be trained");
    let depths = vec![0.0; pixels.len()];
    other.accumulate_pixels(&lesson.views[0], Background::Color(BEHIND), &pixels, &depths).expect("it is drawn");
    let expected = other.gradients().expect("they can be read");
    let (found, expected) = (trained(&found), trained(&expected));
    let pairs = tensors(&found.parameters, &found.harmonics).into_iter();
    for ((name, found), (_, expected)) in pairs.zip(tensors(&expected.parameters, &expected.harmonics)) {
        let error = relative_error(&found, &expected);
        assert!(error < 1e-3, "{name} differs by {error:.1e}");
    }
}

#[test]
fn a_step_is_that_of_the_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut trainer = Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("it can be trained");
    let rates = Rates { mean: 0.01, mean_t: 0.02, ..Rates::ORIGINAL };
    let expected_rates = [
        ("mean", rates.mean),
        ("mean_t", rates.mean_t),
        ("log_scale", rates.scale),
        ("log_scale_t", rates.scale),
        ("rotation_l", rates.rotation),
        ("rotation_r", rates.rotation),
        ("opacity_logit", rates.opacity),
    ];
    let read = |scene: &GaussianScene| tensors(&trained(scene).parameters, &trained(scene).harmonics);
    let images = lesson.upload(&trainer);
    let mut moments: Vec<Vec<Moments>> = Vec::new();
    for step in 1..=3 {
        trainer
            .accumulate(&[lesson.sample(&images, step), lesson.sample(&images, step + 1)], 0.2)
            .expect("they are drawn");
        let before = read(&trainer.scene().expect("it can be read"));
        let gradients = read(&trainer.gradients().expect("they can be read"));
        trainer.step(&rates, 0.5, step).expect("it is made");
        let after = read(&trainer.scene().expect("it can be read"));
        for (k, (name, before)) in before.iter().enumerate() {
            if moments.len() <= k {
                moments.push(vec![Moments::default(); before.len()]);
            }
            let coefficients = before.len() / 400;
            for (i, &value) in before.iter().enumerate() {
                let rate = match expected_rates.iter().find(|(known, _)| known == name) {
                    Some((_, rate)) => *rate,
                    None if i % coefficients < 3 => rates.color,
                    None => rates.harmonics,
                };
                let gradient = f64::from(gradients[k].1[i]);
                let expected = adam(f64::from(value), gradient, &mut moments[k][i], 0.5 * rate, step);
                let found = f64::from(after[k].1[i]);
                // Tiny gradients lose digits in the square root.
                assert!(
                    (found - expected).abs() <= 2e-2 * rate + 1e-6 * expected.abs(),
                    "{name} {i}: {found} is {expected}"
                );
            }
        }
        let left = read(&trainer.gradients().expect("they can be read"));
        assert!(left.iter().all(|(_, values)| values.iter().all(|&v| v == 0.0)), "gradients begin anew");
    }
}

#[test]
fn fifty_steps_halve_the_loss_and_a_resumed_run_ends_as_an_uninterrupted_one() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut train = |pause: Option<usize>| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("it can be trained");
        let rates = Rates { mean: 2e-3, mean_t: 1e-3, harmonics: 2.5e-3, color: 1e-2, ..Rates::OURS };
        let images = lesson.upload(&trainer);
        let mut losses = Vec::new();
        for step in 0..50 {
            if pause == Some(step) {
                let (state, scene) = (trainer.state().expect("it can be read"), lesson.disturbed());
                trainer = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("it can be trained");
                assert!(trainer.resume(&state), "the state is of as many Gaussians");
            }
            trainer
                .accumulate(&[lesson.sample(&images, step % 6), lesson.sample(&images, (step + 3) % 6)], 0.2)
                .expect("they are drawn");
            trainer.step(&rates, 1.0, step + 1).expect("it is made");
            losses.push(trainer.totals().expect("they can be read").loss);
        }
        assert_eq!(trainer.faults().expect("they can be read"), None, "every gradient is finite");
        (trainer.scene().expect("it can be read"), losses)
    };
    let (scene, losses) = train(None);
    let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
    let (first, last) = (mean(&losses[..6]), mean(&losses[44..]));
    assert!(last < 0.5 * first, "the loss falls from {first:.4} to {last:.4}");
    assert!(scene == train(Some(23)).0, "to the bit");
}

#[test]
fn gradients_that_are_not_finite_are_left_out_and_reported() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut trainer =
        Trainer::new(&mut headless, lesson.scene.clone(), GradientMode::Exact).expect("it can be trained");
    let count = 70 * 54;
    let mut pixels = vec![[1e-3; 4]; count];
    pixels[27 * 70 + 35] = [f32::NAN; 4];
    let depths = vec![0.0; count];
    trainer.accumulate_pixels(&lesson.views[0], Background::None, &pixels, &depths).expect("it is drawn");
    let faults = trainer.faults().expect("they can be read").expect("there are some");
    assert!(faults.count >= 1 && faults.gaussian < 400, "{faults:?}");
    trainer.step(&Rates::OURS, 1.0, 1).expect("it is made");
    let scene = trainer.scene().expect("it can be read");
    let all = tensors(&trained(&scene).parameters, &trained(&scene).harmonics);
    assert!(all.iter().all(|(_, values)| values.iter().all(|value| value.is_finite())), "nothing is lost");
    assert_ne!(scene, lesson.scene, "the others are trained");
}
