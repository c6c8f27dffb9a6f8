//! Training from pictures alone: relocation, noise, the schedule of colors, and whole runs on a dataset of a few moving
//! blobs.
//!
//! In: scenes and datasets made here. Out: proof that the passes `noise`, `relocate` and `regularize` have the results
//! of their CPU references, that relocation hardly changes the picture, that the densification of the original is that
//! of its CPU reference, that a capture is trained from nothing, and that runs repeat and resume at the same bytes.
//! Skipped where there is no GPU.

use crate::support::blob::blob;
use crate::support::interrupting::Interrupting;
use crate::support::trained::{trained, trained_mut};
use crate::support::training::{SEED, add_terms, growing, growing_step, still_growth, view};
use crate::support::{dataset, gpu};
use bevy_gs4d::gaussian::{Gaussian, GradientMode, Harmonics, Parameters};
use bevy_gs4d::internal::offline::dataset::Clock;
use bevy_gs4d::internal::offline::dataset::camera_numbers;
use bevy_gs4d::internal::offline::engine::TrainedRecord;
use bevy_gs4d::internal::offline::store::{Key, Store};
use bevy_gs4d::internal::offline::train::{CaptureSettings, Start, StartSettings, begin, capture_of, train};
use bevy_gs4d::internal::offline::train::{
    Cloning, FREE, Sample, Step, Terms, Trainer, TrainerState, densify, dropout_seed, is_dropped, is_free, noise_seed,
    regularization, relocate, relocation_seed, reset_opacity,
};
use bevy_gs4d::internal::offline::train::{loss, neighbors, noise};
use bevy_gs4d::internal::reference as passes;
use bevy_gs4d::offline::dataset::TrainingView;
use bevy_gs4d::offline::dataset::{SplitOptions, Splits};
use bevy_gs4d::offline::measure::SquaredError;
use bevy_gs4d::offline::train::{
    FineTuneSettings, FineTuned, Growth, ImageRoom, Rates, Resume, TrainError, TrainingImages,
};
use bevy_gs4d::offline::work::{NoProgress, Progress};
use bevy_gs4d::reference;
use bevy_gs4d::renderer::Headless;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, RasterFov, View};
use glam::{UVec2, Vec3};
use std::path::Path;
use tempfile::TempDir;

const COUNT: usize = 300;

fn synthetic() -> GaussianScene {
    synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() })
}

fn records(parameters: &Parameters) -> Vec<TrainedRecord> {
    let record = |index: usize| TrainedRecord {
        mean: parameters.mean[index],
        mean_t: parameters.mean_t[index],
        log_scale: parameters.log_scale[index],
        log_scale_t: parameters.log_scale_t[index],
        rotation_l: parameters.rotation_l[index],
        rotation_r: parameters.rotation_r[index],
        opacity_logit: [parameters.opacity_logit[index], 0.0, 0.0, 0.0],
    };
    (0..parameters.len()).map(record).collect()
}

