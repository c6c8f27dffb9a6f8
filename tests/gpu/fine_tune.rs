//! The passes of training against the gradients of the original and against their CPU references.
//!
//! In: the golden scenes with their gradients; synthetic scenes. Out: proof that gradients, loss and optimizer are
//! right, and that training lowers the loss. Skipped where there is no GPU.

use crate::support::trained::{trained, trained_mut};
use crate::support::training::{add_terms, round};
use crate::support::{golden, gpu};
use bevy_gs4d::gaussian::{GradientMode, Harmonics, Parameters, SliceSettings};
use bevy_gs4d::internal::gaussian::ParameterGradient;
use bevy_gs4d::internal::offline::train::{
    Exposure, GpuImage, IDENTITY, Moments, NEIGHBORS, Request, STEPS_IN_FLIGHT, Sample, Step, Trainer, center, exposed,
    exposure_backward, opacity_mask, pull, regularization,
};
use bevy_gs4d::internal::offline::train::{adam, environment_backward, loss, neighbors};
use bevy_gs4d::internal::reference::{PixelGradients, gradients};
use bevy_gs4d::internal::scene::Bits;
use bevy_gs4d::offline::compress::{CompressSettings, Quality, compress};
use bevy_gs4d::offline::dataset::CoveredImage;
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::offline::train::{FineTuneSettings, Rates, Terms};
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{Environment, GaussianScene, SceneForm, Trained};
use bevy_gs4d::view::{Background, Camera, Frame, Picture, RasterFov, View};
use glam::{UVec2, Vec3};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// Returns the norm of the difference relative to the norm of the expected values, or the norm of the difference if
/// these are zero.
fn relative_error(found: &[f32], expected: &[f32]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let error = norm(&mut found.iter().zip(expected).map(|(a, b)| f64::from(*a) - f64::from(*b)));
    let size = norm(&mut expected.iter().map(|v| f64::from(*v)));
    if size > 0.0 { error / size } else { error }
}

#[test]
fn gradients_match_the_original() {
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
            levels: Vec::new(),
            sockets: Vec::new(),
            colliders: None,
            sound: None,
            chunks: None,
        };
        let weights = |key: &str| golden::floats(&folder.join(expected[key].as_str().expect("a file")));
        let (color, depth, alpha) = (weights("w_color"), weights("w_depth"), weights("w_alpha"));
        let count = alpha.len();
        let pixels: Vec<[f32; 4]> =
            (0..count).map(|i| [color[i], color[count + i], color[2 * count + i], alpha[i]]).collect();
        for (mode, name) in [(GradientMode::Exact, "exact"), (GradientMode::Compat, "compat")] {
            let mut trainer = Trainer::new(&mut headless, scene.clone(), mode).expect("the scene can be trained");
            trainer.accumulate_pixels(&golden.view, golden.background, &pixels, &depth).expect("the picture fits");
            let gradients = trainer.gradients().expect("gradients can be read");
            let found = trained(&gradients);
            let (parameters, harmonics) = golden::raw_scene(&json!({ "raw": expected[name]["raw"] }));
            let expected = tensors(&parameters, &harmonics);
            for ((tensor, found), (_, expected)) in tensors(&found.parameters, &found.harmonics).iter().zip(&expected) {
                let error = relative_error(found, expected);
                println!("{:28} {name:7} {tensor:14} {error:.1e}", golden.name);
                assert_eq!(found.len(), expected.len(), "{}: {tensor}", golden.name);
                // Sums over an environment map lose more digits; so do sums over the times of static captures, which
                // nearly cancel.
                let limit = match (tensor, golden.scene.environment.is_some()) {
                    (_, true) => 5e-4,
                    (&"mean_t", false) => 1e-3,
                    _ => 1e-4,
                };
                assert!(error <= limit, "{}, {name}: {tensor} differs by {error:.1e}", golden.name);
                compared += 1;
            }
            assert_eq!(trainer.faults().expect("faults can be read"), None, "every gradient is finite");
        }
    }
    assert_eq!(compared, 2 * 5 * 8, "five views have gradients");
}

#[test]
fn the_gradient_of_the_environment_map_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let Lesson { scene, views, .. } = Lesson::new(&mut headless);
    let random = |i: usize, seed: usize| ((i * seed + seed) % 61) as f32 / 61.0;
    let map = Environment { width: 24, height: 12, texels: (0..3 * 24 * 12).map(|i| random(i, 17)).collect() };
    let scene = GaussianScene { environment: Some(map.clone()), ..scene };
    let capture = headless.upload(&scene.clone().into_runtime().expect("the scene can be drawn")).expect("it fits");
    let mut expected = vec![0.0; map.texels.len()];
    let mut lessons = Vec::new();
    for view in &views[..3] {
        let frame = headless.render(&capture, view, Background::Environment).expect("the view is drawn");
        let pixels: Vec<Vec3> = (0..frame.transmittance.len())
            .map(|i| Vec3::new(random(i, 7), -random(i, 11), random(i, 13)) * 0.01)
            .collect();
        for (sum, own) in expected.iter_mut().zip(environment_backward(&map, view, &frame.transmittance, &pixels)) {
            *sum += own;
        }
        lessons.push((view, pixels));
    }
    let found: Vec<Vec<f32>> = (0..2)
        .map(|_| {
            let mut trainer =
                Trainer::new(&mut headless, scene.clone(), GradientMode::Exact).expect("it can be trained");
            for (view, pixels) in &lessons {
                let pixels: Vec<[f32; 4]> = pixels.iter().map(|pixel| [pixel.x, pixel.y, pixel.z, 0.0]).collect();
                let depths = vec![0.0; pixels.len()];
                trainer.accumulate_pixels(view, Background::Environment, &pixels, &depths).expect("the picture fits");
            }
            trainer.gradients().expect("gradients can be read").environment.expect("a map").texels
        })
        .collect();
    let expected: Vec<f32> = expected.into_iter().map(|value| value as f32).collect();
    let error = relative_error(&found[0], &expected);
    assert!(expected.iter().any(|&value| value.abs() > 1e-3), "the map is seen");
    // Texel coordinates depend on the inverse trigonometric functions of the driver, as in the golden views over a map.
    assert!(error < 1e-3, "the gradient differs by {error:.1e}");
    assert_eq!(found[0], found[1], "the sums are the same on every run");
}

