//! Obstacles: why the picture of a time may never be there.
//!
//! In: a schedule, a time, the memory on the GPU. Out: an [`Obstacle`], if something is in the way that waiting alone does
//! not mend.

use super::schedule::StreamSchedule;

/// Why the most important Gaussians of a time may never be there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// They take so many bytes on the GPU, more than they may.
    OverBudget {
        /// Bytes of the first layer of the time.
        needed: u64,
    },
    /// Requests of a file have failed [`MANY`](Self::MANY) times in a row. It is asked for again.
    Failing {
        /// The number of the file.
        file: usize,
    },
}

impl Obstacle {
    /// Failures of a file in a row that are an obstacle: about four seconds of them.
    pub const MANY: u32 = 5;
}

impl StreamSchedule {
    /// Returns why the most important Gaussians of a time, in seconds since the capture's start, may never be there, within
    /// so many bytes on the GPU.
    pub fn obstacle(&self, seconds: f64, gpu_bytes: u64) -> Option<Obstacle> {
        let files = &self.table().files;
        let is_first = |file: &usize| files.get(*file).is_some_and(|chunk| chunk.layer == 0);
        let first_layer: Vec<usize> = self.needed_at(seconds).filter(is_first).collect();
        let needed = first_layer.iter().map(|file| self.gpu_bytes_of(*file)).fold(0, u64::saturating_add);
        if needed > gpu_bytes {
            return Some(Obstacle::OverBudget { needed });
        }
        let failing = first_layer.into_iter().find(|file| self.failures_in_a_row(*file) >= Obstacle::MANY);
        failing.map(|file| Obstacle::Failing { file })
    }
}