#[test]
fn the_pass_noise_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = synthetic();
    let parameters = &mut trained_mut(&mut scene).parameters;
    // From transparent to opaque.
    let logits = parameters.opacity_logit.iter_mut().enumerate();
    logits.for_each(|(index, logit)| *logit = -8.0 + 10.0 * index as f32 / COUNT as f32);
    let mut expected = records(&trained(&scene).parameters);
    let (rate, factor, seed) = (Rates::OURS.mean * scene.trained_with.spatial_lr_scale, 0.5, noise_seed(SEED, 0));
    let strength = (5e5 * rate * factor) as f32;
    let least_time_scale = 0.2;
    let least = least_time_scale as f32 * scene.trained_with.time_span();
    (0..).zip(&mut expected).for_each(|(index, record)| noise(record, index, seed, strength, least.ln()));
    let growth = Growth { noise: 5e5, least_time_scale, ..still_growth() };
    let mut trainer = growing(&mut headless, scene.clone(), growth);
    // The gradients are 0: the optimizer moves nothing.
    let step = Step { factor, ..growing_step(0, Rates::OURS, 144) };
    trainer.optimize(&step).expect("the step succeeds");
    let found = trainer.scene().expect("the scene can be read");
    let (before, found) = (&trained(&scene).parameters, &trained(&found).parameters);
    let (mut moved, mut raised) = (0, 0);
    for (index, expected) in expected.iter().enumerate() {
        let [x, y, z] = expected.mean;
        let place = |mean: [f32; 3], mean_t: f32| Vec3::from(mean).extend(mean_t);
        let [own, by_cpu, by_gpu] = [
            place(before.mean[index], before.mean_t[index]),
            place([x, y, z], expected.mean_t),
            place(found.mean[index], found.mean_t[index]),
        ];
        let (far, error) = (by_cpu.distance(own), by_gpu.distance(by_cpu));
        assert!(error <= 1e-4 * far + 1e-6, "Gaussian {index} moves by {far}, on the GPU by {error} from that");
        moved += usize::from(far > 1e-3);
        let [own, by_cpu, by_gpu] = [before.log_scale_t[index], expected.log_scale_t, found.log_scale_t[index]];
        assert!((by_gpu - by_cpu).abs() < 1e-6, "Gaussian {index}: temporal scale {by_gpu}, expected {by_cpu}");
        raised += usize::from(by_cpu > own);
    }
    assert!((50..COUNT - 50).contains(&moved), "the faint Gaussians move, the opaque ones do not: {moved}");
    assert!((1..COUNT).contains(&raised), "the temporal scales of some Gaussians are raised: {raised}");
    assert_eq!(found.log_scale, before.log_scale, "nothing but means changes");
    assert_eq!(found.opacity_logit, before.opacity_logit, "nothing but means changes");
}

#[test]
fn dropped_gaussians_are_hidden_until_the_next_step() {
    let Some(mut headless) = gpu::headless() else { return };
    let (scene, view, black) = (synthetic(), view(0, UVec2::new(70, 54)), Background::Color([0.0; 3]));
    let (share, seed, step) = (0.3, dropout_seed(SEED, 0), growing_step(0, Rates::OURS, 144));
    let growth = Growth { dropout: share, ..still_growth() };
    let mut hidden = scene.clone();
    let logits = trained_mut(&mut hidden).parameters.opacity_logit.iter_mut();
    (0..).zip(logits).filter(|(index, _)| is_dropped(*index, seed, share)).for_each(|(_, logit)| *logit = -30.0);
    let expected = growing(&mut headless, hidden, growth).draw(&view, black).expect("the view is drawn").picture;
    let mut trainer = growing(&mut headless, scene, growth);
    let whole = trainer.draw(&view, black).expect("the view is drawn").picture;
    trainer.begin_step(&step).expect("the device works");
    let dropped = trainer.draw(&view, black).expect("the view is drawn").picture;
    assert_eq!(dropped, expected, "the picture without the dropped Gaussians");
    assert_ne!(dropped, whole, "the dropped Gaussians were visible");
    trainer.optimize(&step).expect("the step succeeds");
    let after = trainer.draw(&view, black).expect("the view is drawn").picture;
    assert_eq!(after, whole, "every Gaussian is drawn after the step");
}

/// Returns the buffers of a state by Gaussian: values, first and second moments of the geometry, then of the color.
fn rows(state: &TrainerState, buffer: usize) -> Vec<Vec<f32>> {
    let values: Vec<f32> = bytemuck::pod_collect_to_vec(&state.buffers[buffer]);
    values.chunks_exact(values.len() / COUNT).map(<[f32]>::to_vec).collect()
}

/// The buffers of moments.
const MOMENTS: [usize; 4] = [1, 2, 4, 5];

/// Asserts that all Gaussians have the colors of their sources, new ones moments of zero, and the others their own
/// moments.
fn assert_copied(before: &TrainerState, after: &TrainerState, source: &[usize], is_new: &[bool]) {
    let (colors, colors_before) = (rows(after, 3), rows(before, 3));
    assert!((0..COUNT).all(|index| colors[index] == colors_before[source[index]]), "colors are those of the sources");
    for buffer in MOMENTS {
        let (moments, moments_before) = (rows(after, buffer), rows(before, buffer));
        for index in 0..COUNT {
            let expected = if is_new[index] { vec![0.0; moments[index].len()] } else { moments_before[index].clone() };
            assert_eq!(moments[index], expected, "buffer {buffer}: the moments of Gaussian {index}");
        }
    }
}

