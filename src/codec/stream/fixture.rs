//! Tables and playheads for tests.
//!
//! In: few numbers. Out: a [`ChunkTable`], a [`Playhead`].

use super::playhead::{Playhead, Turn};
use crate::scene::random::Random;
use crate::scene::{ChunkFile, ChunkTable};

/// Returns a table of files, each its stretches, its layer and its bytes on the GPU, which are also those of the file.
pub(super) fn table(stretches: u32, files: &[([u32; 2], u32, u64)]) -> ChunkTable {
    let file = |&(stretches, layer, bytes)| ChunkFile { stretches, layer, gaussians: bytes, bytes };
    ChunkTable {
        stretches,
        gaussian_bytes: 1,
        files: files.iter().map(file).collect(),
        utilities: Vec::new(),
        first_byte: None,
    }
}

/// Returns a player at a time, with a velocity, in a range of any end.
pub(super) fn head(seconds: f64, velocity: f64, turn: Turn) -> Playhead {
    Playhead { seconds, velocity, range: [0.0, f64::INFINITY], turn, delay: 0.0 }
}

/// Returns any player of a capture of `duration` seconds.
pub(super) fn random_head(random: &mut Random, duration: f32) -> Playhead {
    let mut seconds = || f64::from(random.in_range(-0.1 * duration, 1.1 * duration));
    let (now, a, b) = (seconds(), seconds(), seconds());
    let range = match random.below(8) {
        0 => [a, b],
        1 => [a, a],
        2..5 => [a.min(b), a.max(b)],
        _ => [0.0, duration.into()],
    };
    let velocity = match random.below(8) {
        0 => 0.0,
        1..5 => f64::from(random.in_range(-2.0, 2.0)),
        5 => f64::from(random.in_range(-100.0, 100.0)),
        6 => -1.0,
        _ => 1.0,
    };
    let turn = [Turn::Stop, Turn::Loop, Turn::Return][random.below(3)];
    // One that stands comes after those that play.
    let delay = if velocity == 0.0 { 1e-3 } else { 0.0 };
    Playhead { seconds: now, velocity, range, turn, delay }
}

/// Returns the delays of layers of which each may come so many seconds later than the one before.
pub(super) fn even_delays(layer_seconds: f64) -> [f64; ChunkTable::MOST_LAYERS as usize] {
    std::array::from_fn(|layer| layer as f64 * layer_seconds)
}
