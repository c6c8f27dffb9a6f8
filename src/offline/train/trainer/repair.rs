//! Gaussians that are replaced or hidden between two steps.
//!
//! In: the raw parameters of all Gaussians, those that take the places of some. Out: the same on the GPU, with the
//! moments of these at 0. Which these are is decided in the phase of the steps.

use super::step::Trainer;
use crate::offline::engine::layout::TrainedRecord;
use crate::offline::train::gpu::{ParameterChunk, Quantity};
use crate::offline::train::reference::births::Born;
use crate::renderer::GpuError;

/// Bytes of the raw parameters of a Gaussian.
const RECORD: u64 = size_of::<TrainedRecord>() as u64;

impl Trainer<'_> {
    /// Returns the raw parameters of all Gaussians.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn records(&self) -> Result<Vec<TrainedRecord>, GpuError> {
        self.work.parameters.read_records(self.work.headless, Quantity::Values)
    }

    /// Puts Gaussians into the places of others. `records` has the raw parameters of all Gaussians, which change here
    /// too.
    pub(crate) fn replace(&self, records: &mut [TrainedRecord], born: &[Born]) {
        let (work, parameters) = (&self.work, &self.work.parameters);
        let mut encoder = work.encoder("gs4d births");
        let mut color = vec![0.0f32; 4 * parameters.stride() as usize];
        let bytes = size_of_val(&color[..]) as u64;
        for born in born {
            records[born.place as usize] = born.record;
            let holds = |chunk: &&ParameterChunk| (chunk.first()..chunk.first() + chunk.count()).contains(&born.place);
            let Some(chunk) = parameters.chunks.iter().find(holds) else { continue };
            let at = u64::from(born.place - chunk.first()) * bytes;
            let [values, moments @ ..] = chunk.color.stored();
            color[..3].copy_from_slice(&born.color);
            work.queue().write_buffer(values, at, bytemuck::cast_slice(&color));
            for buffer in moments {
                encoder.clear_buffer(buffer, at, Some(bytes));
            }
        }
        self.put(records, born.iter().map(|born| born.place), encoder);
    }

    /// Gives the Gaussians in these places this logit of opacity. `records` is as in [`replace`](Self::replace).
    pub(crate) fn hide(&self, records: &mut [TrainedRecord], places: &[u32], logit: f32) {
        places.iter().for_each(|&place| records[place as usize].opacity_logit[0] = logit);
        self.put(records, places.iter().copied(), self.work.encoder("gs4d floaters"));
    }

    /// Replaces the raw parameters, sets the moments in these places to 0, and draws the next views with what has
    /// changed.
    fn put(&self, records: &[TrainedRecord], places: impl Iterator<Item = u32>, mut encoder: wgpu::CommandEncoder) {
        let [values, moments @ ..] = self.work.parameters.geometry.stored();
        self.work.queue().write_buffer(values, 0, bytemuck::cast_slice(records));
        for place in places {
            for buffer in moments {
                encoder.clear_buffer(buffer, u64::from(place) * RECORD, Some(RECORD));
            }
        }
        self.work.queue().submit([encoder.finish()]);
        self.refresh();
    }
}