#[test]
fn relocation_matches_the_cpu_reference_and_hardly_changes_the_picture() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = synthetic();
    let parameters = &mut trained_mut(&mut scene).parameters;
    // A third has faded: it is nearly invisible.
    parameters.opacity_logit.iter_mut().step_by(3).for_each(|logit| *logit = -9.0);
    let views: Vec<View> = (0..6).map(|index| view(index, UVec2::new(70, 54))).collect();
    let black = Background::Color([0.0; 3]);
    let growth = Growth { relocate_every: Some(1), ..still_growth() };
    let mut trainer = growing(&mut headless, scene, growth);
    // A step gives every Gaussian that is seen moments.
    let image = {
        let frame = trainer.draw(&views[0], black).expect("the view is drawn");
        let texels = frame.picture.pixels.iter().map(|_| [90, 120, 60, 255]).collect();
        let image = bevy_gs4d::offline::dataset::CoveredImage { size: views[0].size, texels, has_gaps: false };
        trainer.upload(&image).expect("the image fits the GPU")
    };
    let sample = Sample { view: &views[0], image: &image, background: black, number: 0 };
    trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
    trainer.step(&Rates { mean: 0.0, mean_t: 0.0, ..Rates::OURS }, 1e-3, 1).expect("the step succeeds");
    let before = trainer.state().expect("the state can be read");
    let pictures = |trainer: &mut Trainer<'_>| -> Vec<_> {
        views.iter().map(|view| trainer.draw(view, black).expect("the view is drawn").picture).collect()
    };
    let drawn = pictures(&mut trainer);
    let mut expected: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&before.buffers[0]);
    let moves = relocate(&mut expected, relocation_seed(SEED, 1));
    assert_eq!(moves.len(), COUNT / 3, "the faded third moves");
    trainer.end_step(&growing_step(0, Rates::OURS, 144)).expect("the device works");
    let after = trainer.state().expect("the state can be read");
    let found: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&after.buffers[0]);
    assert_eq!(found, expected, "the raw parameters are those of the CPU reference");
    let mut source: Vec<usize> = (0..COUNT).collect();
    let mut is_new = vec![false; COUNT];
    for &[to, from] in &moves {
        source[to as usize] = from as usize;
        is_new[to as usize] = true;
        is_new[from as usize] = true;
    }
    assert_copied(&before, &after, &source, &is_new);
    for buffer in MOMENTS {
        let moments = rows(&after, buffer);
        let kept = (0..COUNT).any(|index| !is_new[index] && moments[index].iter().any(|&moment| moment != 0.0));
        assert!(kept, "buffer {buffer}: a Gaussian that is not relocated has moments");
    }
    let mut error = SquaredError::default();
    for (before, after) in drawn.iter().zip(pictures(&mut trainer)) {
        error.add(before, &after).expect("one size");
    }
    println!("relocation of a third: {:.2} dB", error.psnr());
    assert!(error.psnr() > 35.0, "the pictures hardly change: {:.2} dB", error.psnr());
}

/// Returns the length of the gradient of each splat's center in a view, in normalized device coordinates, and whether
/// it is shown.
fn screen_gradients(scene: &RuntimeScene, view: &View, pixels: &[Vec3]) -> Vec<(bool, f64)> {
    let layer = passes::Layer { scene, view: *view, appearance: Appearance::default() };
    let splats = passes::project(&layer, BlendSpace::Encoded);
    let lists = passes::tile_lists(&splats, view);
    let zero = vec![0.0; pixels.len()];
    let pixels = passes::PixelGradients { color: pixels, depth: &zero, alpha: &zero };
    let gradients = passes::blend_backward(&splats, &lists, view, |_, _| Vec3::ZERO, &pixels, GradientMode::Exact);
    splats
        .iter()
        .zip(gradients)
        .map(|(splat, gradient)| (splat.is_visible(), gradient.ndc[0].hypot(gradient.ndc[1])))
        .collect()
}