#[test]
fn exposures_are_trained_as_in_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let map = Environment { width: 4, height: 2, texels: (0..24).map(|i| i as f32 / 24.0).collect() };
    let around = GaussianScene { environment: Some(map), ..lesson.disturbed() };
    let exposures: [Exposure; 2] =
        [[[1.2, 0.05, -0.02, 0.03], [0.01, 0.8, 0.04, -0.02], [-0.03, 0.02, 1.1, 0.05]], IDENTITY];
    for (scene, background) in [(lesson.disturbed(), Background::Color(BEHIND)), (around, Background::Environment)] {
        let behind = (background != Background::Environment).then(|| Vec3::from(BEHIND));
        let mut trainer =
            Trainer::new(&mut headless, scene.clone(), GradientMode::Exact).expect("the scene can be trained");
        // Views 0 and 2 are of one camera, view 1 of another.
        let settings = FineTuneSettings { exposure: true, ..FineTuneSettings::default() };
        let request = Request { cameras: &[0, 1, 0], ..Request::of(&settings) };
        trainer.prepare(&request).expect("the shader compiles");
        let mut state = trainer.state().expect("the state can be read");
        let place = state.buffers.len() - 3;
        state.buffers[place] = bytemuck::cast_slice(&exposures).to_vec();
        assert!(trainer.resume(&state), "the exposures are part of the state");
        assert_eq!(trainer.exposures().expect("exposures can be read"), exposures, "they are those of the state");
        let images = lesson.upload(&trainer);
        let samples = [0, 1, 2].map(|index| Sample { background, ..lesson.sample(&images, index) });
        trainer.accumulate(&samples, 0.2).expect("the views are drawn");
        let found = trainer.exposure_gradients().expect("gradients can be read");
        let (gradients, totals) = (trainer.gradients().expect("they can be read"), trainer.totals().expect("also"));
        let mut expected = [[[0.0f64; 4]; 3]; 2];
        let (mut value, mut pixels) = (0.0, Vec::new());
        for (index, camera) in [(0, 0), (1, 1), (2, 0)] {
            let frame = trainer.draw(&lesson.views[index], background).expect("the view is drawn");
            let image = lesson.images[index].over(behind.unwrap_or_default());
            let loss = loss(&exposed(&frame, &exposures[camera], behind), &image, 0.2).expect("the same size");
            let own = exposure_backward(&frame, &exposures[camera], behind, &loss.gradient);
            let terms = own.exposure.as_flattened().iter().zip(pull(&exposures[camera]).1.as_flattened().to_vec());
            for (sum, (gradient, pulled)) in expected[camera].as_flattened_mut().iter_mut().zip(terms) {
                *sum += (gradient + pulled) / 3.0;
            }
            value += loss.value / 3.0;
            pixels.push(own.pixels.iter().map(|pixel| pixel.map(|value| value / 3.0)).collect::<Vec<_>>());
        }
        assert!((totals.loss - value).abs() < 1e-5, "the loss is {}, expected {value}", totals.loss);
        let flat = |values: &[[f32; 4]]| values.as_flattened().to_vec();
        let expected_by_camera = expected.map(|rows| rows.map(|row| row.map(|value| value as f32)));
        for (camera, (found, expected)) in found.iter().zip(&expected_by_camera).enumerate() {
            let error = relative_error(&flat(found), &flat(expected));
            assert!(error < 1e-3, "{background:?}: the gradient of exposure {camera} differs by {error:.1e}");
        }
        // A step, after which the mean of the exposures is the identity.
        trainer.step(&Rates { exposure: 0.01, ..Rates::ORIGINAL }, 0.5, 1).expect("the step succeeds");
        let after = trainer.exposures().expect("exposures can be read");
        let mut stepped = exposures;
        for (exposure, gradient) in stepped.iter_mut().zip(&found) {
            for (own, &gradient) in exposure.as_flattened_mut().iter_mut().zip(gradient.as_flattened()) {
                *own = adam(f64::from(*own), f64::from(gradient), &mut Moments::default(), 0.005, 1) as f32;
            }
        }
        center(&mut stepped);
        let error = relative_error(&flat(after.as_flattened()), &flat(stepped.as_flattened()));
        assert!(error < 1e-5, "{background:?}: the step differs by {error:.1e}");
        // The gradients of the Gaussians are those of the drawn picture.
        let mut other = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
        for (view, pixels) in lesson.views.iter().zip(&pixels) {
            let depths = vec![0.0; pixels.len()];
            other.accumulate_pixels(view, background, pixels, &depths).expect("the view is drawn");
        }
        let expected = other.gradients().expect("gradients can be read");
        let (found, expected) = (trained(&gradients), trained(&expected));
        let pairs = tensors(&found.parameters, &found.harmonics).into_iter();
        for ((name, found), (_, expected)) in pairs.zip(tensors(&expected.parameters, &expected.harmonics)) {
            let error = relative_error(&found, &expected);
            println!("{background:?} {name:14} {error:.1e}");
            assert!(error < 1e-3, "{background:?}: {name} differs by {error:.1e}");
        }
    }
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
        let capture = headless
            .upload(&scene.clone().into_runtime().expect("the scene can be drawn"))
            .expect("the scene fits the GPU");
        let size = UVec2::new(70, 54);
        let view = |i: usize| {
            let angle = i as f32 * 0.7;
            let eye = Vec3::new(2.4 * angle.cos(), 2.4 * angle.sin(), 1.2);
            Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.8, size).view(i as f32 / 6.0, RasterFov::Reference)
        };
        let views: Vec<View> = (0..6).map(view).collect();
        let mut image = |view: &View| {
            let frame = headless.render(&capture, view, Background::Color(BEHIND)).expect("the view is drawn");
            covered(&frame, 255)
        };
        let images = views.iter().map(&mut image).collect();
        Self { scene, views, images }
    }

    /// Returns the scene with every parameter moved a little.
    fn disturbed(&self) -> GaussianScene {
        let mut scene = self.scene.clone();
        let Trained { parameters, harmonics } = trained_mut(&mut scene);
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

    /// Returns the scene with Gaussians that all move, each with another velocity than its neighbors.
    fn moving(&self) -> GaussianScene {
        let mut scene = self.disturbed();
        let parameters = &mut trained_mut(&mut scene).parameters;
        for (i, rotation) in parameters.rotation_r.iter_mut().enumerate() {
            rotation[1] += 0.1 + 0.05 * ((i * 37 % 64) as f32 / 32.0 - 1.0);
        }
        scene
    }

    fn upload(&self, trainer: &Trainer<'_>) -> Vec<GpuImage> {
        self.images.iter().map(|image| trainer.upload(image).expect("the image fits the GPU")).collect()
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

/// Returns a drawn frame as an image with the coverage of the frame.
fn covered(frame: &Frame, coverage: u8) -> CoveredImage {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    let texel = |pixel: &Vec3| [byte(pixel.x), byte(pixel.y), byte(pixel.z), coverage];
    let texels = frame.picture.pixels.iter().map(texel).collect();
    CoveredImage { size: frame.picture.size, texels, has_gaps: coverage < 255 }
}

#[test]
fn gradients_through_the_filter_of_mip_splatting_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let Lesson { mut scene, views, .. } = Lesson::new(&mut headless);
    scene.trained_with.mip_filter = true;
    let parameters = &mut trained_mut(&mut scene).parameters;
    // Splats of about a pixel, of which the filter changes the opacity most.
    parameters.log_scale.as_flattened_mut().iter_mut().for_each(|scale| *scale -= 1.0);
    let runtime = scene.clone().into_runtime().expect("the scene can be drawn");
    let background = Background::Color(BEHIND);
    let count = views[0].size.element_product() as usize;
    let weight = |i: usize, seed: usize| ((i * seed) % 61) as f32 / 61.0 - 0.3;
    let pixels: Vec<[f32; 4]> = (0..count).map(|i| [7, 11, 13, 17].map(|seed| weight(i, seed))).collect();
    let color: Vec<Vec3> = pixels.iter().map(|&[r, g, b, _]| Vec3::new(r, g, b)).collect();
    let (depth, alpha) = (vec![0.0; count], pixels.iter().map(|pixel| pixel[3]).collect::<Vec<f32>>());
    let pixel_gradients = PixelGradients { color: &color, depth: &depth, alpha: &alpha };
    let expected = |view: &View| {
        let (trained, slice) = (trained(&scene), SliceSettings::default());
        let mode = GradientMode::Exact;
        as_parameters(&gradients(trained, &slice, &runtime, view, background, &pixel_gradients, mode))
    };
    let plain = views[0];
    let filtered = plain.with_optics(scene.trained_with.optics());
    let mut trainer = Trainer::new(&mut headless, scene.clone(), GradientMode::Exact).expect("it can be trained");
    trainer.accumulate_pixels(&filtered, background, &pixels, &depth).expect("the picture fits");
    let found = trainer.gradients().expect("gradients can be read");
    let none = Harmonics::default();
    let found = tensors(&trained(&found).parameters, &none);
    let [own, other] = [filtered, plain].map(|view| tensors(&expected(&view), &none));
    // Color is compared elsewhere.
    let geometry = found.iter().zip(&own).zip(&other).take(7);
    for (((name, found), (_, own)), (_, other)) in geometry {
        let [error, without] = [own, other].map(|expected| relative_error(found, expected));
        println!("{name:14} {error:.1e}, without the filter {without:.1e}");
        assert!(error < 1e-2, "{name} differs by {error:.1e}");
        assert!(without > 5e-2, "{name}: the filter changes the gradient: {without:.1e}");
    }
    assert_eq!(trainer.faults().expect("faults can be read"), None, "every gradient is finite");
}

#[test]
fn the_loss_and_its_gradient_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    // Holes in the image show the background, or are masked.
    let mut image = lesson.images[0].clone();
    image.texels[500..560].fill([20, 10, 5, 100]);
    image.texels[1800..1960].fill([0; 4]);
    for weight in [0.0, 0.3] {
        let scene = lesson.disturbed();
        let mut trainer = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
        add_terms(&mut trainer, Terms { mask: weight, ..Terms::default() }).expect("the weight is right");
        let images = [trainer.upload(&image).expect("the image fits the GPU")];
        let sample = lesson.sample(&images, 0);
        trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
        let found = trainer.gradients().expect("gradients can be read");
        let totals = trainer.totals().expect("totals can be read");
        let frame = trainer.draw(&lesson.views[0], Background::Color(BEHIND)).expect("the view is drawn");
        let expected = loss(&frame.picture, &image.over(Vec3::from(BEHIND)), 0.2).expect("the same size");
        let mask = opacity_mask(&frame, &image).expect("the same size");
        assert!(mask.value > 1e-3, "splats are drawn in the holes of the images: {}", mask.value);
        let value = expected.value + weight * mask.value;
        assert!(
            (totals.loss - value).abs() < 1e-6,
            "the loss is {}, expected {value} with a mask weight of {weight}",
            totals.loss
        );
        assert_eq!(totals.views, 1, "the loss of one view");
        let pixel = |(color, opacity): (&Vec3, &f32)| [color.x, color.y, color.z, weight as f32 * opacity];
        let pixels: Vec<[f32; 4]> = expected.gradient.iter().zip(&mask.gradient).map(pixel).collect();
        let scene = trainer.scene().expect("the scene can be read");
        let mut other = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
        let depths = vec![0.0; pixels.len()];
        other
            .accumulate_pixels(&lesson.views[0], Background::Color(BEHIND), &pixels, &depths)
            .expect("the view is drawn");
        let expected = other.gradients().expect("gradients can be read");
        let (found, expected) = (trained(&found), trained(&expected));
        let pairs = tensors(&found.parameters, &found.harmonics).into_iter();
        for ((name, found), (_, expected)) in pairs.zip(tensors(&expected.parameters, &expected.harmonics)) {
            let error = relative_error(&found, &expected);
            println!("mask {weight} {name:14} {error:.1e}");
            assert!(error < 1e-4, "{name} differs by {error:.1e} with a mask weight of {weight}");
        }
    }
}

