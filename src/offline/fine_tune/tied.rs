//! Colors that are sums of entries of codebooks, in training.
//!
//! In: codebooks for the colors of the scene that is trained. Out: the codebooks after some steps.

use super::optimized::{ADAM_GROUPS, Optimized};
use super::parameters::{ParameterBuffers, TrainedPart};
use super::passes::Passes;
use super::trainer_error::TrainerError;
use crate::offline::layout::TiedColors;
use crate::offline::quantize::codebook::Centers;
use crate::renderer::{GpuError, Headless};
use ndarray::Array2;
use wgpu::BufferUsages;

/// Codebooks that the colors are tied to.
#[derive(Debug)]
pub(super) struct Tied {
    pub entries: Optimized,
    group: wgpu::BindGroup,
    /// Codes, and the number of entries of each codebook.
    books: Centers,
}

impl Tied {
    /// Uploads codebooks for all color coefficients but the first of each Gaussian. Rows are Gaussians.
    ///
    /// # Errors
    /// Codebooks of other Gaussians or coefficients, more Gaussians than a binding holds.
    pub(super) fn new(
        headless: &Headless,
        passes: &Passes,
        parameters: &ParameterBuffers,
        books: Centers,
    ) -> Result<Self, TrainerError> {
        let TrainedPart { color, .. } = parameters.only_part("the Gaussians that codebooks give colors")?;
        let (count, stride) = (color.count as usize, color.stride);
        let sizes: Vec<usize> = books.entries.iter().map(|book| book.nrows()).collect();
        let fits = |(codes, size): (&Vec<u32>, &usize)| {
            codes.len() == count && codes.iter().all(|&code| (code as usize) < *size)
        };
        let columns = |book: &Array2<f32>| (1..=stride as usize * 4 - 3).contains(&book.ncols());
        if books.codes.len() != sizes.len()
            || !books.codes.iter().zip(&sizes).all(fits)
            || !books.entries.iter().all(columns)
        {
            return Err(TrainerError::Codebooks);
        }
        let (total, stages) = (sizes.iter().sum::<usize>(), sizes.len());
        let mut values = vec![0.0f32; total * stride as usize * 4];
        let rows = books.entries.iter().flat_map(|book| book.rows());
        for (entry, row) in values.chunks_exact_mut(stride as usize * 4).zip(rows) {
            entry[3..].iter_mut().zip(row).for_each(|(to, from)| *to = *from);
        }
        let mut codes = Vec::with_capacity(count * stages);
        let mut members = vec![Vec::new(); total];
        for index in 0..count {
            let mut first = 0;
            for (own, size) in books.codes.iter().zip(&sizes) {
                let entry = first + own[index];
                codes.push(entry);
                members[entry as usize].push(index as u32);
                first += *size as u32;
            }
        }
        let mut firsts = vec![0u32];
        for own in &members {
            firsts.push(firsts.last().copied().unwrap_or_default() + own.len() as u32);
        }
        let allocator = headless.allocator();
        let queue = &headless.context().queue;
        let filled = |label, bytes: &[u8], usage| {
            let made = allocator.buffer(label, bytes.len().max(16) as u64, usage);
            queue.write_buffer(&made, 0, bytes);
            made
        };
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let settings = TiedColors { count: count as u32, stride, stages: stages as u32, padding: 0 };
        let settings = filled("gs4d tied colors", bytemuck::bytes_of(&settings), BufferUsages::UNIFORM);
        let codes = filled("gs4d codes", bytemuck::cast_slice(&codes), storage);
        let firsts = filled("gs4d first members", bytemuck::cast_slice(&firsts), storage);
        let members = filled("gs4d members", bytemuck::cast_slice(&members.concat()), storage);
        let values = filled("gs4d entries", bytemuck::cast_slice(&values), storage);
        let entries = Optimized::new(headless, passes, values, total as u32, stride);
        let Optimized { values, gradients, .. } = &entries;
        let buffers = [&settings, &codes, &firsts, &members, values, &color.values, &color.gradients, gradients];
        let group =
            allocator.bind_group("gs4d tied colors", &passes.tied_group, &buffers.map(wgpu::Buffer::as_entire_binding));
        Ok(Self { entries, group, books })
    }

    /// Records that the gradients of entries become the sums over the coefficients that use them.
    pub(super) fn record_collect(&self, pass: &mut wgpu::ComputePass<'_>, passes: &Passes) {
        pass.set_pipeline(&passes.collect);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(self.entries.count, 1, 1);
    }

    /// Records that the coefficients become the sums of their entries.
    pub(super) fn record_expand(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        passes: &Passes,
        parameters: &ParameterBuffers,
    ) {
        let values = parameters.count() * parameters.stride();
        pass.set_pipeline(&passes.expand);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(values.div_ceil(256).min(ADAM_GROUPS), 1, 1);
    }

    /// Returns the codebooks as they are.
    ///
    /// # Errors
    /// A lost device.
    pub(super) fn codebooks(&self, headless: &Headless) -> Result<Centers, GpuError> {
        let values: Vec<f32> = bytemuck::pod_collect_to_vec(&self.entries.read_values(headless)?);
        let mut books = self.books.clone();
        let rows = books.entries.iter_mut().flat_map(|book| book.rows_mut());
        for (entry, mut row) in values.chunks_exact(self.entries.stride as usize * 4).zip(rows) {
            row.iter_mut().zip(&entry[3..]).for_each(|(to, from)| *to = *from);
        }
        Ok(books)
    }
}