#[test]
fn the_densification_of_the_original_is_that_of_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let mut scene = synthetic();
    scene.trained_with.spatial_lr_scale = 3.0;
    let parameters = &mut trained_mut(&mut scene).parameters;
    // A third of the places are free, a few Gaussians are faint.
    parameters.opacity_logit.iter_mut().step_by(3).for_each(|logit| *logit = FREE);
    parameters.opacity_logit.iter_mut().skip(1).step_by(30).for_each(|logit| *logit = -6.0);
    parameters.opacity_logit.iter_mut().skip(2).step_by(3).for_each(|logit| *logit += 1.0);
    // Some are small, some are large.
    parameters.log_scale.iter_mut().step_by(7).flatten().for_each(|scale| *scale -= 2.0);
    parameters.log_scale.iter_mut().skip(8).step_by(50).flatten().for_each(|scale| *scale += 1.0);
    let (views, black): (Vec<View>, _) =
        ((0..4).map(|i| view(i, UVec2::new(70, 54))).collect(), Background::Color([0.0; 3]));
    let cloning = Cloning { capacity: COUNT, every: 2, from: 0, until: usize::MAX, reset_every: 7 };
    let mut trainer = growing(&mut headless, scene, Growth { cloning: Some(cloning), ..still_growth() });
    let texels: Vec<[u8; 4]> = (0..70 * 54).map(|i| [(i * 7 % 200) as u8, 120, (i / 70 * 4) as u8, 255]).collect();
    let image = bevy_gs4d::offline::dataset::CoveredImage { size: views[0].size, texels, has_gaps: false };
    let uploaded = trainer.upload(&image).expect("the image fits the GPU");
    // Steps of two views each; the parameters stay.
    let still = Rates { mean: 0.0, mean_t: 0.0, scale: 0.0, rotation: 0.0, opacity: 0.0, ..Rates::OURS };
    let mut sums = vec![[0.0f64; 2]; COUNT];
    for (step, own) in [[0, 1], [2, 3], [1, 2]].into_iter().enumerate() {
        let runtime = trainer.scene().expect("it can be read").into_runtime().expect("it can be drawn");
        let mut of_step = vec![(0, 0.0); COUNT];
        for index in own {
            let drawn = trainer.draw(&views[index], black).expect("the view is drawn").picture;
            let loss = loss(&drawn, &image.over(Vec3::ZERO), 0.2).expect("one size");
            for (sum, (shown, length)) in
                of_step.iter_mut().zip(screen_gradients(&runtime, &views[index], &loss.gradient))
            {
                sum.0 += usize::from(shown);
                sum.1 += length;
            }
        }
        for (sum, (shown, length)) in sums.iter_mut().zip(of_step).filter(|(_, (shown, _))| *shown > 0) {
            sum[0] += length / shown as f64;
            sum[1] += 1.0;
        }
        let sample = |index: usize| Sample { view: &views[index], image: &uploaded, background: black, number: 0 };
        trainer.accumulate(&own.map(sample), 0.2).expect("the views are drawn");
        trainer.optimize(&growing_step(step, still, 3)).expect("the step succeeds");
    }
    let found = trainer.screen_gradients().expect("they can be read");
    let mut shown = 0;
    for (index, (&found, [sum, steps])) in found.iter().zip(sums).enumerate() {
        let expected = sum / steps.max(1.0);
        let error = (f64::from(found) - expected).abs();
        assert!(error <= 1e-2 * expected + 1e-7, "the gradient of Gaussian {index} is {found}, expected {expected}");
        shown += usize::from(expected > 2e-4);
    }
    assert!(shown > 10, "some gradients are large: {shown}");
    let before = trainer.state().expect("the state can be read");
    let mut expected: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&before.buffers[0]);
    let densified = densify(&mut expected, &found, 3.0, true, relocation_seed(SEED, 8));
    println!("{} cloned, {} split, {} removed", densified.cloned, densified.split, densified.removed);
    assert!(densified.cloned > 2 && densified.split > 5 && densified.removed > 10, "all kinds: {densified:?}");
    // After eight steps a densification is due, and no reset.
    trainer.end_step(&growing_step(7, still, 3)).expect("the device works");
    let after = trainer.state().expect("the state can be read");
    let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&after.buffers[0]);
    assert_eq!(records, expected, "the raw parameters are those of the CPU reference");
    let taken = expected.iter().filter(|record| !is_free(record)).count();
    assert_eq!(trainer.live_count().expect("it can be read"), taken, "the number of Gaussians");
    let mut source: Vec<usize> = (0..COUNT).collect();
    let mut is_new = vec![false; COUNT];
    for &[to, from] in &densified.moves {
        source[to as usize] = from as usize;
        is_new[to as usize] = true;
    }
    assert_copied(&before, &after, &source, &is_new);
    assert_eq!(trainer.screen_gradients().expect("they can be read"), [0.0; COUNT], "sums begin again");
    // After seven, a reset alone.
    trainer.end_step(&growing_step(6, still, 3)).expect("the device works");
    reset_opacity(&mut expected);
    let reset = trainer.state().expect("the state can be read");
    let records: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&reset.buffers[0]);
    assert_eq!(records, expected, "opacities are reset as in the CPU reference");
    for buffer in [1, 2] {
        for (index, (found, before)) in rows(&reset, buffer).iter().zip(rows(&after, buffer)).enumerate() {
            assert_eq!(found[16..], [0.0; 4], "buffer {buffer}: the moments of the opacity of Gaussian {index}");
            assert_eq!(found[..16], before[..16], "buffer {buffer}: its other moments");
        }
    }
}

