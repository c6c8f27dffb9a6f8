//! GPU time of a frame and of its passes, measured by timestamps.
//!
//! In: a device with timestamps. Out: the intervals between timestamps; [`Timings`], medians over many frames, views and times.

use super::device::memory::Allocator;
use crate::view::Counts;
use std::sync::atomic::{AtomicU32, Ordering};

/// The name of the only time of a frame that is timed as a whole.
pub(super) const WHOLE_FRAME: &[&str] = &["frame"];

/// How the GPU time of the frames of a view is measured.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Measured {
    /// Not at all.
    #[default]
    Nothing,
    /// The frame as a whole, by two timestamps: a single time named `frame`.
    Frame,
    /// Each pass. Timestamps between passes take time, and passes that run at the same time otherwise run one after the other. The frame as a
    /// whole, if the device has no timestamps inside passes.
    Passes,
}

/// Medians over the frames of a benchmark.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Timings {
    /// Each pass, in frame order, measured in separate frames since timestamps between passes take time; empty if the device has no
    /// timestamps inside passes.
    pub passes: Vec<PassTime>,
    /// Median GPU time of the whole compute pass; `None` if the device has no timestamps.
    pub frame_milliseconds: Option<f64>,
    /// Median wall-clock time from submitting a frame to its end, with one frame in flight.
    pub wall_milliseconds: f64,
    /// Wall-clock time per frame with many frames in flight and several frames per submit.
    pub pipelined_milliseconds: f64,
    /// CPU time to prepare and record a frame, without its submit.
    pub encode_milliseconds: f64,
    /// Bytes of the buffers and targets of a view.
    pub bytes: u64,
    /// Median number of active Gaussians.
    pub active: u32,
    /// Median counts of a frame.
    pub counts: Counts,
    /// Number of frames measured.
    pub frames: usize,
}

/// GPU time of one pass.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// Median, milliseconds.
    pub milliseconds: f64,
}

/// Timestamps of one frame: either around the frame, or after each of its passes.
#[derive(Debug)]
pub(super) struct PassTimer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    period: f64,
    /// Names of the passes; empty if the frame is timed as a whole.
    passes: &'static [&'static str],
    next: AtomicU32,
}

impl PassTimer {
    /// Creates a timer of whole frames, or of these passes if not empty; returns `None` if the device does not support it.
    pub(super) fn new(allocator: Allocator<'_>, queue: &wgpu::Queue, passes: &'static [&'static str]) -> Option<Self> {
        let inside = !passes.is_empty();
        let device = allocator.device;
        let needed =
            if inside { wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES } else { wgpu::Features::TIMESTAMP_QUERY };
        if !device.features().contains(needed | wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let count = timestamps(passes);
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        Some(Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("gs4d timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            resolved: allocator.buffer("gs4d timestamps", u64::from(count) * 8, usage),
            period: f64::from(queue.get_timestamp_period()) * 1e-6,
            passes,
            next: AtomicU32::new(1),
        })
    }

    /// Returns the timestamp writes of the compute pass.
    pub(super) fn frame_writes(&self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: self.passes.is_empty().then_some(1),
        })
    }

    /// Writes the timestamp at the end of a pass, if passes are timed.
    pub(super) fn mark(&self, pass: &mut wgpu::ComputePass<'_>) {
        if !self.passes.is_empty() {
            pass.write_timestamp(&self.queries, self.next.fetch_add(1, Ordering::Relaxed));
        }
    }

    /// Copies the timestamps into the buffer, after the pass.
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.queries, 0..timestamps(self.passes), &self.resolved, 0);
        self.next.store(1, Ordering::Relaxed);
    }

    /// Returns the names of the passes; empty if the frame is timed as a whole.
    pub(super) fn passes(&self) -> &'static [&'static str] {
        self.passes
    }

    /// Returns the buffer of the timestamps, eight bytes each.
    pub(super) fn resolved(&self) -> &wgpu::Buffer {
        &self.resolved
    }

    /// Returns the milliseconds between each timestamp and the next.
    pub(super) fn intervals(&self, timestamps: &[u8]) -> Vec<f64> {
        let ticks: Vec<u64> = timestamps.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
        ticks.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64 * self.period).collect()
    }
}

/// Returns the middle value; 0 if there is none.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Returns the number of timestamps of a frame in which these passes are timed.
fn timestamps(passes: &[&str]) -> u32 {
    if passes.is_empty() { 2 } else { passes.len() as u32 + 1 }
}
