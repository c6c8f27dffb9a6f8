//! Files of scores: for pruning, and as weights of colors.
//!
//! In: scores of a scene. Out: files of other lengths and values; accepted files prune and compress the scene.

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::{bytes, numbers};
use crate::support::packed_scene;
use crate::support::random::Random;
use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::internal::offline::prune::{highest, select};
use bevy_gs4d::internal::offline::score::read_weights;
use bevy_gs4d::offline::compress::{CompressSettings, compress};
use bevy_gs4d::offline::score::read_scores;
use bevy_gs4d::scene::{GaussianScene, RuntimeScene};
use std::fs;
use std::io::Cursor;
use tempfile::TempDir;

/// Gaussians of the scene.
const COUNT: usize = 40;

/// The reader of scores.
pub struct ScoreFiles {
    folder: TempDir,
    scene: RuntimeScene,
}

impl ScoreFiles {
    /// Makes the scene.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { folder, scene: packed_scene::scene(COUNT, 1, 0) }
    }
}

impl Reader for ScoreFiles {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut scores: Vec<f32> = (0..COUNT).map(|_| random.below(1000) as f32 * 0.001).collect();
        let (end, all) = (numbers::float(random), random.one_in(4));
        for _ in 0..random.below(4) {
            scores[random.below(COUNT)] = if all { end } else { numbers::float(random) };
        }
        if all {
            scores.fill(end);
        }
        let mut file: Vec<u8> = scores.iter().flat_map(|score| score.to_le_bytes()).collect();
        if random.one_in(4) {
            bytes::change(&mut file, &[0; 64], random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let path = self.folder.path().join("scores.f32");
        fs::write(&path, bytes).expect("the folder can be written to");
        let weights = read_weights(&path, COUNT);
        let scores = match read_scores(&path, COUNT) {
            Ok(scores) => scores,
            Err(_) if weights.is_ok() => return Err("is read as weights and refused as scores".to_owned()),
            Err(error) => return Ok(Outcome::Refused(error.to_string())),
        };
        if let Ok(weights) = weights {
            self.compress_by(weights)?;
        }
        let whole = GaussianScene::from(self.scene.clone());
        accepted::check(select(&whole, &highest(&scores, COUNT / 4)), DrawnBy::Cpu)
    }
}

impl ScoreFiles {
    /// Compresses the scene with these weights. If compression accepts them, the written package must be readable and
    /// drawable.
    fn compress_by(&self, weights: Vec<f32>) -> Result<(), String> {
        let settings = CompressSettings { weights: Some(weights), ..packed_scene::settings(&[4, 4]) };
        let Ok((compressed, _)) = compress(self.scene.clone(), &settings) else { return Ok(()) };
        let mut file = Vec::new();
        if package::write(&mut file, &compressed, &WriteSettings { level: 1 }).is_err() {
            return Ok(());
        }
        let again = package::read(Cursor::new(file));
        let again = again.map_err(|error| format!("weighs colors that cannot be read: {error}"))?;
        let again = again.into_runtime().map_err(|error| format!("weighs colors that cannot be drawn: {error}"))?;
        accepted::draw(&again, DrawnBy::Cpu)
    }
}