#[test]
fn the_gradient_of_the_term_of_scale_matches_the_cpu_reference() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = synthetic();
    let terms = Terms { scale: 0.7, ..Terms::default() };
    let parameters = &trained(&scene).parameters;
    let expected =
        regularization(parameters, &neighbors(&parameters.mean), &terms, 1.0).expect("the Gaussians are drawn");
    let mut trainer = Trainer::new(&mut headless, scene.clone(), GradientMode::Exact).expect("the scene is trained");
    add_terms(&mut trainer, terms).expect("the weight is right");
    trainer.accumulate_terms(0).expect("the term is added");
    let found = trainer.gradients().expect("gradients can be read");
    let found = &trained(&found).parameters;
    for (index, expected) in expected.gradients.iter().enumerate() {
        for (found, expected) in found.log_scale[index].into_iter().zip(expected.log_scale) {
            let error = (f64::from(found) - expected).abs();
            assert!(expected > 0.0 && error <= 1e-5 * expected, "Gaussian {index}: {found}, expected {expected}");
        }
        assert_eq!(found.log_scale_t[index], 0.0, "Gaussian {index}: the temporal scale has no term");
    }
    assert!(found.opacity_logit.iter().all(|&slope| slope == 0.0), "no other parameter has a gradient");
}

#[test]
fn color_values_beyond_the_degree_are_not_trained() {
    let Some(mut headless) = gpu::headless() else { return };
    let scene = synthetic();
    let size = UVec2::new(70, 54);
    let view = view(0, size);
    for values in [3, 12, 27, 48, 144] {
        let mut trainer = growing(&mut headless, scene.clone(), still_growth());
        let texels = vec![[200, 10, 90, 255]; size.element_product() as usize];
        let image = bevy_gs4d::offline::dataset::CoveredImage { size, texels, has_gaps: false };
        let image = trainer.upload(&image).expect("the image fits the GPU");
        let sample = Sample { view: &view, image: &image, background: Background::None, number: 0 };
        trainer.accumulate(&[sample], 0.2).expect("the view is drawn");
        trainer.optimize(&growing_step(0, Rates::OURS, values)).expect("the step succeeds");
        let found = trainer.scene().expect("the scene can be read");
        let (before, after) = (&trained(&scene).harmonics.values, &trained(&found).harmonics.values);
        let changed = |index: &usize| before.chunks(144).zip(after.chunks(144)).any(|(b, a)| b[*index] != a[*index]);
        let changed: Vec<usize> = (0..144).filter(changed).collect();
        assert_eq!(changed, (0..values as usize).collect::<Vec<_>>(), "exactly the first {values} values change");
    }
}