#[test]
fn gradients_of_batches_add_up_and_each_view_has_its_share_of_its_batch() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut gradients = |batches: &[&[usize]]| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("the scene can be trained");
        let images = lesson.upload(&trainer);
        for batch in batches {
            let samples: Vec<Sample<'_>> = batch.iter().map(|&index| lesson.sample(&images, index)).collect();
            trainer.accumulate(&samples, 0.2).expect("the views are drawn");
        }
        let found = trainer.gradients().expect("gradients can be read");
        tensors(&trained(&found).parameters, &trained(&found).harmonics)
    };
    let whole = gradients(&[&[0, 1, 2, 3, 4, 5]]);
    // The optimizer hides a factor on all gradients, so the gradients themselves are compared.
    let divided: [(&[&[usize]], f32); 3] = [
        (&[&[0, 1, 2], &[3, 4, 5]], 2.0),
        (&[&[0, 1], &[2, 3], &[4, 5]], 3.0),
        (&[&[0], &[1], &[2], &[3], &[4], &[5]], 6.0),
    ];
    for (batches, factor) in divided {
        for ((name, found), (_, whole)) in gradients(batches).iter().zip(&whole) {
            let expected: Vec<f32> = whole.iter().map(|value| factor * value).collect();
            let error = relative_error(found, &expected);
            assert!(whole.iter().any(|&value| value != 0.0), "{name} has a gradient");
            assert!(error < 1e-4, "{batches:?}: {name} differs by {error:.1e} from {factor} times that of one batch");
        }
    }
}

