//! The limits of a stream.
//!
//! In: values that a host sets. Out: [`StreamLimits`].

/// What the stream of a capture may take.
///
/// Each plan may have other limits. If those of memory on the GPU shrink, files are given up; requests go on if the
/// others shrink.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StreamLimits {
    /// Bytes on the GPU of the Gaussians of files that are there or on the way, as
    /// [`StreamSchedule::gpu_bytes_of`](super::StreamSchedule::gpu_bytes_of) counts them. Default: 1 GiB.
    pub gpu_bytes: u64,
    /// Bytes in memory of files on the way: the files, and their Gaussians. A file that alone is larger is fetched
    /// while no other is on the way. Default: 512 MiB.
    pub host_bytes: u64,
    /// Files on the way at once. Default: 4.
    pub requests: usize,
    /// How far ahead of a player files are fetched, seconds of playing, at most [`MOST_AHEAD`](Self::MOST_AHEAD); NaN
    /// counts as 0. Default: 10.
    pub ahead: f64,
    /// For each layer above 0, or each [delay](crate::scene::ChunkTable::delays) of one, how many seconds later than layer 0 a
    /// file may come: with more, the first layer of what is
    /// played later comes before the last layer of now. Less suits a link that is fast for the capture. Counts as at
    /// least a millisecond. Default: [`LAYER_SECONDS`](Self::LAYER_SECONDS).
    pub layer_seconds: f64,
    /// A file of more bytes is long: only one such file is on its way at a time, so that short files that are played
    /// sooner are not held up on a slow link. Default: none is long.
    pub long_bytes: u64,
}

impl StreamLimits {
    /// The farthest that files are fetched ahead of a player, seconds of playing.
    pub const MOST_AHEAD: f64 = 600.0;

    /// Seconds that each layer may come later over a link whose throughput is not known.
    pub const LAYER_SECONDS: f64 = 1.5;

    /// Returns how much later each layer may come, within its bounds.
    pub(super) fn seconds_of_layer(&self) -> f64 {
        let layer_seconds = if self.layer_seconds.is_nan() { 0.0 } else { self.layer_seconds };
        layer_seconds.clamp(1e-3, Self::MOST_AHEAD)
    }

    /// Returns how far ahead of a player files are fetched, within its bounds.
    pub(super) fn ahead_seconds(&self) -> f64 {
        if self.ahead.is_nan() { 0.0 } else { self.ahead.clamp(0.0, Self::MOST_AHEAD) }
    }
}

impl Default for StreamLimits {
    fn default() -> Self {
        Self {
            gpu_bytes: 1 << 30,
            host_bytes: 512 << 20,
            requests: 4,
            ahead: 10.0,
            layer_seconds: Self::LAYER_SECONDS,
            long_bytes: u64::MAX,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_ahead_has_bounds() {
        let ahead = |ahead: f64| StreamLimits { ahead, ..StreamLimits::default() }.ahead_seconds();
        let given = [-1.0, 0.0, 3.0, 1e9, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
        assert_eq!(given.map(ahead), [0.0, 0.0, 3.0, 600.0, 600.0, 0.0, 0.0], "0 to 600 s");
        let later = |layer_seconds: f64| StreamLimits { layer_seconds, ..StreamLimits::default() }.seconds_of_layer();
        assert_eq!(given.map(later), [1e-3, 1e-3, 3.0, 600.0, 600.0, 1e-3, 1e-3], "1 ms to 600 s for each layer");
    }
}