/// Returns five colored blobs, two of which move, one of which is there for a while.
fn blobs() -> RuntimeScene {
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let blobs: [(Gaussian, Vec3); 5] = [
        (blob(at(-0.5, -0.3, -0.2), Vec3::new(0.25, 0.2, 0.2), 0.9), at(0.9, 0.2, 0.1)),
        (blob(at(0.5, -0.3, 0.0), Vec3::new(0.15, 0.25, 0.3), 0.9), at(0.1, 0.7, 0.2)),
        (Gaussian { velocity: [0.0, 0.8, 0.0], ..blob(at(0.0, 0.3, 0.3), Vec3::splat(0.2), 0.9) }, at(0.2, 0.3, 0.9)),
        (
            Gaussian { velocity: [-0.8, 0.0, 0.2], ..blob(at(0.1, 0.6, -0.3), Vec3::splat(0.15), 0.9) },
            at(0.9, 0.8, 0.1),
        ),
        (Gaussian { sigma_t: 0.25, ..blob(at(0.0, -0.7, 0.5), Vec3::splat(0.2), 0.9) }, at(0.8, 0.1, 0.8)),
    ];
    let colors = blobs.iter().flat_map(|(_, color)| ((*color - 0.5) / 0.282_094_79).to_array());
    let harmonics = Harmonics { coefficients: 1, degree: 0, degree_t: 0, values: colors.collect() };
    RuntimeScene::sliced(blobs.into_iter().map(|(gaussian, _)| gaussian).collect(), harmonics)
}

/// A dataset of the blobs, with images that have coverage.
struct Lesson {
    folder: TempDir,
    all: Vec<TrainingView>,
    splits: Splits,
}

impl Lesson {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let data = folder.path().join("data");
        let scene = blobs();
        dataset::write(&data, &scene, Vec3::ZERO, 10, 5, UVec2::splat(48), true);
        let splits = Splits::open(&data, &SplitOptions::default(), &scene.trained_with, &mut NoProgress);
        let splits = splits.expect("the dataset was just written");
        let all = splits.all_training(&scene.trained_with, &mut NoProgress).expect("the dataset was just written");
        all.iter().for_each(|view| write_covered(&scene, view, 1.0, &view.image));
        Self { folder, all, splits }
    }

    fn store(&self, name: &str) -> Store {
        Store::beside(&self.folder.path().join(name), ".train").expect("the folder can be written to")
    }

    /// Trains a capture, with validation on the camera that is held out.
    fn train(
        &self,
        headless: &mut Headless,
        start: &StartSettings,
        settings: &FineTuneSettings,
        store: Option<&Store>,
        out: Option<&Path>,
        progress: &mut dyn Progress,
    ) -> Result<FineTuned, Box<TrainError>> {
        let (trained_with, playback) =
            capture_of(&self.all, &CaptureSettings::default(), Clock::default()).expect("ten places");
        let Splits { train: views, validation, .. } = &self.splits;
        let images =
            TrainingImages::load(views.clone(), validation, &trained_with, ImageRoom::of_system(), &mut NoProgress);
        let images = images.expect("the images were just written");
        let (scene, _) = begin(&images, trained_with, playback, start, None).expect("the cameras look at the blobs");
        let resume = store.map(|store| Resume { store, key: Key::of(b"blobs"), every: 1 });
        train(headless, scene, &images, settings, resume, out, progress).map_err(Box::new)
    }
}

/// Writes the image of a view with its coverage, as a camera of this gain takes it.
fn write_covered(scene: &RuntimeScene, view: &TrainingView, gain: f32, path: &Path) {
    let to_draw = view.camera.view(view.time, RasterFov::Corrected);
    let frame = reference::render(scene, &to_draw, Background::None);
    let mut image = image::RgbaImage::new(view.camera.size.x, view.camera.size.y);
    let pixels = image.pixels_mut().zip(frame.picture.pixels.iter().zip(&frame.transmittance));
    for (pixel, (color, transmittance)) in pixels {
        let coverage = 1.0 - transmittance;
        let [r, g, b] = (*color * gain / coverage.max(1e-3)).to_array();
        pixel.0 = [r, g, b, coverage].map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8);
    }
    image.save(path).expect("the folder can be written to");
}