#[test]
fn no_more_steps_are_in_flight_than_their_bound() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = Lesson::new(&mut headless).disturbed();
    // A picture that takes a software driver longer than the host takes to record a step.
    let camera = Camera::look_at(Vec3::new(2.4, 0.0, 1.2), Vec3::ZERO, Vec3::Z, 0.8, UVec2::new(320, 240));
    let (view, background) = (camera.view(0.5, RasterFov::Reference), Background::Color(BEHIND));
    let mut trainer = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
    let image = covered(&trainer.draw(&view, background).expect("the view is drawn"), 255);
    let image = trainer.upload(&image).expect("the image fits the GPU");
    let finished = Arc::new(AtomicUsize::new(0));
    for step in 1..=3 * STEPS_IN_FLIGHT {
        let sample = Sample { view: &view, image: &image, background, number: 0 };
        trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
        trainer.step(&Rates::OURS, 1.0, step).expect("the step succeeds");
        // The end of the step for which this one has waited has been reported.
        let in_flight = step - finished.load(Ordering::Relaxed);
        assert!(in_flight <= STEPS_IN_FLIGHT, "step {step}: {in_flight} steps are in flight");
        let finished = finished.clone();
        trainer.headless().context().queue.on_submitted_work_done(move || {
            finished.fetch_add(1, Ordering::Relaxed);
        });
    }
}

