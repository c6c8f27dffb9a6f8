//! Known points of a scene.
//!
//! In: files of points as a film writes them. Out: files with wrong numbers, names and structures; accepted points have
//! finite places at ascending times.

use super::{Outcome, Reader};
use crate::change::text;
use crate::support::random::Random;
use bevy_gs4d::offline::sockets::KnownPoint;
use bevy_gs4d::scene::Origin;
use std::fs;
use tempfile::TempDir;

/// Points that come and go, and one at rest.
const SEEDS: [&str; 2] = [
    "{\"seconds\": [0.0, 4.0], \"times\": [0.0, 0.25, 1.0], \"points\": {\"gate\": [[0.5, 1.0, 0.0], [0.5, 1.0, 0.0], \
     [0.5, 1.0, 0.0]], \"petal\": [null, [0.1, -2.5e-1, 3.0], [0.2, -0.5, 3.5]]}}",
    "{\"times\": [-1, 2], \"points\": {\"a\": [[1, 2, 3], null], \"b\": [null, null]}}",
];

/// The reader of known points.
pub struct KnownPoints {
    folder: TempDir,
}

impl KnownPoints {
    /// Makes the folder of the file.
    pub fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }
}

impl Reader for KnownPoints {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        text::file(&SEEDS, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let path = self.folder.path().join("points.json");
        fs::write(&path, bytes).expect("the folder can be written to");
        let points = match KnownPoint::read(&path, &Origin::default()) {
            Ok(points) => points,
            Err(error) => return Ok(Outcome::Refused(error.to_string())),
        };
        for KnownPoint { name, track } in &points {
            let is_ascending = track.is_sorted_by(|a, b| a.0 < b.0) && track.iter().all(|(time, _)| time.is_finite());
            let is_finite = track.iter().filter_map(|(_, place)| *place).flatten().all(f32::is_finite);
            if name.trim().is_empty() || track.is_empty() || !is_ascending || !is_finite {
                return Err(format!("has the point {name:?} with the track {track:?}"));
            }
        }
        if points.is_empty() { Err("is accepted without a point".to_owned()) } else { Ok(Outcome::Accepted) }
    }
}