fn settings(steps: usize) -> FineTuneSettings {
    FineTuneSettings {
        steps,
        evaluate_every: steps / 4,
        similarity_share: 0.2,
        rates: Rates { mean: 1e-3, ..Rates::OURS },
        terms: Terms { opacity: 0.01, scale: 0.01, ..Terms::default() },
        growth: Some(Growth::over(steps)),
        ..FineTuneSettings::default()
    }
}

#[test]
fn a_capture_is_trained_from_nothing() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let out = lesson.folder.path().join("out.gs4d");
    for (start, least) in [(Start::Hull, 37.0), (Start::Random, 22.0)] {
        let from = StartSettings { gaussians: 400, start, degree: 1, ..StartSettings::default() };
        let found = lesson.train(&mut headless, &from, &settings(400), None, Some(&out), &mut NoProgress);
        let found = found.expect("the capture is trained");
        let psnr = found.best.psnr.expect("validation views");
        println!("{start:?}: {psnr:.2} dB");
        assert_eq!(found.scene.len(), 400, "{start:?}: the number of Gaussians stays");
        assert!(psnr > least, "{start:?}: {psnr:.2} dB on the camera that is held out, more than {least} dB expected");
        let written = bevy_gs4d::codec::load(&out, &Default::default()).expect("the package of an evaluation is whole");
        assert_eq!(written.len(), 400, "{start:?}: the package has all Gaussians");
        std::fs::remove_file(&out).expect("the package was written");
    }
}

#[test]
fn exposures_even_out_the_gains_of_cameras() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    // Three cameras of nine see half the light; the camera held out has the mean gain, which is far from the gain of
    // most cameras.
    let gain = |camera: u32| [0.5, 1.0, 1.0][camera as usize % 3];
    const MEAN: f32 = 7.5 / 9.0;
    let cameras = camera_numbers(&lesson.splits.train);
    for (view, &camera) in lesson.splits.train.iter().zip(&cameras) {
        write_covered(&blobs(), view, gain(camera), &view.image);
    }
    lesson.splits.validation.iter().for_each(|view| write_covered(&blobs(), view, MEAN, &view.image));
    let start = StartSettings { gaussians: 300, degree: 0, ..StartSettings::default() };
    let mut train = |exposure: bool| {
        // Of few steps.
        let rates = Rates { exposure: 5e-3, ..settings(300).rates };
        let settings = FineTuneSettings { exposure, rates, ..settings(300) };
        lesson.train(&mut headless, &start, &settings, None, None, &mut NoProgress).expect("the capture is trained")
    };
    let (without, with) = (train(false), train(true));
    let [before, after] = [&without, &with].map(|tuned| tuned.best.psnr.expect("validation views"));
    println!("validation: {before:.2} dB without exposures, {after:.2} dB with them");
    assert!(after > before + 1.0, "exposures raise the PSNR of the camera held out: {before:.2} to {after:.2} dB");
    assert_eq!((without.exposures.len(), with.exposures.len()), (0, 9), "each training camera has one");
    for (camera, exposure) in with.exposures.iter().enumerate() {
        // On a gray of 0.5, in the mean of the channels.
        let found = exposure.iter().map(|[r, g, b, offset]| r + g + b + 2.0 * offset).sum::<f32>() / 3.0;
        let expected = gain(camera as u32) / MEAN;
        println!("camera {camera}: {found:.2}, expected {expected:.2}");
        assert!((found - expected).abs() < 0.2, "camera {camera}: a gain of {found:.2}, {expected:.2} expected");
    }
}

/// Returns the settings of a training that clones and splits as the original, up to `capacity` Gaussians.
fn original(steps: usize, capacity: usize) -> FineTuneSettings {
    let usual = settings(steps);
    let cloning = Cloning { capacity, every: 10, from: 10, until: steps / 2, reset_every: steps / 3 };
    let growth =
        Growth { relocate_every: None, noise: 0.0, dropout: 0.0, cloning: Some(cloning), ..Growth::over(steps) };
    FineTuneSettings { growth: Some(growth), terms: Terms::default(), ..usual }
}