/// Returns gradients as parameters, in single precision.
fn as_parameters(gradients: &[ParameterGradient]) -> Parameters {
    fn each<T>(gradients: &[ParameterGradient], value: impl Fn(&ParameterGradient) -> T) -> Vec<T> {
        gradients.iter().map(value).collect()
    }
    fn single<const N: usize>(values: [f64; N]) -> [f32; N] {
        values.map(|value| value as f32)
    }
    Parameters {
        mean: each(gradients, |gradient| single(gradient.mean)),
        mean_t: each(gradients, |gradient| gradient.mean_t as f32),
        log_scale: each(gradients, |gradient| single(gradient.log_scale)),
        log_scale_t: each(gradients, |gradient| gradient.log_scale_t as f32),
        rotation_l: each(gradients, |gradient| single(gradient.rotation_l)),
        rotation_r: each(gradients, |gradient| single(gradient.rotation_r)),
        opacity_logit: each(gradients, |gradient| gradient.opacity_logit as f32),
    }
}

/// The terms of Gaussians, each with the weight of the other terms 0.
const TERMS: [(&str, [f64; 3]); 3] =
    [("motion", [0.7, 0.0, 0.0]), ("rigid", [0.0, 30.0, 0.0]), ("opacity", [0.0, 0.0, 0.5])];

fn terms([motion, rigid, opacity]: [f64; 3]) -> Terms {
    Terms { motion, rigid, opacity, ..Terms::default() }
}

#[test]
fn the_gradients_of_terms_match_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = Lesson::new(&mut headless).moving();
    let Trained { parameters, harmonics } = trained(&scene);
    let near = neighbors(&parameters.mean);
    for (term, weights) in TERMS {
        let terms = terms(weights);
        let mut trainer =
            Trainer::new(&mut headless, scene.clone(), GradientMode::Exact).expect("the scene can be trained");
        add_terms(&mut trainer, terms).expect("the weights are right");
        trainer.accumulate_terms(0).expect("the terms are added");
        let found = trainer.gradients().expect("gradients can be read");
        let expected = regularization(parameters, &near, &terms, 1.0).expect("the Gaussians can be drawn").gradients;
        let none = Harmonics { values: vec![0.0; harmonics.values.len()], ..harmonics.clone() };
        let expected = tensors(&as_parameters(&expected), &none);
        let moves = expected.iter().filter(|(_, values)| values.iter().any(|&value| value != 0.0)).count();
        assert_eq!(moves, if term == "opacity" { 1 } else { 4 }, "{term}: the number of tensors with a gradient");
        let found = tensors(&trained(&found).parameters, &trained(&found).harmonics);
        for ((name, found), (_, expected)) in found.iter().zip(&expected) {
            let error = relative_error(found, expected);
            println!("{term:8} {name:14} {error:.1e}");
            assert!(error <= 1e-5, "{term}: {name} differs by {error:.1e}");
        }
    }
}

#[test]
fn fifty_steps_lower_each_term() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    // The fraction of the term that may remain: a step changes each logit of opacity by at most 0.05.
    for ((term, weights), most) in TERMS.into_iter().zip([0.25, 0.25, 0.6]) {
        let mut trainer =
            Trainer::new(&mut headless, lesson.moving(), GradientMode::Exact).expect("the scene can be trained");
        let terms = terms(weights);
        add_terms(&mut trainer, terms).expect("the weights are right");
        let value = |trainer: &Trainer<'_>| {
            let scene = trainer.scene().expect("the scene can be read");
            let parameters = &trained(&scene).parameters;
            let found =
                regularization(parameters, &neighbors(&parameters.mean), &terms, 1.0).expect("they can be drawn");
            terms.motion * found.motion + terms.rigid * found.rigid + terms.opacity * found.opacity
        };
        let before = value(&trainer);
        for step in 0..50 {
            trainer.accumulate_terms(step).expect("the terms are added");
            trainer.step(&Rates::OURS, 1.0, step + 1).expect("the step succeeds");
        }
        let after = value(&trainer);
        assert!(after < most * before, "{term} falls from {before:.3e} to {after:.3e}");
    }
}

#[test]
fn the_mask_term_removes_splats_outside_the_images() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let black = Background::Color([0.0; 3]);
    let mut left_after = |weight: f64| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.scene.clone(), GradientMode::Exact).expect("the scene can be trained");
        add_terms(&mut trainer, Terms { mask: weight, ..Terms::default() }).expect("the weight is right");
        // The images are pictures of the scene itself: only the mask term has a gradient.
        let draw = |trainer: &mut Trainer<'_>, view: &View| trainer.draw(view, black).expect("the view is drawn");
        let images: Vec<CoveredImage> = lesson.views.iter().map(|view| covered(&draw(&mut trainer, view), 0)).collect();
        let value = |trainer: &mut Trainer<'_>| -> f64 {
            let pairs = lesson.views.iter().zip(&images);
            pairs.map(|(view, image)| opacity_mask(&draw(trainer, view), image).expect("the same size").value).sum()
        };
        let before = value(&mut trainer);
        let uploaded: Vec<GpuImage> =
            images.iter().map(|image| trainer.upload(image).expect("the image fits the GPU")).collect();
        for step in 0..50 {
            let index = step % 6;
            let (view, image) = (&lesson.views[index], &uploaded[index]);
            let sample = Sample { view, image, background: black, number: index as u32 };
            trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
            trainer.step(&Rates::OURS, 1.0, step + 1).expect("the step succeeds");
        }
        value(&mut trainer) / before
    };
    let (with, without) = (left_after(1.0), left_after(0.0));
    assert!(with < 0.6, "a fraction of {with:.3} remains outside the images, expected below 0.6");
    assert!(without > 0.7, "without a weight a fraction of {without:.3} remains, expected above 0.7");
}

