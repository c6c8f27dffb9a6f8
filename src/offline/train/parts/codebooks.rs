//! Colors that are sums of entries of codebooks, in training.
//!
//! In: codebooks for the colors of the scene that is trained. Out: [`TrainedCodebooks`]: commands of the passes
//! `collect` and `expand` of `codebooks` and of `adam`; the codebooks after some steps.

use super::part::Part;
use super::request::Request;
use crate::offline::compress::codebook::Centers;
use crate::offline::engine::layout::TiedColors;
use crate::offline::engine::shaders::LIBRARIES;
use crate::offline::train::gpu::optimized::ADAM_GROUPS;
use crate::offline::train::gpu::{Optimized, ParameterChunk, Quantity, Workspace};
use crate::offline::train::schedule::Step;
use crate::offline::train::trainer_error::TrainerError;
use crate::renderer::device::bind::{Bind, group_layout, pipeline};
use crate::renderer::shaders::ShaderSet;
use crate::renderer::{GpuError, Headless, ShaderChecks};
use ndarray::Array2;
use wgpu::BufferUsages;

/// The shader of the pass `codebooks`.
pub(super) static SHADERS: ShaderSet =
    ShaderSet::new(&[("codebooks", include_str!("../../../../shaders/offline/codebooks.wgsl"))], LIBRARIES);

/// Codebooks whose entries are trained in place of all color coefficients but the first of each Gaussian.
#[derive(Debug)]
pub(crate) struct TrainedCodebooks {
    entries: Optimized,
    collect: wgpu::ComputePipeline,
    expand: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    /// Codes, and the number of entries of each codebook.
    books: Centers,
}

impl TrainedCodebooks {
    /// Makes the part if there are codebooks.
    pub(super) fn make(work: &Workspace<'_>, request: &Request<'_>) -> Result<Option<Box<dyn Part>>, TrainerError> {
        match request.codebooks {
            Some(books) => Ok(Some(Box::new(Self::new(work, books.clone())?))),
            None => Ok(None),
        }
    }

    /// Uploads codebooks for all color coefficients but the first of each Gaussian. Rows are Gaussians.
    ///
    /// # Errors
    /// Codebooks of other Gaussians or coefficients, more Gaussians than a binding holds.
    fn new(work: &Workspace<'_>, books: Centers) -> Result<Self, TrainerError> {
        use Bind::{Read, Uniform, Write};
        let ParameterChunk { color, .. } = work.parameters.only_chunk("the Gaussians that codebooks give colors")?;
        let (count, stride, stages) = (color.count, color.stride, books.entries.len() as u32);
        if !fits(&books, count as usize, stride as usize) {
            return Err(TrainerError::Codebooks);
        }
        let values = entry_values(&books, stride as usize);
        let Members { codes, firsts, members } = Members::of(&books, count as usize);
        let (allocator, device) = (work.headless.allocator(), &work.headless.context().device);
        let filled = |label, bytes: &[u8], usage| {
            let made = allocator.buffer(label, bytes.len().max(16) as u64, usage);
            work.queue().write_buffer(&made, 0, bytes);
            made
        };
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let settings = TiedColors { count, stride, stages, padding: 0 };
        let settings = filled("gs4d tied colors", bytemuck::bytes_of(&settings), BufferUsages::UNIFORM);
        let total = firsts.len() as u32 - 1;
        let codes = filled("gs4d codes", bytemuck::cast_slice(&codes), storage);
        let firsts = filled("gs4d first members", bytemuck::cast_slice(&firsts), storage);
        let members = filled("gs4d members", bytemuck::cast_slice(&members), storage);
        let values = filled("gs4d entries", bytemuck::cast_slice(&values), storage);
        let entries = Optimized::new(work.headless, &work.passes, values, total, stride);
        let Optimized { values, gradients, .. } = &entries;
        let buffers = [&settings, &codes, &firsts, &members, values, &color.values, &color.gradients, gradients];
        let bindings = [Uniform(size_of::<TiedColors>()), Read, Read, Read, Read, Write, Read, Write];
        let layout = group_layout(device, "gs4d tied colors", &bindings);
        let resources = buffers.map(wgpu::Buffer::as_entire_binding);
        let group = allocator.bind_group("gs4d tied colors", &layout, &resources);
        let shader = SHADERS.module(device, "codebooks", &[], ShaderChecks::Off)?;
        let [collect, expand] = ["collect", "expand"].map(|entry| pipeline(device, &shader, entry, &[Some(&layout)]));
        Ok(Self { entries, collect, expand, group, books })
    }

