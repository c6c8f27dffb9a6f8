//! The densification of the original: Gaussians are cloned, split and removed by their gradients on the screen.
//!
//! In: the raw parameters, the notes of `project_backward`. Out: [`Densifier`]: commands of the pass `statistics`,
//! which adds up gradients on the screen; other Gaussians, and lower opacities, after the steps in which that is due.
//! The rules are in the [CPU reference](crate::offline::train::reference::cloning).

use super::moves::Moves;
use super::part::Part;
use super::request::Request;
use crate::offline::engine::layout::TrainedRecord;
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::densification::Cloning;
use crate::offline::train::gpu::{Quantity, Workspace};
use crate::offline::train::reference::cloning::{Densified, densify, is_free, reset_opacity};
use crate::offline::train::schedule::{Step, relocation_seed};
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, ShaderChecks};
use std::mem::take;
use wgpu::BufferUsages;

/// The shader of the pass `statistics`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("statistics", include_str!("../../../../shaders/offline/statistics.wgsl"))], LIBRARIES);

/// The pass `statistics`, and what follows from its sums.
#[derive(Debug)]
pub(crate) struct Densifier {
    cloning: Cloning,
    seed: u64,
    /// Views of each step.
    batch: usize,
    pass: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// For each Gaussian the sum of its mean gradients, and the number of steps that have shown it.
    statistics: wgpu::Buffer,
    moves: Moves,
    /// Numbers of Gaussians since the last report, without their moves.
    changed: Densified,
}

impl Densifier {
    /// Makes the part if Gaussians are cloned.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        match request.settings.growth.and_then(|growth| growth.cloning) {
            Some(cloning) => Ok(Some(Box::new(Self::new(work, cloning, request)?))),
            None => Ok(None),
        }
    }

    fn new(work: &Workspace<'_>, cloning: Cloning, request: &Request<'_>) -> Result<Self, GpuError> {
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let layout = group_layout(device, "gs4d statistics", &[Bind::Read, Bind::Write]);
        let shader = SHADERS.module(device, "statistics", &[], ShaderChecks::Off)?;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let statistics = allocator.buffer("gs4d statistics", u64::from(work.parameters.count()) * 8, usage);
        let buffers = [&work.parameters.notes, &statistics].map(wgpu::Buffer::as_entire_binding);
        Ok(Self {
            cloning,
            seed: request.settings.seed,
            batch: request.batch,
            pass: pipeline(device, &shader, "statistics_of_step", &[Some(&layout)]),
            group: allocator.bind_group("gs4d statistics", &layout, &buffers),
            statistics,
            moves: Moves::new(work)?,
            changed: Densified::default(),
        })
    }

    /// Returns the mean gradient of each Gaussian on the screen over the steps since the last densification that have
    /// shown it. It is of a whole loss, as the thresholds of the original are: the loss of a view has a share of that
    /// of its batch.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn gradients(&self, work: &Workspace<'_>) -> Result<Vec<f32>, GpuError> {
        let bytes = work.headless.copy_out(&self.statistics, self.statistics.size())?;
        let statistics: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&bytes);
        Ok(statistics.into_iter().map(|[sum, steps]| self.batch as f32 * sum / steps.max(1.0)).collect())
    }

    /// Returns the number of Gaussians, without free places.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn live_count(work: &Workspace<'_>) -> Result<usize, GpuError> {
        let records = work.parameters.read_records(work.headless, Quantity::Values)?;
        Ok(records.iter().filter(|record| !is_free(record)).count())
    }

    /// Removes, clones and splits Gaussians after this number of steps, and begins new statistics.
    fn densify(&mut self, work: &Workspace<'_>, steps: usize) -> Result<(), GpuError> {
        let mut records = work.parameters.read_records(work.headless, Quantity::Values)?;
        let gradients = self.gradients(work)?;
        // The extent of the cameras.
        let extent = work.scene.trained_with.spatial_lr_scale;
        let (removes_large, seed) = (self.cloning.removes_large_after(steps), relocation_seed(self.seed, steps));
        let Densified { moves, cloned, split, removed } =
            densify(&mut records, &gradients, extent, removes_large, seed);
        // A Gaussian that is cloned keeps its moments, as in the original.
        self.moves.apply(work, &records, &moves, true);
        let mut encoder = work.encoder("gs4d statistics");
        encoder.clear_buffer(&self.statistics, 0, None);
        work.queue().submit([encoder.finish()]);
        self.changed.cloned += cloned;
        self.changed.split += split;
        self.changed.removed += removed;
        Ok(())
    }

    /// Lowers all opacities to at most 0.01, and sets their moments to 0.
    fn reset_opacity(work: &Workspace<'_>) -> Result<(), GpuError> {
        let [values, moments @ ..] = work.parameters.geometry.stored();
        let mut records = work.parameters.read_records(work.headless, Quantity::Values)?;
        reset_opacity(&mut records);
        work.queue().write_buffer(values, 0, bytemuck::cast_slice(&records));
        for buffer in moments {
            let bytes = work.headless.copy_out(buffer, buffer.size())?;
            let mut moments: Vec<TrainedRecord> = bytemuck::pod_collect_to_vec(&bytes);
            moments.iter_mut().for_each(|moments| moments.opacity_logit = [0.0; 4]);
            work.queue().write_buffer(buffer, 0, bytemuck::cast_slice(&moments));
        }
        Ok(())
    }
}

impl Part for Densifier {
    /// Records that the gradients of the step are added to the statistics.
    fn record_step(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, step: &Step) {
        if step.grows && self.cloning.adds_up(step.index) {
            pass.set_pipeline(&self.pass);
            pass.set_bind_group(0, &self.group, &[]);
            pass.dispatch_workgroups(work.parameters.count().div_ceil(256), 1, 1);
        }
    }

    fn after_step(&mut self, work: &Workspace<'_>, step: &Step) -> Result<bool, GpuError> {
        let steps = step.index + 1;
        let densifies = step.grows && self.cloning.densifies_after(steps);
        let resets = step.grows && self.cloning.resets_after(steps);
        if densifies {
            self.densify(work, steps)?;
        }
        if resets {
            Self::reset_opacity(work)?;
        }
        Ok(densifies || resets)
    }

    fn buffer(&self) -> Option<&wgpu::Buffer> {
        Some(&self.statistics)
    }

    fn report(&mut self) -> Option<String> {
        let Densified { cloned, split, removed, .. } = take(&mut self.changed);
        Some(format!("{cloned} cloned, {split} split, {removed} removed"))
    }
}