#[test]
fn neighbors_are_part_of_the_state() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let terms = Terms { rigid: 30.0, search_every: 8, ..Terms::default() };
    let mut train = |pause: Option<usize>| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.moving(), GradientMode::Exact).expect("the scene can be trained");
        add_terms(&mut trainer, terms).expect("the weight is right");
        let rates = Rates { mean: 2e-3, ..Rates::OURS };
        let images = lesson.upload(&trainer);
        for step in 0..20 {
            if pause == Some(step) {
                let state = trainer.state().expect("the state can be read");
                assert_eq!(state.neighbors.len(), 400 * NEIGHBORS * 4, "the state has the neighbors of each Gaussian");
                trainer = Trainer::new(&mut headless, lesson.moving(), GradientMode::Exact)
                    .expect("the scene can be trained");
                add_terms(&mut trainer, terms).expect("the weight is right");
                assert!(trainer.resume(&state), "a state of the same number of Gaussians is accepted");
                assert!(trainer.state().expect("the state can be read") == state, "the state read back is unchanged");
                let mut wrong = state.clone();
                wrong.neighbors[..4].copy_from_slice(&400u32.to_le_bytes());
                assert!(!trainer.resume(&wrong), "a state with a neighbor 400 of 400 Gaussians is refused");
            }
            trainer.accumulate(&[lesson.sample(&images, step % 6)], 0.2).expect("the view is drawn");
            trainer.accumulate_terms(step).expect("the terms are added");
            trainer.step(&rates, 1.0, step + 1).expect("the step succeeds");
        }
        trainer.scene().expect("the scene can be read")
    };
    assert!(train(None) == train(Some(11)), "the resumed run ends at the same bits");
}

/// So few bits of geometry that every picture changes. Means have more bits: packing changes the order of Gaussians at
/// exactly the same depth.
const COARSE: Bits =
    Bits { mean: 14, mean_t: 10, velocity: 6, sigma_t: 6, scale: 4, rotation: 4, opacity: 6, base: 8, escape: 0.02 };

/// Returns the pictures of a scene that is packed with these bits, with unchanged colors.
fn packed_pictures(headless: &mut Headless, scene: GaussianScene, views: &[View]) -> Vec<Picture> {
    let settings = CompressSettings {
        geometry: Some(COARSE),
        codebooks: Vec::new(),
        color_step: 0.0,
        ..CompressSettings::from(Quality::Lossless)
    };
    let (packed, _) =
        compress(scene.into_runtime().expect("the scene can be drawn"), &settings).expect("compression succeeds");
    let capture =
        headless.upload(&packed.into_runtime().expect("the scene can be drawn")).expect("the scene fits the GPU");
    let draw =
        |view: &View| headless.render(&capture, view, Background::Color(BEHIND)).expect("the view is drawn").picture;
    views.iter().map(draw).collect()
}

