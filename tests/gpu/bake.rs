//! Bakes with training to a size that the first package exceeds.
//!
//! In: a small synthetic scene, its own pictures as a dataset. Out: proof that a bake that is interrupted in its second
//! attempt resumes there, and ends at the same bytes. Skipped where there is no GPU.

use crate::support::capture::Capture;
use crate::support::gpu;
use bevy_gs4d::offline::bake::{BakeSettings, Baked, bake};
use bevy_gs4d::offline::compress::{PackedOrder, Quality};
use bevy_gs4d::offline::dataset::SplitOptions;
use bevy_gs4d::offline::engine::Engine;
use bevy_gs4d::offline::filter::KeyFrames;
use bevy_gs4d::offline::prune::{Goal, ScoreChoice};
use bevy_gs4d::offline::score::ScoringSettings;
use bevy_gs4d::offline::score::Variant;
use bevy_gs4d::offline::train::FineTuneSettings;
use bevy_gs4d::offline::work::Progress;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{FilterKind, GaussianScene};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::Path;

/// Words of the note about a package that is too large.
const AGAIN: &str = "again with";
/// Steps after which the state of training is stored first.
const STORED: usize = 2;

fn scene() -> GaussianScene {
    synthesize(&SynthSettings { count: 600, degree: 0, ..SynthSettings::default() })
}

impl Capture {
    /// Bakes [`scene`] to 15 kB. The scene has few colors and compresses well until its colors are trained: the first
    /// package is too large.
    fn bake(&self, out: &Path, engine: &mut Engine, progress: &mut Listener) -> Result<Baked, String> {
        let settings = BakeSettings {
            checkpoint: self.scene.clone(),
            data: self.data.clone(),
            out: out.to_owned(),
            splits: SplitOptions::default(),
            background: None,
            goal: Goal::Size(15_000),
            rounds: 1,
            score: ScoreChoice::One(Variant::Energy),
            scoring: ScoringSettings::default(),
            filter: FilterKind::Support,
            key_frames: KeyFrames::default(),
            fine_tune: Some(FineTuneSettings { steps: 6, evaluate_every: 2, ..FineTuneSettings::default() }),
            quality: Quality::Lossless,
            order: PackedOrder::Spatial,
            level: None,
            colliders: None,
            audio: None,
            trust_images: false,
            keep_work: false,
        };
        bake(scene(), &settings, engine, progress).map_err(|error| error.to_string())
    }
}

/// Keeps the notes of a bake. If `ends`, interrupts the bake after the first training state that is stored after a
/// package was too large.
#[derive(Default)]
struct Listener {
    ends: bool,
    /// The tasks that have begun and not finished.
    running: Vec<&'static str>,
    notes: Vec<String>,
    /// Steps of the task that began last.
    steps: usize,
}

impl Listener {
    /// Returns the number of notes with these words.
    fn count(&self, words: &str) -> usize {
        self.notes.iter().filter(|line| line.contains(words)).count()
    }
}

impl Progress for Listener {
    fn begin(&mut self, task: &'static str, _: usize) {
        self.running.push(task);
        self.steps = 0;
    }

    fn advance(&mut self) {
        self.steps += 1;
    }

    fn finish(&mut self) {
        self.running.pop();
    }

    fn note(&mut self, line: &str) {
        self.notes.push(line.to_owned());
    }

    fn is_interrupted(&self) -> bool {
        let trains = self.running.last() == Some(&"fine-tuning");
        self.ends && self.count(AGAIN) > 0 && trains && self.steps >= STORED
    }
}

#[test]
fn a_bake_interrupted_in_its_second_attempt_resumes_there() {
    let Some(headless) = gpu::headless() else { return };
    let capture = Capture::new(scene(), Vec3::ZERO, 4, 4, UVec2::splat(48), true);
    let mut engine = Engine::Gpu(Box::new(headless));
    let [whole_out, out] = ["whole.gs4d", "ended.gs4d"].map(|name| capture.path(name));
    let mut listener = Listener::default();
    let whole = capture.bake(&whole_out, &mut engine, &mut listener).expect("the uninterrupted bake succeeds");
    let attempts = listener.count(AGAIN);
    assert!(attempts > 0, "the first package is too large: {:?}", listener.notes);

    let mut listener = Listener { ends: true, ..Listener::default() };
    let error = capture.bake(&out, &mut engine, &mut listener).expect_err("the bake is interrupted");
    assert_eq!(error, "interrupted", "the bake ends in the second attempt");
    assert!(!out.exists(), "an interrupted bake writes no package");

    let mut listener = Listener::default();
    let resumed = capture.bake(&out, &mut engine, &mut listener).expect("the resumed bake succeeds");
    let notes = &listener.notes;
    assert_eq!(listener.count("fine-tuning resumes after step 2"), 1, "training resumes after step 2: {notes:?}");
    assert_eq!(listener.count(AGAIN), attempts - 1, "the first attempt is not repeated: {notes:?}");
    let bytes = |path: &Path| fs::read(path).expect("the package exists");
    assert!(bytes(&out) == bytes(&whole_out), "the package equals the package of the uninterrupted bake");
    assert_eq!(resumed.report.gaussians, whole.report.gaussians, "both reports have the same number of Gaussians");
    assert!(!capture.path("ended.gs4d.bake").exists(), "the states of all attempts are removed");
}
