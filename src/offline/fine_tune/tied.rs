//! Colors that are sums of entries of codebooks, in training.
//!
//! In: codebooks for the colors of the scene that is trained. Out: the codebooks after some steps.

use super::optimized::Optimized;
use super::trainer::{ADAM_GROUPS, Trainer, TrainerError};
use crate::offline::quantize::codebook::Centers;
use crate::renderer::GpuError;
use crate::renderer::layout::TiedColors;
use ndarray::Array2;
use wgpu::BufferUsages;

/// Codebooks that the colors are tied to.
#[derive(Debug)]
pub(super) struct Tied {
    pub entries: Optimized,
    pub group: wgpu::BindGroup,
    /// Codes, and the number of entries of each codebook.
    pub books: Centers,
}

impl Trainer<'_> {
    /// Makes all color coefficients but the first of each Gaussian sums of entries of codebooks, which are trained in their place. Rows are
    /// Gaussians.
    ///
    /// # Errors
    /// Codebooks of other Gaussians or coefficients.
    pub fn tie(&mut self, books: Centers) -> Result<(), TrainerError> {
        let (count, stride) = (self.capture.len(), self.color.stride);
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
        let allocator = self.headless.allocator();
        let queue = &self.headless.context().queue;
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
        let entries = Optimized::new(self.headless, &self.passes, &self.notes, values, total as u32, stride);
        let Optimized { values, gradients, .. } = &entries;
        let buffers =
            [&settings, &codes, &firsts, &members, values, &self.color.values, &self.color.gradients, gradients];
        let group = allocator.bind_group(
            "gs4d tied colors",
            &self.passes.tied_group,
            &buffers.map(wgpu::Buffer::as_entire_binding),
        );
        let tied = Tied { entries, group, books };
        let mut encoder = self.encoder("gs4d expand");
        self.expand(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), &tied);
        queue.submit([encoder.finish()]);
        self.tied = Some(tied);
        Ok(())
    }

    /// Records that the coefficients become the sums of their entries.
    pub(super) fn expand(&self, pass: &mut wgpu::ComputePass<'_>, tied: &Tied) {
        let values = self.color.count * self.color.stride;
        pass.set_pipeline(&self.passes.expand);
        pass.set_bind_group(0, &tied.group, &[]);
        pass.dispatch_workgroups(values.div_ceil(256).min(ADAM_GROUPS), 1, 1);
    }

    /// Returns the codebooks as they are; `None` unless colors are [tied](Self::tie).
    ///
    /// # Errors
    /// A lost device.
    pub fn codebooks(&self) -> Result<Option<Centers>, GpuError> {
        let Some(Tied { entries, books, .. }) = &self.tied else { return Ok(None) };
        let values: Vec<f32> = bytemuck::pod_collect_to_vec(&self.read(&entries.values)?);
        let mut books = books.clone();
        let rows = books.entries.iter_mut().flat_map(|book| book.rows_mut());
        for (entry, mut row) in values.chunks_exact(entries.stride as usize * 4).zip(rows) {
            row.iter_mut().zip(&entry[3..]).for_each(|(to, from)| *to = *from);
        }
        Ok(Some(books))
    }
}