#[test]
fn rounded_geometry_is_drawn_as_in_the_packed_form() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let models: [(&str, fn(&mut Parameters)); 3] = [
        ("rotated", |_| {}),
        ("unrotated", |parameters| parameters.rotation_r.clear()),
        ("static", |parameters| {
            parameters.rotation_r.clear();
            parameters.mean_t.clear();
            parameters.log_scale_t.clear();
        }),
    ];
    for (model, change) in models {
        let mut scene = lesson.disturbed();
        let parameters = &mut trained_mut(&mut scene).parameters;
        change(parameters);
        let expected = packed_pictures(&mut headless, scene.clone(), &lesson.views);
        let mut trainer =
            Trainer::new(&mut headless, scene.clone(), GradientMode::Exact).expect("the scene can be trained");
        let far = |trainer: &mut Trainer<'_>| -> Vec<usize> {
            let apart = |(view, expected): (&View, &Picture)| {
                let found = trainer.draw(view, Background::Color(BEHIND)).expect("the view is drawn").picture;
                let pixels = found.pixels.iter().zip(&expected.pixels);
                pixels.filter(|(a, b)| (**a - **b).abs().max_element() > 1e-3).count()
            };
            lesson.views.iter().zip(&expected).map(apart).collect()
        };
        let before = far(&mut trainer);
        assert!(before.iter().sum::<usize>() > 400, "{model}: so few bits change more than 400 pixels: {before:?}");
        round(&mut trainer, COARSE, usize::MAX).expect("geometry can be packed");
        let after = far(&mut trainer);
        // Where float rounding decides whether a splat counts, a pixel may differ by more.
        assert!(after.iter().all(|&count| count <= 20), "{model}: at most 20 pixels of each picture differ: {after:?}");
        let kept = trainer.scene().expect("the scene can be read");
        assert_eq!(
            trained(&kept).parameters,
            trained(&scene).parameters,
            "{model}: the trained parameters are not rounded"
        );
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn training_on_rounded_geometry_raises_the_psnr_of_the_packed_scene() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let steps = 120;
    let mut quality_after = |rounding: bool| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.scene.clone(), GradientMode::Exact).expect("the scene can be trained");
        let rates = Rates { color: 1e-2, harmonics: 2.5e-3, ..Rates::OURS };
        let images = lesson.upload(&trainer);
        if rounding {
            round(&mut trainer, COARSE, 10).expect("geometry can be packed");
        }
        for step in 0..steps {
            let factor = 1.0 - 0.95 * step as f64 / steps as f64;
            trainer.begin_step(&Step::new(rates, factor, step + 1)).expect("geometry can be packed");
            trainer
                .accumulate(&[lesson.sample(&images, step % 6), lesson.sample(&images, (step + 3) % 6)], 0.2)
                .expect("the views are drawn");
            trainer.step(&rates, factor, step + 1).expect("the step succeeds");
        }
        assert_eq!(trainer.faults().expect("faults can be read"), None, "every gradient is finite");
        let scene = trainer.scene().expect("the scene can be read");
        let pictures = packed_pictures(&mut headless, scene, &lesson.views);
        let quality = |(picture, image): (&Picture, &CoveredImage)| {
            SquaredError::of(&picture.clamped(), &image.over(Vec3::from(BEHIND))).expect("the same size")
        };
        pictures.iter().zip(&lesson.images).map(quality).collect::<SquaredError>().psnr()
    };
    let (with, without) = (quality_after(true), quality_after(false));
    println!("packed: {with:.2} dB, {without:.2} dB without rounding in training");
    assert!(with > without + 0.1, "packed: {with:.2} dB, and {without:.2} dB without rounding in training");
}

#[test]
fn the_roundings_of_geometry_are_part_of_the_state() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut train = |pause: Option<usize>| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("the scene can be trained");
        let images = lesson.upload(&trainer);
        round(&mut trainer, COARSE, 8).expect("geometry can be packed");
        for step in 0..20 {
            if pause == Some(step) {
                let state = trainer.state().expect("the state can be read");
                trainer = Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact)
                    .expect("the scene can be trained");
                assert!(!trainer.resume(&state), "a state with roundings is refused before geometry is rounded");
                round(&mut trainer, COARSE, 8).expect("geometry can be packed");
                assert!(trainer.resume(&state), "a state of the same number of Gaussians is accepted");
                assert!(trainer.state().expect("the state can be read") == state, "the state read back is unchanged");
            }
            trainer.begin_step(&Step::new(Rates::OURS, 1.0, step + 1)).expect("geometry can be packed");
            trainer.accumulate(&[lesson.sample(&images, step % 6)], 0.2).expect("the view is drawn");
            trainer.step(&Rates::OURS, 1.0, step + 1).expect("the step succeeds");
        }
        trainer.scene().expect("the scene can be read")
    };
    assert!(train(None) == train(Some(11)), "the resumed run ends at the same bits");
}

#[test]
fn a_weight_that_is_not_a_number_is_refused() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut trainer =
        Trainer::new(&mut headless, lesson.scene.clone(), GradientMode::Exact).expect("the scene can be trained");
    for (name, weights) in [("motion", [f64::NAN, 0.0, 0.0]), ("rigid", [0.0, -1.0, 0.0])] {
        let refused = add_terms(&mut trainer, terms(weights)).expect_err("the weight is refused").to_string();
        assert!(refused.contains(name), "{name} is named: {refused}");
    }
}

#[test]
fn a_step_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut trainer =
        Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("the scene can be trained");
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
            .expect("the views are drawn");
        let before = read(&trainer.scene().expect("the scene can be read"));
        let gradients = read(&trainer.gradients().expect("gradients can be read"));
        trainer.step(&rates, 0.5, step).expect("the step succeeds");
        let after = read(&trainer.scene().expect("the scene can be read"));
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
                    "{name} {i}: {found}, expected {expected}"
                );
            }
        }
        let left = read(&trainer.gradients().expect("gradients can be read"));
        assert!(left.iter().all(|(_, values)| values.iter().all(|&v| v == 0.0)), "gradients are zero after the step");
    }
}

