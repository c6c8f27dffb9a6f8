//! Measurement of the time to draw a capture.
//!
//! In: a capture and views of it. Out: [`Timings`]. GPU times are measured with several frames per submit and without waiting on the host,
//! since a GPU that is idle between frames lowers its clock.

use super::render::{Headless, instance, texel_bytes};
use crate::renderer::active::ActiveList;
use crate::renderer::capture::GpuCapture;
use crate::renderer::device::GpuContext;
use crate::renderer::device::GpuError;
use crate::renderer::device::memory::with_room;
use crate::renderer::frame::ViewParameters;
use crate::renderer::timing::{PassTime, PassTimer, Timings, median};
use crate::renderer::view::ViewRenderer;
use crate::view::{Background, Counts, View};
use std::time::{Duration, Instant};

/// Frames per submit, each with its own working buffers.
const FRAMES_PER_SUBMIT: usize = 4;

/// Time during which frames are drawn before the measurement: a GPU needs a fraction of a second to raise its clocks.
const WARM_UP: Duration = Duration::from_millis(600);

/// The resources of one of the frames of a submit.
struct Lane {
    view: ViewRenderer,
    active: Option<ActiveList>,
    timer: Option<PassTimer>,
}

impl Headless {
    /// Measures frames that cycle through `views`: `frames` frames for each kind of measurement, after a warm-up.
    ///
    /// # Panics
    /// If `views` is empty but `frames` is not 0.
    ///
    /// # Errors
    /// As [`render`](Self::render).
    pub fn time(&mut self, capture: &GpuCapture, views: &[View], frames: usize) -> Result<Timings, GpuError> {
        let parameters = &self.measured();
        let (mut counts, mut active_counts) = (Vec::new(), Vec::new());
        // The warm-up also finds the capacity that every view needs; the capacity for another capture is released first.
        self.view.release();
        for view in views {
            let active = self.take_active(capture, view.time);
            let frame = self.render_all(&[instance(capture, active.as_ref(), view)], parameters);
            self.active = active;
            counts.push(frame?.counts);
            active_counts.push(f64::from(self.view.statistics().active));
        }
        let mut lanes: Vec<Lane> = (0..FRAMES_PER_SUBMIT).map(|_| self.lane(capture)).collect();
        let start = Instant::now();
        while frames > 0 && start.elapsed() < WARM_UP {
            self.run(&mut lanes, capture, views, views.len().max(2 * FRAMES_PER_SUBMIT), None)?;
        }
        let untimed = self.run(&mut lanes, capture, views, frames, None)?;
        let around = self.run(&mut lanes, capture, views, frames, Some(&[]))?;
        let passes = self.view.timed_passes();
        let inside = self.run(&mut lanes, capture, views, frames, Some(passes))?;
        let mut alone = Vec::new();
        for i in 0..frames {
            let start = Instant::now();
            let commands = self.encode(&mut lanes[0], capture, &views[i % views.len()], None)?;
            self.context.queue.submit([commands]);
            self.wait()?;
            alone.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let middle = |value: fn(&Counts) -> u32| median(counts.iter().map(|c| f64::from(value(c))).collect()) as u32;
        let pass = |at: usize| median(inside.frames.iter().filter_map(|times| times.get(at).copied()).collect());
        Ok(Timings {
            passes: (0..passes.len())
                .filter(|_| !inside.frames.is_empty())
                .map(|at| PassTime { name: passes[at], milliseconds: pass(at) })
                .collect(),
            frame_milliseconds: (!around.frames.is_empty())
                .then(|| median(around.frames.iter().map(|times| times[0]).collect())),
            wall_milliseconds: median(alone),
            pipelined_milliseconds: untimed.wall_milliseconds,
            encode_milliseconds: untimed.encode_milliseconds,
            bytes: self.view.statistics().all_bytes(),
            active: median(active_counts) as u32,
            counts: Counts { visible: middle(|c| c.visible), pairs: middle(|c| c.pairs) },
            frames,
        })
    }

    /// Returns the parameters of the measured frames.
    fn measured(&self) -> ViewParameters<'static> {
        ViewParameters {
            background: Background::Color([0.0; 3]),
            depths: self.depths,
            precision: self.precision,
            ..ViewParameters::default()
        }
    }

