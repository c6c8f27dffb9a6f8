//! Bakes that train, to a size that the first package exceeds.
//!
//! In: a small synthetic scene, its own pictures as a dataset. Out: proof that a bake which is killed in its second attempt resumes there, and
//! ends at the same bytes. Skipped where there is no GPU.

use crate::support::capture::Capture;
use crate::support::gpu;
use bevy_gs4d::codec::CodecError;
use bevy_gs4d::offline::Progress;
use bevy_gs4d::offline::bake::{BakeSettings, Baked, bake};
use bevy_gs4d::offline::engine::Engine;
use bevy_gs4d::offline::fine_tune::FineTuneSettings;
use bevy_gs4d::offline::quantize::Quality;
use bevy_gs4d::offline::score::ScoringSettings;
use bevy_gs4d::offline::score::variant::Variant;
use bevy_gs4d::offline::search::{Goal, ScoreChoice};
use bevy_gs4d::offline::splits::SplitOptions;
use bevy_gs4d::offline::temporal_filter::KeyFrames;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{FilterKind, GaussianScene};
use glam::{UVec2, Vec3};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What is said of a package that is too large.
const AGAIN: &str = "again with";

fn scene() -> GaussianScene {
    synthesize(&SynthSettings { count: 600, degree: 0, ..SynthSettings::default() })
}

impl Capture {
    /// Bakes [`scene`] to 15 kB. The colors of the scene are few, so that it compresses well until they are trained: the first package is too large.
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
            level: None,
            trust_images: false,
            keep_work: false,
        };
        bake(scene(), &settings, engine, progress).map_err(|error| error.to_string())
    }
}

/// Keeps what a bake says, and may end it: right after the first state of training that is stored once a package was too large.
#[derive(Default)]
struct Listener {
    ends: bool,
    /// The tasks that have begun and not finished.
    running: Vec<&'static str>,
    notes: Vec<String>,
}

impl Listener {
    /// Returns how often these words have been said.
    fn count(&self, words: &str) -> usize {
        self.notes.iter().filter(|line| line.contains(words)).count()
    }
}

impl Progress for Listener {
    fn begin(&mut self, task: &'static str, _: usize) {
        self.running.push(task);
    }

    fn advance(&mut self) {}

    fn finish(&mut self) {
        self.running.pop();
    }

    fn note(&mut self, line: &str) {
        self.notes.push(line.to_owned());
    }

    fn uninterrupted(&mut self, write: &mut dyn FnMut() -> Result<(), CodecError>) -> Result<(), CodecError> {
        write()?;
        if self.ends && self.count(AGAIN) > 0 && self.running.last() == Some(&"fine-tuning") {
            let kind = io::Error::other("the bake ends here").into();
            return Err(CodecError { path: PathBuf::from("state"), kind });
        }
        Ok(())
    }
}

#[test]
fn a_bake_killed_in_its_second_attempt_resumes_there() {
    let Some(headless) = gpu::headless() else { return };
    let capture = Capture::new(scene(), Vec3::ZERO, 4, 4, UVec2::splat(48), true);
    let mut engine = Engine::Gpu(Box::new(headless));
    let [whole_out, out] = ["whole.gs4d", "ended.gs4d"].map(|name| capture.path(name));
    let mut listener = Listener::default();
    let whole = capture.bake(&whole_out, &mut engine, &mut listener).expect("it can be baked");
    let attempts = listener.count(AGAIN);
    assert!(attempts > 0, "the first package is too large: {:?}", listener.notes);

    let mut listener = Listener { ends: true, ..Listener::default() };
    let error = capture.bake(&out, &mut engine, &mut listener).expect_err("it is ended");
    assert!(error.contains("the bake ends here"), "in the second attempt: {error}");
    assert!(!out.exists(), "there is no package yet");

    let mut listener = Listener::default();
    let resumed = capture.bake(&out, &mut engine, &mut listener).expect("it can be baked");
    let notes = &listener.notes;
    assert_eq!(listener.count("fine-tuning resumes after step 2"), 1, "not from the first step: {notes:?}");
    assert_eq!(listener.count(AGAIN), attempts - 1, "one package less is too large: {notes:?}");
    let bytes = |path: &Path| fs::read(path).expect("the package is there");
    assert!(bytes(&out) == bytes(&whole_out), "the same package as without an end");
    assert_eq!(resumed.report.gaussians, whole.report.gaussians, "of as many Gaussians");
    assert!(!capture.path("ended.gs4d.bake").exists(), "no state of any attempt is left");
}