#[test]
fn fifty_steps_halve_the_loss_and_a_resumed_run_ends_as_an_uninterrupted_one() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut train = |pause: Option<usize>| {
        let mut trainer =
            Trainer::new(&mut headless, lesson.disturbed(), GradientMode::Exact).expect("the scene can be trained");
        let rates = Rates { mean: 2e-3, mean_t: 1e-3, harmonics: 2.5e-3, color: 1e-2, ..Rates::OURS };
        let images = lesson.upload(&trainer);
        let mut losses = Vec::new();
        for step in 0..50 {
            if pause == Some(step) {
                let (state, scene) = (trainer.state().expect("the state can be read"), lesson.disturbed());
                trainer = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
                assert!(trainer.resume(&state), "a state of the same number of Gaussians is accepted");
            }
            trainer
                .accumulate(&[lesson.sample(&images, step % 6), lesson.sample(&images, (step + 3) % 6)], 0.2)
                .expect("the views are drawn");
            trainer.step(&rates, 1.0, step + 1).expect("the step succeeds");
            losses.push(trainer.totals().expect("totals can be read").loss);
        }
        assert_eq!(trainer.faults().expect("faults can be read"), None, "every gradient is finite");
        (trainer.scene().expect("the scene can be read"), losses)
    };
    let (scene, losses) = train(None);
    let mean = |losses: &[f64]| losses.iter().sum::<f64>() / losses.len() as f64;
    let (first, last) = (mean(&losses[..6]), mean(&losses[44..]));
    assert!(last < 0.5 * first, "the loss falls from {first:.4} to {last:.4}");
    assert!(scene == train(Some(23)).0, "the resumed run ends at the same bits");
}

#[test]
fn gradients_that_are_not_finite_are_left_out_and_reported() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let mut trainer =
        Trainer::new(&mut headless, lesson.scene.clone(), GradientMode::Exact).expect("the scene can be trained");
    let count = 70 * 54;
    let mut pixels = vec![[1e-3; 4]; count];
    pixels[27 * 70 + 35] = [f32::NAN; 4];
    let depths = vec![0.0; count];
    trainer.accumulate_pixels(&lesson.views[0], Background::None, &pixels, &depths).expect("the view is drawn");
    let faults = trainer.faults().expect("faults can be read").expect("there are some");
    assert!(faults.count >= 1 && faults.gaussian < 400, "{faults:?}");
    trainer.step(&Rates::OURS, 1.0, 1).expect("the step succeeds");
    let scene = trainer.scene().expect("the scene can be read");
    let all = tensors(&trained(&scene).parameters, &trained(&scene).harmonics);
    assert!(all.iter().all(|(_, values)| values.iter().all(|value| value.is_finite())), "all values are finite");
    assert_ne!(scene, lesson.scene, "the other Gaussians are trained");
}

/// Returns a scene and a view whose camera is at the mean of a Gaussian, while the Gaussian has moved away: the
/// direction of its color is 0 / 0.
fn without_direction(lesson: &Lesson) -> (GaussianScene, View) {
    let (mut scene, time) = (lesson.moving(), 0.5);
    let change = |scene: &mut GaussianScene, mean: Vec3| {
        let parameters = &mut trained_mut(scene).parameters;
        parameters.mean[7] = mean.to_array();
        parameters.mean_t[7] = time - 0.8;
        (parameters.log_scale[7], parameters.log_scale_t[7]) = ([0.1f32.ln(); 3], 2f32.ln());
        (parameters.rotation_l[7], parameters.rotation_r[7]) = ([0.36, 0.93, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]);
    };
    let eye = Vec3::new(0.0, 0.0, 3.0);
    change(&mut scene, eye);
    let target = scene.clone().into_runtime().expect("the scene can be drawn").gaussian(7).mean_at(time);
    assert!(target.distance(eye) > 1.0, "the Gaussian has moved away: {target}");
    let view = Camera::look_at(eye, target, Vec3::Y, 0.8, UVec2::new(70, 54)).view(time, RasterFov::Reference);
    change(&mut scene, view.camera_position);
    (scene, view)
}

#[test]
fn a_gaussian_whose_gradient_is_not_finite_is_left_out_with_its_color() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new(&mut headless);
    let (count, depths) = (70 * 54, vec![0.0; 70 * 54]);
    let mut strong = vec![[0.0; 4]; count];
    // With weights of this size, gradients of color are finite and gradients of shapes are not.
    strong[27 * 70 + 35] = [1e37, 1e37, 1e37, 0.0];
    let (undirected, at_mean) = without_direction(&lesson);
    let cases = [
        ("a large gradient", lesson.moving(), lesson.views[0], strong),
        ("no direction", undirected, at_mean, vec![[1e-3; 4]; count]),
    ];
    for (what, scene, view, pixels) in cases {
        let mut trainer = Trainer::new(&mut headless, scene, GradientMode::Exact).expect("the scene can be trained");
        trainer.accumulate_pixels(&view, Background::None, &pixels, &depths).expect("the view is drawn");
        let gradients = trainer.gradients().expect("gradients can be read");
        let faults = trainer.faults().expect("faults can be read").expect("a gradient that is not finite is counted");
        println!("{what}: {faults:?}");
        assert!(what != "no direction" || faults.gaussian == 7, "{what}: {faults:?}");
        let all = tensors(&trained(&gradients).parameters, &trained(&gradients).harmonics);
        for (name, values) in &all {
            assert!(values.iter().all(|value| value.is_finite()), "{what}: {name} is finite");
        }
        let has = |name: &str, index: usize| {
            let (_, values) = all.iter().find(|(own, _)| *own == name).expect("a tensor");
            let stride = values.len() / 400;
            values[index * stride..][..stride].iter().any(|&value| value != 0.0)
        };
        let only_color = (0..400).filter(|&index| has("harmonics", index) && !has("opacity_logit", index));
        assert_eq!(only_color.collect::<Vec<_>>(), [0; 0], "{what}: no Gaussian has a gradient of color alone");
        assert!(!has("harmonics", faults.gaussian as usize), "{what}: the reported Gaussian is left out");
    }
}