    fn lane(&self, capture: &GpuCapture) -> Lane {
        let device = &self.context.device;
        let mut view = ViewRenderer::new(device, &self.renderer);
        view.set_design(&self.renderer, self.view.design());
        // The frames of the warm-up have been checked.
        view.draws_again = true;
        view.make_room_of(&self.view);
        let filtered = self.filtered.then(|| ActiveList::new(device, &self.renderer, capture));
        Lane { view, active: filtered.flatten(), timer: None }
    }

    /// Draws frames without waiting. With `passes`, timestamps are written: after each of these passes, or around frames if `passes` is
    /// empty.
    fn run(
        &self,
        lanes: &mut [Lane],
        capture: &GpuCapture,
        views: &[View],
        frames: usize,
        passes: Option<&'static [&'static str]>,
    ) -> Result<Run, GpuError> {
        let queue = &self.context.queue;
        for lane in &mut *lanes {
            lane.timer = passes.and_then(|passes| PassTimer::new(self.allocator(), queue, passes));
        }
        let each = lanes[0].timer.as_ref().map_or(0, |timer| timer.resolved().size());
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let all = self.allocator().buffer("gs4d timestamps", (each * frames as u64).max(8), usage);
        let start = Instant::now();
        let mut encode = 0.0;
        for first in (0..frames).step_by(lanes.len()) {
            let begin = Instant::now();
            let mut commands = Vec::new();
            for (i, lane) in (first..frames).zip(&mut *lanes) {
                let place = lane.timer.is_some().then_some((&all, each * i as u64));
                commands.push(self.encode(lane, capture, &views[i % views.len()], place)?);
            }
            encode += begin.elapsed().as_secs_f64() * 1e3;
            queue.submit(commands);
        }
        self.wait()?;
        let wall_milliseconds = start.elapsed().as_secs_f64() * 1e3 / frames.max(1) as f64;
        let mut times = Vec::new();
        if let (Some(timer), 1..) = (&lanes[0].timer, frames) {
            let timestamps = self.copy_out(&all, each * frames as u64)?;
            times.extend(timestamps.chunks_exact(each as usize).map(|frame| timer.intervals(frame)));
        }
        Ok(Run { frames: times, wall_milliseconds, encode_milliseconds: encode / frames.max(1) as f64 })
    }

    /// Records one frame with its own encoder. Its timestamps are copied to the given buffer and offset.
    fn encode(
        &self,
        lane: &mut Lane,
        capture: &GpuCapture,
        view: &View,
        timestamps: Option<(&wgpu::Buffer, u64)>,
    ) -> Result<wgpu::CommandBuffer, GpuError> {
        let GpuContext { device, queue, .. } = &self.context;
        let parameters = self.measured();
        if let Some(active) = &mut lane.active {
            self.activate(active, queue, capture, view.time);
        }
        let instances = [instance(capture, lane.active.as_ref(), view)];
        let needed = view.size.as_u64vec2().element_product() * texel_bytes(parameters.precision);
        with_room(device, needed, || lane.view.prepare(device, queue, &self.renderer, &instances, &parameters))??;
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("gs4d") });
        lane.view.record_timed(&self.renderer, &mut encoder, &instances, timestamps.and(lane.timer.as_ref()));
        if let (Some(timer), Some((to, at))) = (&lane.timer, timestamps) {
            timer.resolve(&mut encoder);
            encoder.copy_buffer_to_buffer(timer.resolved(), 0, to, at, timer.resolved().size());
        }
        Ok(encoder.finish())
    }
}

/// Times of frames that were drawn without waiting.
struct Run {
    /// Milliseconds of each frame, or of each of its passes; empty without timestamps.
    frames: Vec<Vec<f64>>,
    /// Wall-clock time of a frame.
    wall_milliseconds: f64,
    /// CPU time to prepare and record a frame.
    encode_milliseconds: f64,
}