#[test]
fn a_capture_grows_from_few_gaussians_as_in_the_original() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let start = StartSettings { gaussians: 60, degree: 1, ..StartSettings::default() };
    let out = lesson.folder.path().join("out.gs4d");
    let found = lesson.train(&mut headless, &start, &original(300, 250), None, Some(&out), &mut NoProgress);
    let found = found.expect("the capture is trained");
    let (psnr, count) = (found.best.psnr.expect("validation views"), found.scene.len());
    println!("{count} Gaussians, {psnr:.2} dB");
    assert!((61..=250).contains(&count), "there are more than at first, and at most the capacity: {count}");
    assert!(psnr > 22.0, "{psnr:.2} dB on the camera that is held out, more than 22 dB expected");
    let logits = &trained(&found.scene).parameters.opacity_logit;
    assert!(logits.iter().all(|&logit| logit > FREE), "the capture has no free places");
    let written = bevy_gs4d::codec::load(&out, &Default::default()).expect("the package of an evaluation is whole");
    assert!((60..=250).contains(&written.len()), "nor has the package: {}", written.len());
}

#[test]
fn training_as_the_original_repeats_and_resumes_at_the_same_bytes() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let start = StartSettings { gaussians: 60, ..StartSettings::default() };
    let settings = FineTuneSettings { evaluate_every: 45, ..original(180, 120) };
    let mut run = |store: Option<&Store>, progress: &mut dyn Progress| {
        lesson.train(&mut headless, &start, &settings, store, None, progress)
    };
    let whole = run(None, &mut NoProgress).expect("the capture is trained");
    assert!(whole.scene.len() != 60, "Gaussians were cloned, split or removed: {}", whole.scene.len());
    let again = run(None, &mut NoProgress).expect("the capture is trained");
    assert!(whole.scene == again.scene && whole.curve == again.curve, "a second run has the same result");
    // Between two densifications: the sums of gradients are part of the state.
    let store = lesson.store("original");
    let stopped = run(Some(&store), &mut Interrupting::new("training", 55));
    let stopped = stopped.map_err(|error| *error);
    assert!(matches!(stopped, Err(TrainError::Interrupted { tuned: Some(_) })), "interrupted");
    let resumed = run(Some(&store), &mut NoProgress).expect("the capture is trained");
    assert!(resumed.scene == whole.scene && resumed.curve == whole.curve, "the resumed run has the same result");
}

#[test]
fn training_from_nothing_repeats_and_resumes_at_the_same_bytes() {
    let Some(mut headless) = gpu::headless() else { return };
    let lesson = Lesson::new();
    let start = StartSettings { gaussians: 200, ..StartSettings::default() };
    let growth =
        Growth { relocate_every: Some(10), relocate_from: 0, relocate_until: 60, raise_every: 8, ..Growth::over(60) };
    // Opacities fall fast, so that Gaussians fade within these steps.
    let settings = FineTuneSettings {
        rates: Rates { opacity: 0.5, ..Rates::OURS },
        growth: Some(growth),
        exposure: true,
        ..settings(60)
    };
    let mut run = |store: Option<&Store>, progress: &mut dyn Progress| {
        lesson.train(&mut headless, &start, &settings, store, None, progress)
    };
    let whole = run(None, &mut NoProgress).expect("the capture is trained");
    let again = run(None, &mut NoProgress).expect("the capture is trained");
    assert!(whole.scene == again.scene && whole.curve == again.curve, "a second run has the same result");
    for left in [22, 37] {
        let store = lesson.store(&left.to_string());
        let stopped = run(Some(&store), &mut Interrupting::new("training", left));
        let stopped = stopped.map_err(|error| *error);
        assert!(matches!(stopped, Err(TrainError::Interrupted { tuned: Some(_) })), "after {left} steps: interrupted");
        let resumed = run(Some(&store), &mut NoProgress).expect("the capture is trained");
        assert!(resumed.scene == whole.scene, "after {left} steps: the resumed run has the same scene");
        assert_eq!(resumed.exposures, whole.exposures, "after {left} steps: the resumed run has the same exposures");
        assert_eq!(resumed.curve, whole.curve, "after {left} steps: the resumed run has the same curve");
    }
    let other = lesson.train(
        &mut headless,
        &StartSettings { seed: 1, ..start },
        &FineTuneSettings { seed: 1, ..settings },
        None,
        None,
        &mut NoProgress,
    );
    assert!(other.expect("the capture is trained").scene != whole.scene, "another seed has another result");
}