    /// Returns the codebooks as they are.
    ///
    /// # Errors
    /// A lost device.
    pub(crate) fn codebooks(&self, headless: &Headless) -> Result<Centers, GpuError> {
        let values: Vec<f32> = bytemuck::pod_collect_to_vec(&self.entries.read(headless, Quantity::Values)?);
        let mut books = self.books.clone();
        let rows = books.entries.iter_mut().flat_map(|book| book.rows_mut());
        for (entry, mut row) in values.chunks_exact(self.entries.stride as usize * 4).zip(rows) {
            row.iter_mut().zip(&entry[3..]).for_each(|(to, from)| *to = *from);
        }
        Ok(books)
    }
}

/// Returns whether codebooks are of this number of Gaussians, with colors of `stride` four-vectors.
fn fits(books: &Centers, count: usize, stride: usize) -> bool {
    let of_gaussians = |(codes, book): (&Vec<u32>, &Array2<f32>)| {
        codes.len() == count && codes.iter().all(|&code| (code as usize) < book.nrows())
    };
    books.codes.len() == books.entries.len()
        && books.codes.iter().zip(&books.entries).all(of_gaussians)
        && books.entries.iter().all(|book| (1..=stride * 4 - 3).contains(&book.ncols()))
}

/// Returns the entries of all codebooks, each as the color of a Gaussian whose first coefficient is 0.
fn entry_values(books: &Centers, stride: usize) -> Vec<f32> {
    let total: usize = books.entries.iter().map(|book| book.nrows()).sum();
    let mut values = vec![0.0f32; total * stride * 4];
    let rows = books.entries.iter().flat_map(|book| book.rows());
    for (entry, row) in values.chunks_exact_mut(stride * 4).zip(rows) {
        entry[3..].iter_mut().zip(row).for_each(|(to, from)| *to = *from);
    }
    values
}

/// Which Gaussian uses which entry.
struct Members {
    /// For each Gaussian its entry of each codebook, among the entries of all.
    codes: Vec<u32>,
    /// For each entry the place of its first Gaussian in `members`, and the end of all.
    firsts: Vec<u32>,
    /// The Gaussians that use each entry, one entry after the other.
    members: Vec<u32>,
}

impl Members {
    fn of(books: &Centers, count: usize) -> Self {
        let total = books.entries.iter().map(|book| book.nrows()).sum();
        let mut codes = Vec::with_capacity(count * books.codes.len());
        let mut members = vec![Vec::new(); total];
        for index in 0..count {
            let mut first = 0;
            for (own, book) in books.codes.iter().zip(&books.entries) {
                let entry = first + own[index];
                codes.push(entry);
                members[entry as usize].push(index as u32);
                first += book.nrows() as u32;
            }
        }
        let mut firsts = vec![0u32];
        for own in &members {
            firsts.push(firsts.last().copied().unwrap_or_default() + own.len() as u32);
        }
        Self { codes, firsts, members: members.concat() }
    }
}

impl Part for TrainedCodebooks {
    /// Records that the gradients of entries become the sums over the coefficients that use them. Coefficients keep
    /// their values, but the first of each Gaussian, which is its own.
    fn before_optimizer(&self, _: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, own: &mut Step) {
        pass.set_pipeline(&self.collect);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(self.entries.count, 1, 1);
        (own.rates.harmonics, own.color_values) = (0.0, None);
    }

    fn record_step(&self, work: &Workspace<'_>, pass: &mut wgpu::ComputePass<'_>, step: &Step) {
        let [_, rate, ..] = step.rates.of_harmonics(step.factor);
        self.entries.record_step(work.queue(), pass, &work.passes, [rate; 5], step.count, None);
    }

    /// Records that the coefficients become the sums of their entries.
    fn refresh(&self, work: &Workspace<'_>, encoder: &mut wgpu::CommandEncoder) {
        let values = work.parameters.count() * work.parameters.stride();
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.expand);
        pass.set_bind_group(0, &self.group, &[]);
        pass.dispatch_workgroups(values.div_ceil(256).min(ADAM_GROUPS), 1, 1);
    }

    fn optimized(&self) -> Option<&Optimized> {
        Some(&self.entries)
    }
}
