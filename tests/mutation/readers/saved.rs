//! The stored results of a bake.
//!
//! In: what a bake leaves in its folder. Out: one of its files with other contents, behind a header with the right key
//! and hash; the bake resumes from there, and a package that it writes must be one that can be read and drawn.
//!
//! An input is the name of the file, a line break, and its contents without the header.

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::{bytes, numbers, text};
use crate::support::dataset;
use crate::support::random::Random;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::codec::{self, ReadOptions};
use bevy_gs4d::offline;
use bevy_gs4d::offline::bake::{BakeSettings, bake};
use bevy_gs4d::offline::compress::{PackedOrder, Quality};
use bevy_gs4d::offline::dataset::SplitOptions;
use bevy_gs4d::offline::engine::Engine;
use bevy_gs4d::offline::filter::KeyFrames;
use bevy_gs4d::offline::prune::{Goal, ScoreChoice};
use bevy_gs4d::offline::score::ScoringSettings;
use bevy_gs4d::offline::score::Variant;
use bevy_gs4d::offline::work::NoProgress;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{FilterKind, GaussianScene};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Bytes of the header of a stored result: magic, version, key of the inputs, hash of the body.
const HEAD: usize = 72;
/// Place of the hash in the header.
const HASH: usize = 40;

/// The reader of stored results.
pub struct Saved {
    /// Keeps the files.
    _folder: TempDir,
    scene: GaussianScene,
    settings: BakeSettings,
    /// Name and bytes of each file that the bake wrote.
    files: Vec<(String, Vec<u8>)>,
    package: Vec<u8>,
}

impl Saved {
    /// Bakes a scene and keeps its stored results.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [checkpoint, data, out] = ["scene.gs4d", "data", "out.gs4d"].map(|name| folder.path().join(name));
        let scene = synthesize(&SynthSettings { count: 60, degree: 0, ..SynthSettings::default() });
        offline::work::save(&checkpoint, &scene, &WriteSettings::default()).expect("the folder can be written to");
        let runtime = scene.clone().into_runtime().expect("a synthetic scene can be drawn");
        dataset::write(&data, &runtime, Vec3::ZERO, 2, 2, UVec2::splat(24), false);
        let settings = BakeSettings {
            checkpoint,
            data,
            out,
            splits: SplitOptions::default(),
            background: None,
            goal: Goal::Keep(30),
            rounds: 1,
            score: ScoreChoice::One(Variant::Energy),
            scoring: ScoringSettings::default(),
            filter: FilterKind::Support,
            key_frames: KeyFrames::Count(4),
            fine_tune: None,
            quality: Quality::VisuallyLossless,
            order: PackedOrder::Spatial,
            level: Some(1),
            colliders: None,
            audio: None,
            trust_images: false,
            keep_work: true,
        };
        let mut saved = Self { _folder: folder, scene, settings, files: Vec::new(), package: Vec::new() };
        saved.bake().expect("a synthetic scene can be baked");
        for entry in fs::read_dir(saved.work()).expect("the results are there") {
            let entry = entry.expect("the folder can be listed");
            let bytes = fs::read(entry.path()).expect("a result can be read");
            if bytes.len() >= HEAD {
                saved.files.push((entry.file_name().to_string_lossy().into_owned(), bytes));
            }
        }
        // The order of files in a folder is not defined.
        saved.files.sort();
        saved.package = fs::read(&saved.settings.out).expect("the package is there");
        saved
    }

    fn bake(&self) -> Result<(), String> {
        let baked = bake(self.scene.clone(), &self.settings, &mut Engine::Cpu, &mut NoProgress);
        baked.map(drop).map_err(|error| error.to_string())
    }

    /// Returns the folder of the results.
    fn work(&self) -> PathBuf {
        self.settings.out.with_extension("gs4d.bake")
    }
}

impl Reader for Saved {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (name, file) = random.pick(&self.files);
        let (_, other) = random.pick(&self.files);
        let mut body = file[HEAD..].to_vec();
        if name == "prune" && !random.one_in(8) {
            let words = String::from_utf8_lossy(&body).into_owned();
            body = text::change(&words, &words, random).into_bytes();
        } else if body.len() >= 4 && !random.one_in(4) {
            for _ in 0..=random.below(4) {
                let at = random.below(body.len() / 4) * 4;
                let (whole, float) = (numbers::whole(random) as u32, numbers::float(random).to_bits());
                let word = if random.one_in(2) { whole } else { float };
                body[at..at + 4].copy_from_slice(&word.to_le_bytes());
            }
        } else {
            bytes::change(&mut body, &other[HEAD..], random);
        }
        [name.as_bytes(), b"\n", &body].concat()
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let mut parts = bytes.splitn(2, |&byte| byte == b'\n');
        let (name, body) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        let folder = self.work();
        fs::create_dir_all(&folder).expect("the folder can be made");
        for (known, file) in &self.files {
            let mut file = file.clone();
            if known.as_bytes() == name {
                file.truncate(HASH);
                file.extend(blake3::hash(body).as_bytes());
                file.extend(body);
            }
            fs::write(folder.join(known), file).expect("the folder can be written to");
        }
        let out = &self.settings.out;
        fs::write(out, &self.package).expect("the folder can be written to");
        match self.bake() {
            Ok(()) => {
                let scene = codec::load(out, &ReadOptions::default());
                accepted::check(
                    scene.map_err(|error| format!("leads to a package that cannot be read: {error}"))?,
                    DrawnBy::Cpu,
                )
            }
            Err(error) => Ok(Outcome::Refused(error.to_string())),
        }
    }
}
